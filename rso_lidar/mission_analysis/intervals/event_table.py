"""The table of events, as text, CSV, JSON, calendar and picture."""

from __future__ import annotations

import datetime
import json
import math
from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from rso_lidar import units
from rso_lidar.errors import make_printable
from rso_lidar.files import align_columns, check_writable, format_csv, write_text
from rso_lidar.mission_analysis.intervals.calendar_text import CalendarEntry, write_calendar
from rso_lidar.mission_analysis.intervals.gantt_figure import gantt_figure
from rso_lidar.mission_analysis.passes.plate_light import PlateLight
from rso_lidar.orbit import ElementSet, GroundStation
from rso_lidar.picture import FIGURE_SUFFIXES, LIGHT, Scheme, figures, save_figure
from rso_lidar.records import BodyState
from rso_lidar.scenario import Lidar
from rso_lidar.units import format_count

_PAIR_LETTERS, _EVENT_LETTERS = 28, 14  # of the name of a line of the picture


@dataclass(frozen=True)
class Event:
    """One interval in which an expression holds for a follower and an object.

    `begins` and `ends` are False where the interval begins or ends with the search, or with the states of an object.
    `nearest_utc`, `nearest_m` and `speed_m_s` are instant, range and relative speed of the least range within the interval.
    `farthest_m` is the greatest range within it. `lit_fraction` is the share of its time in which at least half of the Sun's
    disc lights the object from the lidar's side. `phase_deg` (at the object, between Sun and follower) and
    `sun_angle_deg` (at the follower, between object and Sun) are those at the least range.
    """

    event: str
    follower_name: str
    follower_norad_id: int
    name: str
    norad_id: int
    begin_utc: str
    end_utc: str
    duration_s: float
    begins: bool
    ends: bool
    nearest_utc: str
    nearest_m: float
    farthest_m: float
    speed_m_s: float
    lit_fraction: float
    phase_deg: float
    sun_angle_deg: float
    from_s: float = field(metadata={"private": True})
    to_s: float = field(metadata={"private": True})
    nearest_s: float = field(metadata={"private": True})
    entries: tuple[Any, Any] = field(repr=False, compare=False, metadata={"private": True})
    states: tuple[BodyState, BodyState] = field(repr=False, compare=False, metadata={"private": True})

    @property
    def label(self) -> str:
        """Name of the object, or its catalogue number where it has none."""
        return self.name or f"NORAD {self.norad_id}"

    @property
    def follower_label(self) -> str:
        """Name of the object with the lidar, or its catalogue number where it has no name."""
        return self.follower_name or f"NORAD {self.follower_norad_id}"

    @classmethod
    def columns(cls) -> list[str]:
        """Return the names of the columns of a table; those with a unit end in it."""
        return [entry.name for entry in fields(cls) if not entry.metadata.get("private")]


