"""The search for encounters: every close approach of one object of a catalogue to all others, as a table."""

from __future__ import annotations

import datetime
import numbers
import warnings
from collections.abc import Iterable
from pathlib import Path
from typing import Any, Literal

from rso_lidar import units
from rso_lidar.errors import CatalogError, RsoLidarWarning, ScenarioError, did_you_mean
from rso_lidar.orbit.screening.conjunctions import screen
from rso_lidar.orbit.sets.catalog import Catalog
from rso_lidar.orbit.sets.element_set import ElementSet, quote
from rso_lidar.orbit.sets.formats import read_element_sets
from rso_lidar.orbit.sets.teme import STALE_DAYS
from rso_lidar.scenario import Constraints, Lidar
from rso_lidar.study.passes.docked import fold_docked
from rso_lidar.study.passes.pass_geometry import (
    build_encounters,
    reach_m,
)
from rso_lidar.study.passes.pass_table import Encounters

Order = Literal["range", "time", "speed"]
MAX_SLEW_DEG_S = 2.0
_KEYS = {
    "range": lambda row: (row.range_m, row.time_s),
    "time": lambda row: (row.time_s, row.range_m),
    "speed": lambda row: (row.speed_m_s, row.time_s),
}


def encounters(
    catalog: str | Path | Iterable[ElementSet],
    follower: int | str | ElementSet,
    *,
    within_m: float,
    start_utc: datetime.datetime,
    days: float,
    lidar: Lidar | None = None,
    lidar_name: str = "",
    max_slew_deg_s: float = MAX_SLEW_DEG_S,
    constraints: Constraints | None = None,
    sunlit: bool = False,
    min_duration_s: float = 0.0,
    sort: Order = "range",
    limit: int | None = None,
) -> Encounters:
    """Find every encounter of `follower` with the other objects of a catalogue, each refined to the millisecond.

    An encounter is one pass within `within_m`. All objects are propagated by SGP4, whose element sets are good to about a
    kilometre. Of several sets of one object, the one nearest in epoch is used at each time. Objects that element sets
    cannot separate from the follower over the whole span count as docked: each has one row, after all others.

    Parameters
    ----------
    catalog : file of element sets, a catalogue, or element sets.
    follower : catalogue number, name, or an element set of its own.
    within_m : greatest distance of an encounter [m].
    start_utc, days : start, with an offset, and length of the searched span.
    lidar : instrument whose reach counts (None: the preset ``long_range_1064``).
    lidar_name : its name in the notes (empty: the name of its preset).
    max_slew_deg_s : greatest rate of the line of sight [deg/s].
    constraints : exclusion angles of a boresight at the object, keep-out sphere and corridors, for every object.
    sunlit : whether to keep only objects that are in sunlight at the closest approach.
    min_duration_s : least duration of an encounter [s].
    sort : order of the rows.
    limit : greatest number of rows (None: all).

    Returns
    -------
    Encounters
        The table, with notes.

    Raises
    ------
    ScenarioError
        For limits and spans without meaning, and for a follower that is not in the catalogue.
    """
    check_span(within_m, start_utc, days, max_slew_deg_s)
    if sort not in _KEYS:
        raise ScenarioError(f"sort: {quote(sort)} is not a sort order; use one of {', '.join(_KEYS)}")
    if limit is not None and (isinstance(limit, bool) or not isinstance(limit, numbers.Integral) or limit < 1):
        raise ScenarioError(f"limit: {quote(limit)} is not a number of rows; give 1 or more, or omit it for all rows")
    _check_number("min_duration", "s", min_duration_s)
    if not min_duration_s >= 0.0:
        raise ScenarioError(f"min_duration: {min_duration_s:g} s is not a duration; give 0 or more")
    if isinstance(follower, bool) or not isinstance(follower, str | numbers.Integral | ElementSet):
        raise ScenarioError(f"follower: {quote(follower)} is not an object; give its catalogue number or its name")
    if lidar is None:
        lidar, lidar_name = Lidar(preset="long_range_1064"), "long_range_1064"  # type: ignore[call-arg]
    sets, problems = _read_sets(catalog)
    own = [follower] if isinstance(follower, ElementSet) else _find_follower(sets, follower, catalog)
    lead = min(own, key=lambda entry: abs((entry.epoch_utc - start_utc).total_seconds()))
    others = _group_by_object([entry for entry in sets if not _is_same(entry, lead)])
    found = screen(own, others, start_utc, days * units.DAY_S, within_m)
    age_days, oldest = found.follower.oldest(0)
    if age_days > STALE_DAYS:
        warnings.warn(
            f"follower {lead.label}: flown up to {age_days:.1f} days from its epoch {oldest.epoch_utc:%Y-%m-%dT%H:%MZ}: "
            f"beyond {STALE_DAYS:g} days expect errors of many kilometres; take a set nearer to the span",
            RsoLidarWarning,
            stacklevel=2,
        )
    reach = reach_m(lidar)
    rows = fold_docked(found, sorted(build_encounters(found, reach, max_slew_deg_s, constraints), key=_KEYS[sort]))
    rows = [row for row in rows if row.inside_s >= min_duration_s and (row.sunlit_fraction >= 0.5 or not sunlit)]
    return Encounters(
        rows=tuple(rows[:limit]),
        follower=lead,
        lidar=lidar,
        lidar_name=lidar_name or lidar.preset or "as given",
        start_utc=start_utc,
        days=days,
        within_m=within_m,
        max_slew_deg_s=max_slew_deg_s,
        reach_m=reach,
        screened=len(others),
        rejected=(*problems, *found.rejected),
        constraints=constraints,
        switching=int(found.objects.several.sum() + found.follower.several.sum()),
    )


