"""The search for encounters: every close approach of one object to all others, or of any two, as a table.

Objects that element sets cannot separate from the follower over the whole span are docked craft, and count as one row.
"""

from __future__ import annotations

import datetime
import math
import numbers
import warnings
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Literal

import numpy as np

from rso_lidar import units
from rso_lidar.errors import CatalogError, RsoLidarWarning, ScenarioError, quote_value
from rso_lidar.mission_analysis.passes.covariance_sources import CovarianceSources
from rso_lidar.mission_analysis.passes.exclusion import TOGETHER_M
from rso_lidar.mission_analysis.passes.pass_collision import HardBodies, PassObject, assess_pass
from rso_lidar.mission_analysis.passes.pass_geometry import Encounter, build_encounters, reach_m
from rso_lidar.mission_analysis.passes.pass_table import Encounters
from rso_lidar.mission_analysis.passes.plate_light import PlateLight, ViewedPlate
from rso_lidar.mission_analysis.passes.search_objects import SearchObjects, collect_objects, load_follower
from rso_lidar.orbit import (
    STALE_DAYS,
    ElementSet,
    Epochs,
    NamedTrajectory,
    PairScreening,
    ScheduledFleet,
    ScreeningResult,
    Trajectory,
    screen,
    screen_pairs,
)
from rso_lidar.pose import rotate_vectors
from rso_lidar.rpo import rtn_matrix
from rso_lidar.scenario import Constraints, Finding, Lidar

Order = Literal["range", "time", "speed"]
_KEYS = {
    "range": lambda row: (row.range_m, row.time_s),
    "time": lambda row: (row.time_s, row.range_m),
    "speed": lambda row: (row.speed_m_s, row.time_s),
}
# One standard deviation of a set at its epoch, radial and cross-track [m]: Flohrer, Krag & Klinkrad, Assessment and
# Categorization of TLE Orbit Errors for the US SSN Catalogue (AMOS 2008). Low confidence: the values are quoted from memory
# and were not checked in the paper. Sets of one object at successive epochs support them: 90 % of 340 pairs of ISS and CSS
# of 2026 agree within 85 m, radial and cross-track, over a revolution.
_RADIAL_M = {"leo": 102.0, "meo": 71.0, "geo": 359.0, "heo": 2252.0, "other": 102.0}
_ACROSS_M = {"leo": 126.0, "meo": 95.0, "geo": 83.0, "heo": 1421.0, "other": 126.0}
# The along-track error grows with age: 1 km at the epoch, and up to 3 km per day (docs/orbits.md).
_ALONG_M, _ALONG_M_DAY = 1e3, 3e3
_STEP_S = 120.0
_NEAR_M = 20e3  # a closest approach beyond this is never attributed to errors of the sets