@dataclass(frozen=True, eq=False)
class Events:
    """The events of one follower with other objects, or of any two, in order of time.

    `expressions` are those that were searched, by name. `follower` is its element set nearest to the start, or its
    trajectory; None where all pairs were searched. `labels` name the other objects, or all of them. `rejected` lists
    objects without states in a part of the span, with the reason. `SUFFIXES` are those that `save` writes, and
    `TEXT_HEADS` the heads of columns that align to the left.
    """

    SUFFIXES: ClassVar[tuple[str, ...]] = (".csv", ".json", ".ics", *FIGURE_SUFFIXES)
    TEXT_HEADS: ClassVar[tuple[str, ...]] = ("event", "follower", "object", "begin, UTC", "end, UTC", "nearest, UTC")

    rows: tuple[Event, ...]
    expressions: Mapping[str, str]
    follower: Any
    lidar: Lidar
    lidar_name: str
    start_utc: datetime.datetime
    days: float
    labels: tuple[str, ...]
    rejected: tuple[tuple[str, str], ...]
    light: PlateLight
    stations: tuple[GroundStation, ...] = ()

    def __len__(self) -> int:
        return len(self.rows)

    @property
    def title(self) -> str:
        """One line that describes the search."""
        return f"events of {self._who}, {self._start} + {format_count(self.days, 'day')}"

    @property
    def _who(self) -> str:
        """The objects in a few words, with the names of a single pair."""
        if len(self.labels) == 2 and self.follower is None:
            return " and ".join(self.labels)
        if self.follower is None:
            return f"any two of {format_count(len(self.labels), 'object')}"
        others = self.labels[0] if self._is_pair else format_count(len(self.labels), "object")
        return f"{getattr(self.follower, 'name', '') or self.follower.label} and {others}"

    @property
    def _is_pair(self) -> bool:
        return len(self.labels) == (2 if self.follower is None else 1)

    @property
    def _start(self) -> str:
        return f"{self.start_utc.astimezone(datetime.UTC):%Y-%m-%dT%H:%M:%SZ}"

    def cells(self) -> tuple[list[str], list[list[str]]]:
        """Return the heads and rows of the text table; `save` writes more columns."""
        heads = ["#", "event", "follower", "object", "begin, UTC", "length, s", "nearest, km", "lit, %", "phase, deg"]
        heads += ["end, UTC", "nearest, UTC", "farthest, km", "speed, m/s", "Sun, deg"]
        left_out = {"event"} if len(self.expressions) == 1 else set()
        left_out |= {"follower", "object"} if self._is_pair else set() if self.follower is None else {"follower"}
        rows = [self._list_cells(number, row) for number, row in enumerate(self.rows, start=1)]
        kept = [k for k, head in enumerate(heads) if head not in left_out]
        return [heads[k] for k in kept], [[row[k] for k in kept] for row in rows]

    def _list_cells(self, number: int, row: Event) -> list[str]:
        open_ended = "" if row.begins and row.ends else ">"
        return [
            str(number),
            row.event,
            row.follower_label,
            row.label,
            _shorten(row.begin_utc),
            f"{open_ended}{row.duration_s:,.1f}",
            f"{row.nearest_m / units.KM:,.3f}",
            f"{100.0 * row.lit_fraction:.0f}",
            _format_degrees(row.phase_deg),
            _shorten(row.end_utc),
            _shorten(row.nearest_utc),
            f"{row.farthest_m / units.KM:,.3f}",
            f"{row.speed_m_s:,.1f}",
            _format_degrees(row.sun_angle_deg),
        ]

    def notes(self) -> list[str]:
        """Return the notes below the table."""
        lines = [f"{name}: {text}" if name != text else f"when {text}" for name, text in self.expressions.items()]
        total = sum(row.duration_s for row in self.rows)
        lines.append(
            f"{format_count(len(self.rows), 'event')}, {total:,.1f} s in all; >: it begins before, or lasts on"
        )
        lines.append("lit: share of the event in which sunlight is on the lidar's side; phase: at the least range")
        words = " ".join(self.expressions.values())
        if "found" in words or "pixels" in words:
            lines.append(f"lidar {self.lidar_name}: {self.light.plate.describe(with_rate=False)}")
            if "found" in words:
                how = self.light.finding.describe()
                lines.append(f"found: probability that one flash finds it, by {how}; the mean over the camera's pixels")
        lines += [
            f"station {station.name}: {station.latitude_deg:g}, {station.longitude_deg:g} deg, {station.height_m:g} m, "
            f"contact from {station.least_elevation_deg:g} deg of elevation, without refraction"
            for station in self.stations
        ]
        if any(isinstance(entry, ElementSet) for row in self.rows for entry in row.entries):
            lines.append("element sets are good to about a kilometre, and worse with age")
        if self.rejected:
            first = "; ".join(f"{label}: {why}" for label, why in self.rejected[:3])
            more = f"; and {len(self.rejected) - 3} more" if len(self.rejected) > 3 else ""
            lines.append(f"not flown, or not to the end: {first}{more}")
        return lines

    def table(self) -> str:
        """Return the table as plain text with all columns, its title and notes."""
        if not self.rows:
            return "\n".join([self.title, "no event found", *self.notes()])
        heads, body = self.cells()
        lines = align_columns([heads, *body], [k for k, head in enumerate(heads) if head in self.TEXT_HEADS])
        return "\n".join([self.title, *lines, *self.notes()])

    def figure(self) -> Any:
        """Return the figure: a bar over time for each event, a line for each expression and pair."""
        lines: list[tuple[str, list[tuple[float, float]], int]] = []
        names = list(self.expressions)
        pairs: dict[tuple[Any, ...], list[Event]] = {}  # several pieces of debris have one name
        for row in self.rows:
            whose = row.follower_label, row.follower_norad_id, row.label, row.norad_id
            pairs.setdefault(whose, []).append(row)
        for rows in pairs.values():
            first = rows[0]
            whom = first.label if self.follower is not None else f"{first.follower_label}, {first.label}"
            for number, name in enumerate(names):
                spans = [(row.from_s, row.to_s) for row in rows if row.event == name]
                several = f"{figures.shorten(whom, _PAIR_LETTERS)}: {figures.shorten(name, _EVENT_LETTERS)}"
                lines.append((name if self._is_pair else whom if len(names) == 1 else several, spans, number))
        start = np.datetime64(self.start_utc.astimezone(datetime.UTC).replace(tzinfo=None), "ms")
        what = "; ".join(f"{name}: {text}" if name != text else text for name, text in self.expressions.items())
        return gantt_figure(lines, start, self.days * units.DAY_S, f"Events of {self._who}", what)

    def save(self, path: str | Path, *, overwrite: bool = False, scheme: Scheme = LIGHT) -> Path:
        """Write the events as CSV, JSON, iCalendar or a picture, by the suffix.

        Parameters
        ----------
        path : of the file, with one of `SUFFIXES`
        overwrite : whether an existing file may be replaced
        scheme : of a picture, `LIGHT` or `DARK`

        Returns
        -------
        Path

        Raises
        ------
        RecordingError
            For another suffix, or if the file exists or cannot be written there.
        """
        place = check_writable(path, self.SUFFIXES, overwrite=overwrite)
        suffix = place.suffix.lower()
        if suffix in FIGURE_SUFFIXES:
            return save_figure(self.figure(), place, scheme=scheme)
        write = {".csv": self._write_csv, ".json": self._write_json, ".ics": self._write_calendar}[suffix]
        return write_text(place, write(), overwrite=overwrite)

    def _write_csv(self) -> str:
        names = Event.columns()
        return format_csv([names, *([_format_cell(name, getattr(row, name)) for name in names] for row in self.rows)])

    def _write_json(self) -> str:
        rows = [{name: _clean(getattr(row, name)) for name in Event.columns()} for row in self.rows]
        tree = {
            "title": self.title,
            "start_utc": self._start,
            "days": self.days,
            "expressions": dict(self.expressions),
            "lidar": self.lidar_name,
            "stations": [
                {
                    "name": station.name,
                    "latitude_deg": station.latitude_deg,
                    "longitude_deg": station.longitude_deg,
                    "height_m": station.height_m,
                    "least_elevation_deg": station.least_elevation_deg,
                }
                for station in self.stations
            ],
            "events": rows,
            "rejected": [list(entry) for entry in self.rejected],
        }
        return json.dumps(tree, indent=1, ensure_ascii=False) + "\n"

    def _write_calendar(self) -> str:
        start = self.start_utc.astimezone(datetime.UTC)
        return write_calendar(
            [
                CalendarEntry(
                    start + datetime.timedelta(seconds=row.from_s),
                    start + datetime.timedelta(seconds=row.to_s),
                    make_printable(f"{row.event}: {row.follower_label}, {row.label}"),
                    f"{row.begin_utc} to {row.end_utc}, {row.duration_s:.1f} s. Least range {row.nearest_m / units.KM:.3f} "
                    f"km at {row.nearest_utc}, {row.speed_m_s:.1f} m/s. Lit {100.0 * row.lit_fraction:.0f} % of the time."
                    f"\n{self.expressions[row.event]}",
                )
                for row in self.rows
            ],
            stamp=start,
        )


def _shorten(utc: str) -> str:
    """Shorten an instant to a tenth of a second, without its Z, for a column that is in UTC."""
    return utc[:21]


def _format_degrees(angle: float) -> str:
    return "-" if math.isnan(angle) else str(round(angle))


def _format_cell(name: str, value: Any) -> Any:
    if name.endswith("norad_id") and not value:
        return ""  # a trajectory has no catalogue number
    if isinstance(value, bool):
        return str(value).lower()
    return f"{value:.9g}" if isinstance(value, float) else value


def _clean(value: Any) -> Any:
    """Return a value for JSON, which has no NaN."""
    return None if isinstance(value, float) and not math.isfinite(value) else value
