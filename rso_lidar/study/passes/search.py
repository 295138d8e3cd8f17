"""The search for encounters: every close approach of one object of a catalogue to all others, as a table."""

from __future__ import annotations

import csv
import datetime
import io
import math
import numbers
import warnings
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from rso_lidar import units
from rso_lidar.errors import CatalogError, RsoLidarWarning, ScenarioError, did_you_mean
from rso_lidar.files import write_text
from rso_lidar.orbit.screening.conjunctions import screen
from rso_lidar.orbit.sets.catalog import Catalog
from rso_lidar.orbit.sets.element_set import ElementSet, quote
from rso_lidar.orbit.sets.formats import read_element_sets
from rso_lidar.orbit.sets.teme import STALE_DAYS
from rso_lidar.scenario import Constraints, Lidar
from rso_lidar.study.passes.docked import fold_docked
from rso_lidar.study.passes.pass_geometry import (
    SMALL_M2,
    Encounter,
    build_encounters,
    keep_out_radius_m,
    reach_m,
    select_rtn_corridors,
)

Order = Literal["range", "time", "speed"]
MAX_SLEW_DEG_S = 2.0
_KEYS = {
    "range": lambda row: (row.range_m, row.time_s),
    "time": lambda row: (row.time_s, row.range_m),
    "speed": lambda row: (row.speed_m_s, row.time_s),
}
NOTE = (
    "Element sets are good to about a kilometre, and worse with age: these are plausible encounters, not predictions."
)