def encounters(
    catalog: str | Path | Iterable[Any] | Mapping[str, Any],
    follower: Any = None,
    *,
    within_m: float,
    start_utc: datetime.datetime,
    days: float,
    lidar: Lidar | None = None,
    lidar_name: str = "",
    max_slew_deg_s: float = Encounters.MAX_SLEW_DEG_S,
    constraints: Constraints | None = None,
    sunlit: bool = False,
    min_duration_s: float = 0.0,
    sort: Order = "range",
    limit: int | None = None,
    plate: ViewedPlate | None = None,
    finding: Finding | None = None,
    radius_m: float | None = None,
    hard_bodies: Mapping[Any, Any] | None = None,
    covariances: Any = None,
    settings: Sequence[str] = (),
    trust_code: bool = False,
    trust_fmu: bool = False,
) -> Encounters:
    """Find every encounter of `follower` with other objects, or of any two of them, each refined to the millisecond.

    An encounter is one pass within `within_m`. Objects are element sets, which SGP4 propagates and which are good to about a
    kilometre, or trajectories: anything that answers `states`. Of several sets of one object, the one nearest in epoch is
    used at each time. Objects that element sets cannot separate over the whole span count as docked: each such pair has one
    row, after all others.

    Parameters
    ----------
    catalog : objects of the search: a file (element sets, OEM or CSV ephemeris, or a scenario's bodies), a catalogue, a list
        of files, element sets and trajectories, or a mapping of names to trajectories
    follower : catalogue number, name, element set, or trajectory of the object with the lidar, or `Path` of a file of one
        object, such as a scenario. None: every two objects of the catalogue, with the lidar on the first one
    within_m : greatest distance of an encounter [m]
    start_utc, days : start, with an offset, and length of the searched span
    lidar : instrument whose reach counts (None: the preset ``long_range_1064``)
    lidar_name : its name in the notes (empty: the name of its preset)
    max_slew_deg_s : greatest rate of the line of sight [deg/s]
    constraints : exclusion angles of a boresight at the object, keep-out sphere and corridors, for every object
    sunlit : whether to keep only objects that are in sunlight at the closest approach
    min_duration_s : least duration of an encounter [s]
    sort : order of the rows
    limit : greatest number of rows (None: all)
    plate : what the lidar looks at, and how often (None: all values are assumed)
    finding : when it counts as found (None: one pixel of one flash)

    Other Parameters
    ----------------
    radius_m : combined hard-body radius of all pairs, with which the probability of collision is computed where both
        covariances are known [m]; None: the sum of `hard_bodies`, and of the meshes of scenarios' targets
    hard_bodies : radius of single objects by name or catalogue number: metres, or a model of the catalogue, whose radius is
        that of a sphere about its centre of mass that holds its mesh
    covariances : sources of covariances, some perhaps as pairs of a name or catalogue number and a source, or a mapping. A
        source is a file (OEM, OPM, CDM, element sets, or a CSV table by age with age_days, radial_m, along_m, cross_m),
        `SetErrors`, `SetErrorTable`, or anything that answers `at(epochs)` with (time, 6, 6) in GCRS axes. Element sets of
        `catalog` are a source for their own object, as are covariances in its OEM or OPM
    settings : fields that are set in each scenario among the files, as `lidar.laser.energy_mj=20`
    trust_code, trust_fmu : whether Python code, and the native code of FMUs, may run that scenarios among the files name

    Returns
    -------
    Encounters
        The table, with notes.

    Raises
    ------
    ScenarioError
        For limits and spans without meaning, for a follower that is not in the catalogue, and for radii and covariances that
        cannot be used.
    """
    check_span(within_m, start_utc, days, max_slew_deg_s)
    if sort not in _KEYS:
        raise ScenarioError(f"sort: {quote_value(sort)} is not a sort order; use one of {', '.join(_KEYS)}")
    if limit is not None and (isinstance(limit, bool) or not isinstance(limit, numbers.Integral) or limit < 1):
        raise ScenarioError(
            f"limit: {quote_value(limit)} is not a number of rows; give 1 or more, or omit it for all rows"
        )
    _check_number("min_duration", "s", min_duration_s)
    if not min_duration_s >= 0.0:
        raise ScenarioError(f"min_duration: {min_duration_s:g} s is not a duration; give 0 or more")
    if lidar is None:
        lidar, lidar_name = Lidar(preset="long_range_1064"), "long_range_1064"  # type: ignore[call-arg]
    light = PlateLight(lidar, plate or ViewedPlate(), finding or Finding())
    if isinstance(follower, Path):
        follower = load_follower(str(follower), settings=settings, trust_code=trust_code, trust_fmu=trust_fmu)
    found_objects = collect_objects(catalog, settings=settings, trust_code=trust_code, trust_fmu=trust_fmu)
    entries = [*found_objects.entries, *_list_sets(follower)]
    bodies, sources = HardBodies(entries, radius_m, hard_bodies), CovarianceSources(covariances, entries)
    lead: Any = None
    leads: list[Any]
    screening: ScreeningResult | PairScreening
    if follower is None:
        others = group_by_object(found_objects.entries)
        if len(others) < 2:
            label, why = next(iter(found_objects.problems), (found_objects.where, "no other object is there"))
            raise CatalogError(f"{label}: {why}; all pairs need two or more objects, and {len(others)} can be used")
        leads = others
        screening = screen_pairs(others, start_utc, days * units.DAY_S, within_m)
    else:
        own = choose_follower(found_objects, follower, catalog)
        lead = own[0]
        if isinstance(lead, ElementSet):
            lead = min(own, key=lambda entry: abs((entry.epoch_utc - start_utc).total_seconds()))
        leads = [own]
        others = group_by_object([entry for entry in found_objects.entries if not is_same(entry, lead)])
        screening = screen(
            own if isinstance(lead, ElementSet) else lead, others, start_utc, days * units.DAY_S, within_m
        )
        warn_of_age(screening.follower, lead)
    reach = reach_m(lidar)
    rows = fold_docked(
        screening, sorted(build_encounters(screening, reach, max_slew_deg_s, light, constraints), key=_KEYS[sort])
    )
    rows = [row for row in rows if row.inside_s >= min_duration_s and (row.sunlit_fraction >= 0.5 or not sunlit)][
        :limit
    ]
    is_asked = bodies.is_asked or covariances is not None
    if is_asked:
        rows = [_assess_row(row, leads, others, start_utc, sources, bodies) for row in rows]
    return Encounters(
        rows=tuple(rows),
        follower=lead,
        lidar=lidar,
        lidar_name=lidar_name or lidar.preset or "as given",
        start_utc=start_utc,
        days=days,
        within_m=within_m,
        max_slew_deg_s=max_slew_deg_s,
        reach_m=reach,
        screened=len(others),
        rejected=(*found_objects.problems, *screening.rejected),
        constraints=constraints,
        switching=screening.objects.switching + (0 if lead is None else screening.follower.switching),
        light=light,
        has_collisions=is_asked,
    )


