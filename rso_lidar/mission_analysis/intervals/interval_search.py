"""The search for events: intervals in which an expression holds, for one object with others or for any two."""

from __future__ import annotations

import datetime
import re
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from rso_lidar import units
from rso_lidar.errors import CatalogError, ScenarioError, quote_value
from rso_lidar.mission_analysis.intervals.conditions import (
    WORDS,
    EventContext,
    EventSearch,
    find_windows,
)
from rso_lidar.mission_analysis.intervals.event_table import Event, Events
from rso_lidar.mission_analysis.intervals.exhaust import PlanExhaust
from rso_lidar.mission_analysis.intervals.expression import (
    Condition,
    Expression,
    find_in_windows,
    parse_expression,
)
from rso_lidar.mission_analysis.intervals.pointing import FollowerPointing
from rso_lidar.mission_analysis.passes.pass_geometry import reach_m
from rso_lidar.mission_analysis.passes.plate_light import PlateLight, ViewedPlate
from rso_lidar.mission_analysis.passes.search import check_days, choose_follower, group_by_object, is_same, warn_of_age
from rso_lidar.mission_analysis.passes.search_objects import BodyTrajectory, collect_objects, load_follower
from rso_lidar.orbit import (
    PHASE_RAD,
    SUN_ANGLE_RAD,
    ElementSet,
    GroundStation,
    ScheduledFleet,
    find_minima,
    format_utc,
    join_spans,
)
from rso_lidar.records import BodyState
from rso_lidar.scenario import Constraints, Finding, Lidar

_NAMED = re.compile(r"\s*([A-Za-z_][\w -]*?)\s*=\s*")  # before an expression, in which = stands alone nowhere