@dataclass(frozen=True, eq=False)
class Encounters:
    """The encounters of one follower, sorted.

    `follower` is its element set nearest to the start. `rejected` lists objects that were not propagated to the end, with
    the reason. `switching` counts objects that change to another element set within the span.
    """

    rows: tuple[Encounter, ...]
    follower: ElementSet
    lidar: Lidar
    lidar_name: str
    start_utc: datetime.datetime
    days: float
    within_m: float
    max_slew_deg_s: float
    reach_m: tuple[float, float]
    screened: int
    rejected: tuple[tuple[str, str], ...]
    constraints: Constraints | None = None
    switching: int = 0

    def __len__(self) -> int:
        return len(self.rows)

    @property
    def title(self) -> str:
        """One line that describes the search."""
        return (
            f"{self.follower.label} within {self.within_m / units.KM:g} km of {format_count(self.screened, 'object')}, "
            f"{self.start_utc.astimezone(datetime.UTC):%Y-%m-%dT%H:%M:%SZ} + {self.span}"
        )

    @property
    def span(self) -> str:
        """Length of the searched span in words."""
        return format_count(self.days, "day")

    def cells(self) -> tuple[list[str], list[list[str]]]:
        """Return the heads and rows of the text table; `csv` has more columns."""
        heads = ["#", "object", "norad", "closest approach, UTC", "range, km", "speed, m/s", "inside, s"]
        heads += ["lidar, s", "slew, deg/s", *(["clear, s"] if self._excludes else []), "usable, s"]
        heads += ["phase, deg", "Moon, deg", "limb, deg", "light", "age, d"]
        heads += ["breaks"] if self.constraints is not None else []
        return heads, [self._shown(number, row) for number, row in enumerate(self.rows, start=1)]

    def _shown(self, number: int, row: Encounter) -> list[str]:
        light = "Sun" if row.sunlit_fraction >= 0.99 else "dark" if row.sunlit_fraction <= 0.01 else "part"
        minima = f" ({row.minima} minima)" if row.minima > 1 else ""
        minima = " (docked or one object)" if row.docked else minima
        return [
            str(number),
            row.label + minima,
            str(row.norad_id),
            row.closest_utc,
            f"{row.range_m / units.KM:,.3f}",
            f"{row.speed_m_s:,.1f}",
            ("" if row.entered and row.left else ">") + f"{row.inside_s:,.1f}",
            _format_seconds(row.lidar_s),
            f"{row.slew_deg_s:,.3f}",
            *([_format_seconds(row.clear_s)] if self._excludes else []),
            _format_seconds(row.usable_s),
            _format_degrees(row.phase_deg),
            _format_degrees(row.moon_angle_deg),
            _format_degrees(row.earth_limb_deg),
            light,
            f"{row.age_days:.1f}",
            *([", ".join(row.breaks) or "-"] if self.constraints is not None else []),
        ]

    @property
    def _excludes(self) -> list[str]:
        """Descriptions of the exclusion angles."""
        asked = self.constraints
        if asked is None:
            return []
        angles = (
            ("Sun {:g} deg while any of it is seen", asked.sun_exclusion_deg),
            ("Moon {:g} deg", asked.moon_exclusion_deg),
            ("Earth's limb {:g} deg", asked.earth_exclusion_deg),
        )
        return [text.format(angle) for text, angle in angles if angle is not None]

    def notes(self) -> list[str]:
        """Return the notes below the table."""
        limits = f"usable: in reach, and the line of sight turns at most {self.max_slew_deg_s:g} deg/s"
        small_m = reach_m(self.lidar, SMALL_M2)[1]
        lines = [
            f"lidar {self.lidar_name}: reaches {self.reach_m[0]:,.0f} to {self.reach_m[1]:,.0f} m (a facing plate of 1 m2, "
            f"reflectance 0.30); {limits}{', and clear' if self._excludes else ''}",
            f"in reach and usable are those of 1 m2, whatever the object is: a plate of {SMALL_M2:g} m2, as a side of a "
            f"CubeSat, is seen to {small_m:,.0f} m only",
            *self._describe_constraints(),
            NOTE,
        ]
        lines += self._explain_docked()
        if self.switching:
            several = format_count(self.switching, "object")
            lines.append(
                f"{several} with more than one element set in this span, the follower counted: at each instant the set "
                "nearest in epoch flies, and where sets switch the range jumps"
            )
        if self.rejected:
            first = "; ".join(f"{label}: {why}" for label, why in self.rejected[:3])
            more = f"; and {len(self.rejected) - 3} more" if len(self.rejected) > 3 else ""
            lines.append(f"{len(self.rejected)} not flown, or not to the end: {first}{more}")
        return lines

    def _explain_docked(self) -> list[str]:
        """Explain why objects count as docked with the follower, in one line for each reason."""
        reasons: dict[str, list[str]] = {}
        for row in self.rows:
            if row.docked:
                reasons.setdefault(row.docked, []).append(row.label)
        return [
            f"docked or one object: {', '.join(labels)}: {reason}; no encounter, and no scenario is written"
            for reason, labels in reasons.items()
        ]

    def _describe_constraints(self) -> list[str]:
        """Describe how the constraints were applied."""
        asked = self.constraints
        if asked is None:
            return []
        lines = []
        if self._excludes:
            lines.append(f"clear: a boresight at the object keeps off {', '.join(self._excludes)}")
        radius_m, known = keep_out_radius_m(asked), select_rtn_corridors(asked)
        if radius_m is not None:
            named = f", the largest of {', '.join(asked.keep_out_m)}" if isinstance(asked.keep_out_m, dict) else ""
            outside = ", but in a corridor" if known else ""
            lines.append(f"keep-out: {radius_m:g} m about each object{named}{outside}, at the closest approach")
        for k, corridor in enumerate(asked.corridor):
            if corridor in known:
                far = f" to {corridor.to_m:g} m" if corridor.to_m else ""
                axis = ", ".join(f"{part:g}" for part in corridor.axis)
                lines.append(
                    f"corridor[{k}]: {corridor.half_angle_deg:g} deg about [{axis}] in the rtn axes of each object, from "
                    f"{corridor.from_m:g} m{far}, at the closest approach"
                )
            else:
                lines.append(
                    f"corridor[{k}]: not applicable: it turns with {corridor.axes or corridor.target}, and element sets "
                    'tell no attitude; give it in axes "rtn"'
                )
        return lines

    def table(self) -> str:
        """Return the table as plain text, with its title and notes."""
        if not self.rows:
            return "\n".join([self.title, "no encounter found", *self.notes()])
        heads, body = self.cells()
        widths = [max(map(len, column)) for column in zip(heads, *body, strict=True)]
        left = {1, 3, *([len(heads) - 1] if heads[-1] == "breaks" else [])}
        lines = [
            "  ".join(
                cell.ljust(width) if k in left else cell.rjust(width)
                for k, (cell, width) in enumerate(zip(row, widths, strict=True))
            ).rstrip()
            for row in (heads, *body)
        ]
        return "\n".join([self.title, *lines, *self.notes()])

    def csv(self, path: str | Path, *, overwrite: bool = False) -> Path:
        """Write all rows and columns as CSV, whose names end in their unit, and return the path."""
        text = io.StringIO()
        writer = csv.writer(text, lineterminator="\n")
        names = Encounter.columns()
        writer.writerow(names)
        writer.writerows([_format_cell(getattr(row, name)) for name in names] for row in self.rows)
        return write_text(path, text.getvalue(), overwrite=overwrite)


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
        raise ScenarioError(f"sort: {quote(sort)} is no order; use one of {', '.join(_KEYS)}")
    if limit is not None and (isinstance(limit, bool) or not isinstance(limit, numbers.Integral) or limit < 1):
        raise ScenarioError(f"limit: {quote(limit)} is no number of rows; give 1 or more, or leave it out for all")
    _check_number("min_duration", "s", min_duration_s)
    if not min_duration_s >= 0.0:
        raise ScenarioError(f"min_duration: {min_duration_s:g} s is no duration; give 0 or more")
    if isinstance(follower, bool) or not isinstance(follower, str | numbers.Integral | ElementSet):
        raise ScenarioError(f"follower: {quote(follower)} is no object; give its catalogue number or its name")
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
        raise ScenarioError(f"start: {quote(start_utc)} is no time; give a datetime with its time zone")
    if not 0.0 < within_m <= 1e8:
        raise ScenarioError(f"within: {within_m:g} m is no distance to look within; give one up to 100,000 km")
    if start_utc.tzinfo is None:
        raise ScenarioError("start: a time without an offset is ambiguous; end it with Z or +00:00")
    if not 0.0 < days <= 60.0:
        raise ScenarioError(f"days: {days:g} is no span; give more than 0 and at most 60 days")
    if not 0.0 < max_slew_deg_s < 1e6:
        raise ScenarioError(f"max_slew: {max_slew_deg_s:g} deg/s is no limit; give more than 0")