def check_span(within_m: float, start_utc: datetime.datetime, days: float, max_slew_deg_s: float) -> None:
    """Raise `ScenarioError` for limits and spans without meaning.

    Parameters
    ----------
    within_m : greatest distance of an encounter [m].
    start_utc, days : start, with an offset, and length of the searched span.
    max_slew_deg_s : greatest rate of the line of sight [deg/s].
    """
    for what, unit, value in (("within", "m", within_m), ("days", "days", days), ("max_slew", "deg/s", max_slew_deg_s)):
        _check_number(what, unit, value)
    if not isinstance(start_utc, datetime.datetime):
        raise ScenarioError(f"start: {quote(start_utc)} is not a time; give a datetime with its time zone")
    if not 0.0 < within_m <= 1e8:
        raise ScenarioError(f"within: {within_m:g} m is not a search distance; give one up to 100,000 km")
    if start_utc.tzinfo is None:
        raise ScenarioError("start: a time without an offset is ambiguous; end it with Z or +00:00")
    if not 0.0 < days <= 60.0:
        raise ScenarioError(f"days: {days:g} is not a time span; give more than 0 and at most 60 days")
    if not 0.0 < max_slew_deg_s < 1e6:
        raise ScenarioError(f"max_slew: {max_slew_deg_s:g} deg/s is not a slew limit; give more than 0")


def _check_number(what: str, unit: str, value: Any) -> None:
    """Refuse a value that is not a number.

    Parameters
    ----------
    what, unit : name and unit, for the message.
    value : to be checked.
    """
    if isinstance(value, bool) or not isinstance(value, numbers.Real):
        raise ScenarioError(f"{what}: {quote(value)} is not a number; give one in {unit}, without the unit")


def _read_sets(catalog: str | Path | Iterable[ElementSet]) -> tuple[list[ElementSet], list[tuple[str, str]]]:
    """Return the element sets of a catalogue, and the problems of those that cannot be used."""
    if isinstance(catalog, str | Path):
        catalog = Catalog.from_file(catalog)
    if isinstance(catalog, bytes) or not isinstance(catalog, Iterable):
        raise CatalogError(f"catalogue: {quote(catalog)} is not a catalogue; give a path, a catalogue or element sets")
    sets = list(catalog)
    for entry in sets:
        if not isinstance(entry, ElementSet):
            raise CatalogError(f"catalogue: {quote(entry)} in it is not an element set; read the sets with Catalog")
    bad = [(entry.label, entry.problem) for entry in sets if entry.problem is not None]
    other = (problem.rpartition(": ") for problem in getattr(catalog, "problems", ()))
    return [entry for entry in sets if entry.problem is None], bad + [(place, what) for place, _, what in other]


def _find_follower(sets: list[ElementSet], wanted: int | str, catalog: Any) -> list[ElementSet]:
    """Find the element sets of the follower, or raise `CatalogError`.

    Parameters
    ----------
    sets : element sets of the catalogue.
    wanted : catalogue number or name.
    catalog : the catalogue, for error messages.
    """
    text = str(wanted).strip()
    where = str(catalog) if isinstance(catalog, str | Path) else "catalogue"

    def matches(entry: ElementSet) -> bool:
        return entry.norad_id == int(text) if text.isdigit() else entry.name.casefold() == text.casefold()

    meant = [entry for entry in sets if matches(entry)]
    if not meant:
        read = read_element_sets(catalog) if isinstance(catalog, str | Path) else []
        for entry in filter(matches, read):
            raise CatalogError(f"follower: {entry.problem}")
        known = {(str(entry.norad_id) if text.isdigit() else entry.name.casefold()): entry for entry in sets}
        guess = did_you_mean(text.casefold(), filter(None, known))
        for key, entry in known.items() if guess else ():
            guess = guess.replace(f"'{key}'?", f"'{entry.norad_id if text.isdigit() else entry.name}'?")
        raise CatalogError(f"{where}: no follower '{text}' among {len(sets):,} element sets{guess or '; check it'}")
    if len({entry.norad_id for entry in meant}) > 1:
        numbers = ", ".join(str(number) for number in sorted({entry.norad_id for entry in meant})[:6])
        raise CatalogError(f"{where}: several objects are named '{text}' ({numbers}); give the catalogue number")
    return meant


def _is_same(entry: ElementSet, lead: ElementSet) -> bool:
    return entry is lead or (entry.identity == lead.identity and any(lead.identity))


def _group_by_object(sets: list[ElementSet]) -> list[list[ElementSet]]:
    """Return the sets of each object; what has neither number nor name is an object of its own."""
    objects: dict[Any, list[ElementSet]] = {}
    for number, entry in enumerate(sets):
        objects.setdefault(entry.identity if any(entry.identity) else number, []).append(entry)
    return list(objects.values())