def events(
    catalog: str | Path | Iterable[Any] | Mapping[str, Any],
    follower: Any = None,
    when: str | Sequence[str] | Mapping[str, str] | None = None,
    *,
    start_utc: datetime.datetime | None = None,
    days: float = 1.0,
    lidar: Lidar | None = None,
    lidar_name: str = "",
    stations: Sequence[GroundStation] = (),
    constraints: Constraints | None = None,
    keep_out_m: float | None = None,
    min_duration_s: float = 0.0,
    limit: int | None = None,
    plate: ViewedPlate | None = None,
    finding: Finding | None = None,
    settings: Sequence[str] = (),
    trust_code: bool = False,
    trust_fmu: bool = False,
) -> Events:
    """Find the intervals in which conditions on a follower and other objects hold, over days.

    Objects are element sets or trajectories, as for `encounters`. Edges are followed to 0.1 ms. How finely the time is
    divided follows from bounds on the rate of each condition, so that no interval of 0.1 s is missed.

    Parameters
    ----------
    catalog : objects of the search: a file (element sets, OEM or CSV ephemeris, or a scenario's bodies), a catalogue, a list
        of files, element sets and trajectories, or a mapping of names to trajectories
    follower : catalogue number, name, element set, or trajectory of the object with the lidar, or `Path` of a file of one
        object, such as a scenario. None: every two objects of the catalogue, with the lidar on the first one
    when : an expression such as ``range < 50km and lit``, several, or a mapping of names to expressions (None: the Earth is
        not between, and a facing plate of 1 m2 is in the lidar's reach)
    start_utc : start of the search (None: that of the follower's scenario)
    days : its length

    Other Parameters
    ----------------
    lidar, constraints, finding : instrument, keep-out sphere and corridors, and when a target counts as found (None: those
        of the follower's scenario; else the preset ``long_range_1064``, none, and one pixel of one flash)
    keep_out_m : radius of the keep-out sphere [m] (None: that of the constraints)
    lidar_name : its name in the notes (empty: the name of its preset)
    stations : on the ground, each with a name
    min_duration_s : least duration of an interval [s]
    limit : greatest number of rows (None: all)
    plate : what the lidar looks at (None: all values are assumed)
    settings : fields that are set in each scenario among the files, as `lidar.laser.energy_mj=20`
    trust_code, trust_fmu : whether Python code, and the native code of FMUs, may run that scenarios among the files name

    Returns
    -------
    Events
        The table, in order of time.

    Raises
    ------
    ScenarioError
        For expressions, stations and spans without meaning.
    CatalogError
        For objects that cannot be used, and a follower that is not among them.
    """
    if isinstance(follower, Path):
        follower = load_follower(str(follower), settings=settings, trust_code=trust_code, trust_fmu=trust_fmu)
    body = getattr(follower, "trajectory", follower)
    scenario = body.scenario if isinstance(body, BodyTrajectory) else None
    if scenario is not None:
        start_utc = scenario.time.start_utc if start_utc is None else start_utc
        constraints = scenario.constraints if constraints is None else constraints
        finding = scenario.finding if finding is None else finding
        if lidar is None:
            lidar, lidar_name = scenario.instrument, scenario.name
    if keep_out_m is not None:
        constraints = (constraints or Constraints()).replace(keep_out_m=keep_out_m)
    if start_utc is None:
        raise ScenarioError(
            "start: is needed where the follower is no body of a scenario; give a datetime with its zone"
        )
    check_days(start_utc, days)
    if not (isinstance(min_duration_s, int | float) and min_duration_s >= 0.0):
        raise ScenarioError(f"min_duration: {quote_value(min_duration_s)} is not a duration; give 0 or more seconds")
    if limit is not None and (isinstance(limit, bool) or not isinstance(limit, int) or limit < 1):
        raise ScenarioError(f"limit: {quote_value(limit)} is not a number of rows; give 1 or more, or omit it")
    if lidar is None:
        lidar, lidar_name = Lidar(preset="long_range_1064"), "long_range_1064"  # type: ignore[call-arg]
    light = PlateLight(lidar, plate or ViewedPlate(), finding or Finding())
    texts = _name_expressions(when, lidar)
    expressions = {name: parse_expression(text, WORDS) for name, text in texts.items()}
    objects = collect_objects(catalog, settings=settings, trust_code=trust_code, trust_fmu=trust_fmu)
    lead: Any = None
    if follower is None:
        flown = group_by_object(objects.entries)
        pairs = [(first, second) for first in range(len(flown)) for second in range(first + 1, len(flown))]
    else:
        own = choose_follower(objects, follower, catalog)
        lead = own[0]
        others = group_by_object([entry for entry in objects.entries if not is_same(entry, lead)])
        flown = [own if isinstance(lead, ElementSet) else lead, *others]
        pairs = [(0, number) for number in range(1, len(flown))]
    if not pairs:
        label, why = next(iter(objects.problems), (objects.where, "no other object is there"))
        raise CatalogError(f"{label}: {why}; events need two or more objects, and {len(flown)} can be used")
    duration_s = days * units.DAY_S
    flights = ScheduledFleet(flown, start_utc, duration_s)
    if isinstance(lead, ElementSet):
        warn_of_age(flights, lead)
    pointing = exhaust = None
    if scenario is not None:
        shift_s = (start_utc - scenario.time.start_utc).total_seconds()
        if body.name == "follower" and _ask_for(("field", "beam", "regard", "angle"), expressions.values()):
            pointing = FollowerPointing(scenario, shift_s + duration_s)
        if _ask_for(("plume",), expressions.values()):
            exhaust = PlanExhaust(scenario, body.name, shift_s + duration_s, shift_s)
    instrument = EventContext(light, constraints, _name_stations(stations), pointing, exhaust)
    search = EventSearch(flights, instrument)
    for expression in expressions.values():
        for condition in _list_conditions(expression):
            search.check(condition)
    rows = [
        row
        for pair in pairs
        for name, expression in expressions.items()
        for row in _find_rows(search, flights, pair, name, expression, duration_s)
        if row.duration_s >= min_duration_s
    ]
    rows.sort(key=lambda row: (row.from_s, row.name, row.event))
    return Events(
        rows=tuple(rows[:limit]),
        expressions=texts,
        follower=lead,
        lidar=lidar,
        lidar_name=lidar_name or lidar.preset or "as given",
        start_utc=start_utc,
        days=days,
        labels=tuple(map(_label_object, flown if follower is None else flown[1:])),
        rejected=(*objects.problems, *flights.gaps),
        light=light,
        stations=tuple(stations),
    )


def _name_expressions(when: Any, lidar: Lidar) -> dict[str, str]:
    """Return the expressions that are asked for, by their names; one without a name is its own."""
    if when is None:
        when = {"in reach": f"visible and range < {reach_m(lidar)[1]:.6g}m"}
    if isinstance(when, Mapping):
        named = {str(name): text for name, text in when.items()}
    else:
        several = [when] if isinstance(when, str) else list(when)
        named = {}
        for text in several:
            match = _NAMED.match(text) if isinstance(text, str) else None
            named[match[1] if match else str(text).strip()] = text[match.end() :] if match else text
        if len(named) < len(several):
            raise ScenarioError("when: two expressions have one name; name each, as NAME = EXPRESSION")
    for name, text in named.items():
        if not isinstance(text, str):
            raise ScenarioError(f"when: {name}: {quote_value(text)} is not an expression; give text")
    if not named:
        raise ScenarioError("when: no expression is given; give one, such as range < 50km")
    return named