def _check_number(what: str, unit: str, value: Any) -> None:
    if isinstance(value, bool) or not isinstance(value, numbers.Real):
        raise ScenarioError(f"{what}: {quote(value)} is no number; give one in {unit}, without the unit")


def format_count(number: float, noun: str) -> str:
    """Format a number with its noun, in the plural where it is not one."""
    return f"{number:,.10g} {noun}{'' if number == 1 else 's'}"


def _read_sets(catalog: str | Path | Iterable[ElementSet]) -> tuple[list[ElementSet], list[tuple[str, str]]]:
    """Return the element sets of a catalogue, and the problems of those that cannot be used."""
    if isinstance(catalog, str | Path):
        catalog = Catalog.from_file(catalog)
    if isinstance(catalog, bytes) or not isinstance(catalog, Iterable):
        raise CatalogError(f"catalogue: {quote(catalog)} is none: give a file's path, a catalogue or element sets")
    sets = list(catalog)
    for entry in sets:
        if not isinstance(entry, ElementSet):
            raise CatalogError(f"catalogue: {quote(entry)} in it is no element set: read them with Catalog")
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


def _format_seconds(time_s: float) -> str:
    return "-" if math.isnan(time_s) else f"{time_s:,.1f}"


def _format_degrees(angle: float) -> str:
    return "-" if math.isnan(angle) else str(round(angle))


def _format_cell(value: Any) -> Any:
    if isinstance(value, bool):
        return str(value).lower()
    return f"{value:.9g}" if isinstance(value, float) else value