def _list_sets(follower: Any) -> list[Any]:
    """List the element sets of a follower that was given as such."""
    return list(follower) if isinstance(follower, list | tuple) else [follower]


def _assess_row(
    row: Encounter,
    leads: Sequence[Any],
    others: Sequence[Any],
    start_utc: datetime.datetime,
    sources: CovarianceSources,
    bodies: HardBodies,
) -> Encounter:
    """Add the probability of collision to an encounter.

    Parameters
    ----------
    leads, others : objects by the numbers of the screening: those with the lidar, and those that it looks at
    """
    if row.docked:
        return row
    follower = PassObject(leads[row.stay.lead], row.follower_label, row.follower_age_days, row.states[0])
    target = PassObject(others[row.stay.which], row.label, row.age_days, row.states[1])
    epochs = Epochs(start_utc, np.array([row.time_s]))
    return replace(row, collision=assess_pass(follower, target, epochs, sources, bodies))


def check_span(within_m: float, start_utc: datetime.datetime, days: float, max_slew_deg_s: float) -> None:
    """Raise `ScenarioError` for limits and spans without meaning."""
    for what, unit, value in (("within", "m", within_m), ("max_slew", "deg/s", max_slew_deg_s)):
        _check_number(what, unit, value)
    if not 0.0 < within_m <= 1e8:
        raise ScenarioError(f"within: {within_m:g} m is not a search distance; give one up to 100,000 km")
    check_days(start_utc, days)
    if not 0.0 < max_slew_deg_s < 1e6:
        raise ScenarioError(f"max_slew: {max_slew_deg_s:g} deg/s is not a slew limit; give more than 0")


