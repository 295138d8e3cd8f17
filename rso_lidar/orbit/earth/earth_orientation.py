"""Polar motion and UT1, from a file of the IERS that the user gives; nothing is downloaded."""

from __future__ import annotations

import functools
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from rso_lidar import files, units
from rso_lidar.errors import PropagationError, ScenarioError
from rso_lidar.orbit.epochs import Epochs, format_utc, tai_from_utc_days
from rso_lidar.shipped import find

# Polar motion stays within 0.6 arcsecond of the pole of ITRF (IERS Conventions 2010, fig. 7.1). The predicted part of the
# built-in UT1 is good to 20 ms, which is 0.3 arcsecond.
UNCERTAINTY_WITHOUT_RAD = 0.9 * units.ARCSEC
_COLUMNS = {"MJD": (7, 15), "PM-x": (18, 27), "PM-y": (37, 46), "UT1-UTC": (58, 68)}
_MOST_ARCSEC, _MOST_S = 2.0, 1.0
_MOST_GAP_DAYS = 10.0
_LEAST_LENGTH = _COLUMNS["UT1-UTC"][1]


@dataclass(frozen=True, eq=False)
class EarthOrientation:
    """Orientation of the Earth day by day: polar motion and UT1, interpolated linearly in between.

    Left out are the daily tides in both, up to 0.5 milliarcsecond, and the offsets of the celestial pole, up to 0.3: some
    centimetres on the ground.

    Parameters
    ----------
    where : name of the source, for messages
    tai_s : (row,) instants, TAI seconds since JD 0
    pole_rad : (row, 2) position of the pole in ITRF, x toward Greenwich and y toward 90 degrees west [rad]
    ut1_minus_tai_s : (row,) [s]
    """

    where: str
    tai_s: np.ndarray
    pole_rad: np.ndarray
    ut1_minus_tai_s: np.ndarray

    @classmethod
    def from_file(cls, path: str | Path) -> EarthOrientation:
        """Read a file of the IERS in the format of `finals2000A.all`, `finals2000A.daily` or `finals.data`.

        The rapid values and predictions of Bulletin A are used.

        Parameters
        ----------
        path : path of the file, which the user has fetched from the IERS

        Returns
        -------
        EarthOrientation

        Raises
        ------
        ScenarioError
            if the file cannot be read, or is of another format
        """
        place = find(path)
        if place is None:
            raise ScenarioError(f"{path}: no such file; give the path of finals2000A.all, which the IERS publishes")
        status = place.stat()
        return _read(place, status.st_mtime_ns, status.st_size)

    def ut1_minus_tai_at(self, epochs: Epochs) -> np.ndarray:
        """Return UT1 - TAI (time,) [s].

        Parameters
        ----------
        epochs : instants

        Raises
        ------
        PropagationError
            if epochs are outside the file; its `bad` masks them
        """
        difference_s: np.ndarray = np.interp(self._check_covers(epochs), self.tai_s, self.ut1_minus_tai_s)
        return difference_s

    def pole_at(self, epochs: Epochs) -> np.ndarray:
        """Return the position of the pole (time, 2) [rad]: x toward Greenwich, y toward 90 degrees west.

        Parameters
        ----------
        epochs : instants

        Raises
        ------
        PropagationError
            if epochs are outside the file; its `bad` masks them
        """
        tai_s = self._check_covers(epochs)
        return np.stack([np.interp(tai_s, self.tai_s, column) for column in self.pole_rad.T], axis=-1)

    def _check_covers(self, epochs: Epochs) -> np.ndarray:
        tai_s = epochs.tai_seconds()
        bad = (tai_s < self.tai_s[0]) | (tai_s > self.tai_s[-1])
        if bad.any():
            at = format_utc(epochs.start_utc, epochs.time_s[np.argmax(bad)])
            raise PropagationError(
                f"{self.where}: has no Earth orientation for {int(bad.sum())} of {len(bad)} epochs, the first is {at}; "
                "give a newer file",
                bad,
            )
        return tai_s


@functools.lru_cache(maxsize=4)
def _read(path: Path, _modified_ns: int, _size: int) -> EarthOrientation:
    """Read a file, cached until it changes."""
    text = files.read_text(path, files.MOST_BYTES, ScenarioError, "file of Earth orientation")
    rows: list[list[float]] = []
    for number, line in enumerate(text.splitlines(), start=1):
        if len(line) >= _LEAST_LENGTH and not line[slice(*_COLUMNS["UT1-UTC"])].strip():
            break  # dates without values follow the predictions
        if line.strip():
            rows.append(_parse_row(line, f"{path}: line {number}"))
    if len(rows) < 2:
        raise ScenarioError(f"{path}: has {len(rows)} days of Earth orientation; give finals2000A.all of the IERS")
    day, x, y, ut1_minus_utc_s = np.array(rows).T
    steps = np.diff(day)
    if not np.all((steps > 0.0) & (steps <= _MOST_GAP_DAYS)):
        at = rows[int(np.argmax((steps <= 0.0) | (steps > _MOST_GAP_DAYS))) + 1][0]
        raise ScenarioError(f"{path}: MJD {at:g} does not follow the day before it; give an unchanged file of the IERS")
    tai_s, leap_s = tai_from_utc_days(day)
    return EarthOrientation(str(path), tai_s, np.stack([x, y], axis=-1) * units.ARCSEC, ut1_minus_utc_s - leap_s)


def _parse_row(line: str, where: str) -> list[float]:
    """Parse day, both coordinates of the pole ["] and UT1 - UTC [s] of a line."""
    values = []
    for name, (first, last) in _COLUMNS.items():
        cell = line[first:last].strip()
        try:
            values.append(float(cell))
        except ValueError:
            raise ScenarioError(
                f"{where}: {name} '{cell:.20}' is not a number; give a file in the columns of finals2000A.all (IERS)"
            ) from None
    day, x, y, late_s = values
    if not (30_000.0 < day < 120_000.0 and max(abs(x), abs(y)) < _MOST_ARCSEC and abs(late_s) < _MOST_S):
        raise ScenarioError(f"{where}: its numbers are no Earth orientation; give finals2000A.all of the IERS")
    return values