def _label_object(entry: Any) -> str:
    """Return the name of a trajectory, or of the object of some element sets; its label where it has no name."""
    first = entry[0] if isinstance(entry, list) else entry
    return str(getattr(first, "name", "") or first.label)


def _list_conditions(expression: Expression) -> list[Condition]:
    """List the conditions of an expression."""
    if isinstance(expression, Condition):
        return [expression]
    return [condition for part in expression.parts for condition in _list_conditions(part)]


def _ask_for(words: Sequence[str], expressions: Iterable[Expression]) -> bool:
    """Return whether an expression has one of some words."""
    return any(condition.word in words for expression in expressions for condition in _list_conditions(expression))


def _name_stations(stations: Sequence[GroundStation]) -> dict[str, GroundStation]:
    named = {station.name: station for station in stations}
    if "" in named:
        raise ScenarioError("stations: one has no name; give GroundStation(..., name=...)")
    if len(named) < len(stations):
        raise ScenarioError("stations: two have one name; rename one")
    return named


def _find_rows(
    search: EventSearch,
    flights: ScheduledFleet,
    pair: tuple[int, int],
    name: str,
    expression: Expression,
    duration_s: float,
) -> list[Event]:
    """Find the events of one expression for two objects, with what the follower sees in them."""

    def find(condition: Condition, windows: Sequence[tuple[float, float]]) -> list[tuple[float, float]]:
        return search.find(condition, windows, *pair)

    windows = find_windows(flights, *pair, duration_s)
    spans = join_spans(find_in_windows(expression, find, windows))
    if not spans:
        return []
    begins, ends = np.array(spans).T
    nearest_s, nearest_m = find_minima(lambda time_s: search.sample(*pair, time_s).range_m, begins, ends)
    farthest_m = -find_minima(lambda time_s: -search.sample(*pair, time_s).range_m, begins, ends)[1]
    lit = _measure_shares(search.find(Condition("lit"), spans, *pair), begins, ends)
    there = search.sample(*pair, nearest_s)
    phase, sun = PHASE_RAD.value(there) / units.DEG, SUN_ANGLE_RAD.value(there) / units.DEG
    speed = np.linalg.norm(there.rate_m_s, axis=1)
    known_s = windows[0][0], windows[-1][1]
    rows = []
    for k, (begin, end) in enumerate(spans):
        entries = tuple(flights.elements(number, float(nearest_s[k])) for number in pair)
        rows.append(
            Event(
                event=name,
                follower_name=entries[0].name,
                follower_norad_id=entries[0].norad_id,
                name=entries[1].name,
                norad_id=entries[1].norad_id,
                begin_utc=format_utc(flights.start_utc, begin),
                end_utc=format_utc(flights.start_utc, end),
                duration_s=end - begin,
                begins=begin > known_s[0],
                ends=end < known_s[1],
                nearest_utc=format_utc(flights.start_utc, float(nearest_s[k])),
                nearest_m=float(nearest_m[k]),
                farthest_m=float(farthest_m[k]),
                speed_m_s=float(speed[k]),
                lit_fraction=float(lit[k]),
                phase_deg=float(phase[k]),
                sun_angle_deg=float(sun[k]),
                from_s=begin,
                to_s=end,
                nearest_s=float(nearest_s[k]),
                entries=entries,
                states=(_select_state(there.observer, k), _select_state(there.target, k)),
            )
        )
    return rows


def _measure_shares(parts: Sequence[tuple[float, float]], begins_s: np.ndarray, ends_s: np.ndarray) -> np.ndarray:
    """Return the share (span,) of each span that ascending parts cover [s]."""
    if not parts:
        return np.zeros(len(begins_s))
    from_s, to_s = np.array(parts).T
    covered = np.maximum(np.minimum(ends_s[:, None], to_s) - np.maximum(begins_s[:, None], from_s), 0.0).sum(axis=1)
    shares: np.ndarray = np.clip(covered / np.maximum(ends_s - begins_s, 1e-9), 0.0, 1.0)
    return shares


def _select_state(states: BodyState, row: int) -> BodyState:
    return BodyState(states.position_m[row], states.velocity_m_s[row])