def check_days(start_utc: datetime.datetime, days: float) -> None:
    """Raise `ScenarioError` for a start or a number of days without meaning."""
    _check_number("days", "days", days)
    if not isinstance(start_utc, datetime.datetime):
        raise ScenarioError(f"start: {quote_value(start_utc)} is not a time; give a datetime with its time zone")
    if start_utc.tzinfo is None:
        raise ScenarioError("start: a time without an offset is ambiguous; end it with Z or +00:00")
    if not 0.0 < days <= 60.0:
        raise ScenarioError(f"days: {days:g} is not a time span; give more than 0 and at most 60 days")


def _check_number(what: str, unit: str, value: Any) -> None:
    """Refuse a value that is not a number."""
    if isinstance(value, bool) or not isinstance(value, numbers.Real):
        raise ScenarioError(f"{what}: {quote_value(value)} is not a number; give one in {unit}, without the unit")


def choose_follower(objects: SearchObjects, follower: Any, catalog: Any) -> list[Any]:
    """Return the element sets of the follower, or its trajectory."""
    if isinstance(follower, ElementSet | NamedTrajectory):
        return [follower]
    if isinstance(follower, list | tuple) and follower and all(isinstance(entry, ElementSet) for entry in follower):
        return list(follower)
    if isinstance(follower, Trajectory):
        known = (entry for entry in objects.entries if getattr(entry, "trajectory", None) is follower)
        return [next(known, NamedTrajectory("follower", follower))]
    if isinstance(follower, bool) or not isinstance(follower, str | numbers.Integral):
        raise ScenarioError(
            f"follower: {quote_value(follower)} is not an object; give its catalogue number or its name, or a trajectory"
        )
    return objects.find(follower if isinstance(follower, str) else int(follower), catalog)


def warn_of_age(flights: ScheduledFleet, lead: ElementSet) -> None:
    """Warn if the follower, the first of the objects, is propagated far from the epoch of its element set."""
    age_days, oldest = flights.oldest(0)
    if age_days > STALE_DAYS:
        warnings.warn(
            f"follower {lead.label}: flown up to {age_days:.1f} days from its epoch {oldest.epoch_utc:%Y-%m-%dT%H:%MZ}: "
            f"beyond {STALE_DAYS:g} days expect errors of many kilometres; take a set nearer to the span",
            RsoLidarWarning,
            stacklevel=3,
        )


def is_same(entry: Any, lead: Any) -> bool:
    """Return whether an entry is the follower: the same one, or an element set of the same object."""
    if not (isinstance(entry, ElementSet) and isinstance(lead, ElementSet)):
        if getattr(entry, "trajectory", entry) is getattr(lead, "trajectory", lead):
            return True
        if not (isinstance(entry, NamedTrajectory) and isinstance(lead, NamedTrajectory) and entry.source):
            return False
        first, second = (candidate.name_in_source or candidate.name for candidate in (entry, lead))
        return (entry.source, first) == (lead.source, second)
    return entry is lead or (entry.identity == lead.identity and any(lead.identity))


def group_by_object(entries: Iterable[Any]) -> list[Any]:
    """Return the sets of each object, and trajectories; a set with neither number nor name is an object of its own."""
    objects: dict[Any, Any] = {}
    for number, entry in enumerate(entries):
        if isinstance(entry, ElementSet):
            objects.setdefault(entry.identity if any(entry.identity) else number, []).append(entry)
        else:
            objects[number] = entry
    return list(objects.values())


