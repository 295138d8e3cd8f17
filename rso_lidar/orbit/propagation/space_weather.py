"""Solar flux and geomagnetic activity day by day, from a file of CelesTrak that the user gives; nothing is downloaded."""

from __future__ import annotations

import csv
import datetime
import functools
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np

from rso_lidar import files
from rso_lidar.errors import ScenarioError
from rso_lidar.shipped import find

INTERVALS = 8  # of a day, each with its ap
_CURE = "give SW-All.csv or SW-All.txt of CelesTrak"
_CSV_COLUMNS = ("DATE", "F10.7_OBS", "F10.7_OBS_CENTER81", "AP_AVG", *(f"AP{k}" for k in range(1, INTERVALS + 1)))
# Columns of the fixed format "CssiSpaceWeather 1.2", in the same order; the date takes three of them.
_TEXT_COLUMNS = ((112, 118), (118, 124), (78, 82), *((46 + 4 * k, 50 + 4 * k) for k in range(INTERVALS)))
_HISTORY = 19  # intervals before the current one whose ap counts


class Activity(NamedTuple):
    """Activity of the Sun and of the Earth's magnetic field at an instant, as NRLMSIS takes it.

    Parameters
    ----------
    f107, f107a : flux at 10.7 cm of the day before, and its mean of 81 days about the day [1e-22 W m-2 Hz-1]
    ap : of the day; of the current three hours and of those 3, 6 and 9 hours before; means of 12 to 33 and 36 to 57 hours
        before
    """

    f107: float
    f107a: float
    ap: tuple[float, float, float, float, float, float, float]


@dataclass(frozen=True, eq=False)
class SpaceWeather:
    """Space weather day by day: observed values, and the daily predictions that follow them.

    Parameters
    ----------
    where : name of the source, for messages
    first_day : first day (proleptic ordinal of UTC)
    flux : (day, 2) observed flux at 10.7 cm, and its mean of 81 days about the day [1e-22 W m-2 Hz-1]
    daily_ap : (day,)
    ap : (8 day,) of each three hours
    """

    where: str
    first_day: int
    flux: np.ndarray
    daily_ap: np.ndarray
    ap: np.ndarray

    @classmethod
    def from_file(cls, path: str | Path) -> SpaceWeather:
        """Read a file of CelesTrak, as CSV or in the older fixed columns.

        Parameters
        ----------
        path : path of the file, which the user has fetched

        Raises
        ------
        ScenarioError
            if the file cannot be read, or is of another format
        """
        place = find(path)
        if place is None:
            raise ScenarioError(f"nrlmsis: {path}: no such file; {_CURE}")
        status = place.stat()
        return _read(place, status.st_mtime_ns, status.st_size)

    def find_activity(self, day: int, interval: int) -> Activity:
        """Return the activity in an interval of three hours of a day.

        Parameters
        ----------
        day : ordinal of the day (UTC)
        interval : 0 to 7

        Raises
        ------
        ScenarioError
            if the file does not have that day and the three before
        """
        row = day - self.first_day
        now = row * INTERVALS + interval
        if now < _HISTORY or row >= len(self.flux):
            date = datetime.date.fromordinal(day)
            first, last = (datetime.date.fromordinal(self.first_day + k) for k in (3, len(self.flux) - 1))
            raise ScenarioError(
                f"nrlmsis: {self.where}: has no space weather for {date}, only from {first} to {last}; give a newer file, "
                "or the constants f107, f107a and ap"
            )
        recent = self.ap[now - 3 : now + 1][::-1].tolist()
        means = (float(self.ap[now - last : now - first].mean()) for first, last in ((3, 11), (11, 19)))
        return Activity(
            float(self.flux[row - 1, 0]), float(self.flux[row, 1]), (float(self.daily_ap[row]), *recent, *means)
        )


@functools.lru_cache(maxsize=4)
def _read(path: Path, _modified_ns: int, _size: int) -> SpaceWeather:
    """Read a file, cached until it changes."""
    text = files.read_text(path, files.MOST_BYTES, ScenarioError, "file of space weather")
    where = f"nrlmsis: {path}"
    rows = _read_csv(text, where) if "DATE," in text[:200] else _read_columns(text, where)
    if len(rows) < 4:
        raise ScenarioError(f"{where}: has {len(rows)} days of space weather; {_CURE}")
    days = np.array([day for day, _ in rows])
    if not np.all(np.diff(days) == 1):
        date = datetime.date.fromordinal(int(days[1:][np.diff(days) != 1][0]))
        raise ScenarioError(f"{where}: {date} does not follow the day before it; give an unchanged file of CelesTrak")
    values = np.array([values for _, values in rows])
    return SpaceWeather(str(path), int(days[0]), values[:, :2], values[:, 2], values[:, 3:].ravel())


def _read_csv(text: str, where: str) -> list[tuple[int, list[float]]]:
    """Read the days of a CSV file up to the first without ap, as the monthly predictions are."""
    lines = csv.DictReader(text.splitlines())
    missing = [name for name in _CSV_COLUMNS if name not in (lines.fieldnames or ())]
    if missing:
        raise ScenarioError(f"{where}: has no column {missing[0]}; {_CURE}")
    rows = []
    for line in lines:
        date, *cells = (line[name] or "" for name in _CSV_COLUMNS)
        if not any(cell.strip() for cell in cells[2:]):
            break
        rows.append(_parse_day(date.split("-"), cells, f"{where}: line {lines.line_num}"))
    return rows


def _read_columns(text: str, where: str) -> list[tuple[int, list[float]]]:
    """Read the days of a file in fixed columns, in its sections OBSERVED and DAILY_PREDICTED."""
    if "BEGIN OBSERVED" not in text:
        raise ScenarioError(f"{where}: has neither a column DATE nor a line BEGIN OBSERVED; {_CURE}")
    rows, is_daily = [], False
    for number, line in enumerate(text.splitlines(), start=1):
        word, _, section = line.strip().partition(" ")
        if word in ("BEGIN", "END"):
            is_daily = word == "BEGIN" and section in ("OBSERVED", "DAILY_PREDICTED")
        elif is_daily and line.strip():
            date = [line[0:4], line[4:7], line[7:10]]
            cells = [line[first:last] for first, last in _TEXT_COLUMNS]
            rows.append(_parse_day(date, cells, f"{where}: line {number}"))
    return rows


def _parse_day(date: list[str], cells: list[str], where: str) -> tuple[int, list[float]]:
    """Parse the ordinal of a day, both fluxes, and the ap of the day and of its intervals."""
    try:
        year, month, day = (int(word) for word in date)
        ordinal, values = datetime.date(year, month, day).toordinal(), [float(cell) for cell in cells]
    except ValueError:
        raise ScenarioError(f"{where}: lacks a date, a flux or an ap; give an unchanged file of CelesTrak") from None
    if not (all(20.0 < flux < 1000.0 for flux in values[:2]) and all(0.0 <= ap <= 400.0 for ap in values[2:])):
        raise ScenarioError(f"{where}: its numbers are no space weather; give an unchanged file of CelesTrak")
    return ordinal, values