def fold_docked(screened: ScreeningResult | PairScreening, rows: Sequence[Encounter]) -> list[Encounter]:
    """Merge the encounters of each docked object into one row with the reason, after all other rows.

    An object counts as docked if its position relative to the follower stays within the errors of both sets. This must
    hold over the whole span, or over the part in which both have a state. Along-track errors are 1 km and 3 km per day
    for each set. Radial and cross-track errors are one standard deviation of the difference. They are three standard
    deviations where the catalogue gives both the same elements for a part of the span. A formation with an ellipse of
    some hundred metres (TerraSAR-X and TanDEM-X) does not count.

    Returns
    -------
    list of Encounter
        The others unchanged, then the closest one of each docked object, with NaN for what a lidar would see.
    """
    reasons: dict[tuple[int, int], str | None] = {}
    others: list[Encounter] = []
    docked: dict[tuple[int, int], list[Encounter]] = {}
    for row in rows:
        pair = row.stay.lead, row.stay.which
        if pair not in reasons:
            reasons[pair] = _explain_docking(screened, *pair) if row.range_m < _NEAR_M else None
        if reasons[pair] is None:
            others.append(row)
        else:
            docked.setdefault(pair, []).append(row)
    return others + [_merge_stays(stays, str(reasons[pair])) for pair, stays in docked.items()]


def _merge_stays(stays: Sequence[Encounter], reason: str) -> Encounter:
    nearest = min(stays, key=lambda row: row.range_m)
    first, last = min(stays, key=lambda row: row.stay.enter_s), max(stays, key=lambda row: row.stay.leave_s)
    return replace(
        nearest,
        from_utc=first.from_utc,
        to_utc=last.to_utc,
        entered=first.entered,
        left=last.left,
        inside_s=sum(row.inside_s for row in stays),
        minima=sum(row.minima for row in stays),
        switches=sum(row.switches for row in stays),
        docked=reason,
        lidar_s=math.nan,
        slew_s=math.nan,
        clear_s=math.nan,
        usable_s=math.nan,
        photons=math.nan,
        target_pixels=math.nan,
        background_photons_per_s=math.nan,
        detection_probability=math.nan,
        best_probability=math.nan,
        found_probability=math.nan,
    )


def _explain_docking(screened: ScreeningResult | PairScreening, own_number: int, which: int) -> str | None:
    """Explain why two objects count as docked; None where they do not, and for trajectories that differ."""
    lead, objects = screened.follower, screened.objects
    time_s = np.append(np.arange(0.0, objects.duration_s, _STEP_S), objects.duration_s)
    own, there = np.full(len(time_s), own_number), np.full(len(time_s), which)
    position, velocity = lead.at(own, time_s)
    apart = rotate_vectors(
        np.swapaxes(rtn_matrix(position, velocity)[0], -1, -2), objects.at(there, time_s)[0] - position
    )
    known = np.isfinite(apart).all(axis=1)  # a trajectory may begin late or end early
    if not known.any():
        return None
    apart, own, there, time_s = apart[known], own[known], there[known], time_s[known]
    together = np.abs(apart).max(axis=1) < TOGETHER_M
    days = np.abs(lead.ages_days(own, time_s)) + np.abs(objects.ages_days(there, time_s))
    if together.all():
        return "the catalogue gives both the same elements" if np.isfinite(days).all() else "both have the same states"
    if not np.isfinite(days).all():  # only element sets have errors of a known size
        return None
    regime = lead.elements(own_number, 0.0).regime
    sigmas = (3.0 if together.any() else 1.0) * math.sqrt(2.0)  # of the difference of two sets
    most = np.abs(apart).max(axis=0)
    radial_m, across_m = sigmas * _RADIAL_M[regime], sigmas * _ACROSS_M[regime]
    along = np.abs(apart[:, 1]) <= 2.0 * _ALONG_M + _ALONG_M_DAY * days
    if most[0] > radial_m or most[2] > across_m or not along.all():
        return None
    along_km = (2.0 * _ALONG_M + _ALONG_M_DAY * float(days.max())) / units.KM
    same = (
        f"the catalogue gives both the same elements for {together.mean():.0%} of the time, and else "
        if together.any()
        else ""
    )
    return (
        f"{same}the sets differ by no more than their own errors: radial {most[0]:.0f} of {radial_m:.0f} m, along the track "
        f"{most[1] / units.KM:.2f} of up to {along_km:.1f} km, across {most[2]:.0f} of {across_m:.0f} m"
    )
