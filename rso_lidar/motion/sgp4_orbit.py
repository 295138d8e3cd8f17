"""Motion by a two-line element set and SGP4, and the only place that has heard of TEME.

SGP4 is the sgp4 library's (Vallado et al., AIAA 2006-6753, WGS72). TEME to GCRS is skyfield's rotation (IAU 2000A
nutation, IAU 2006 precession, the frame bias), taken at whole hours TT and interpolated by a cubic through the four
hours around an epoch: within skyfield's own rounding (1e-13 rad, 5 um at GEO) and far faster. The hours are absolute,
so a state is the same bits whatever other epochs are asked for with it. Velocity is rotated only, as in skyfield: the
axes turn by 1e-11 rad/s.
"""

from __future__ import annotations

import datetime
import functools
import warnings
from pathlib import Path
from typing import Literal, Self

import numpy as np
from pydantic import model_validator

from rso_lidar import units
from rso_lidar.errors import CatalogError, PropagationError, RsoLidarWarning
from rso_lidar.motion import catalog
from rso_lidar.motion.epochs import J2000_TT_JD, Epochs, skyfield_tt
from rso_lidar.part import Count, Part, Text
from rso_lidar.pose import turned
from rso_lidar.records import BodyState
from rso_lidar.shipped import find, shipped

_LOWEST_M, _HIGHEST_M = units.EARTH_RADIUS_M - 50e3, 1e9  # SGP4 may go on below the ground, and beyond the Moon
STALE_DAYS = 7.0


class Tle(Part):
    """Motion by a two-line element set: from a `file`, of `name` or `norad_id`, or from two inline `lines`.

    Of several sets of one object, the nearest to the start of the run is flown. Accuracy is that of element sets: about
    a kilometre, growing by one to three a day.
    """

    type: Literal["tle"] = "tle"
    file: Text | None = None
    lines: tuple[Text, Text] | None = None
    name: Text | None = None
    norad_id: Count | None = None

    @model_validator(mode="after")
    def _one_source(self) -> Self:
        if (self.file is None) == (self.lines is None):
            raise ValueError("needs exactly one of file and lines: give the path of a TLE file, or the two lines")
        if self.lines is not None:
            chosen = catalog.choose(catalog.parse_lines(self.lines, "lines"), "lines")
            if self.norad_id not in (None, chosen.norad_id):
                raise ValueError(f"lines: are of NORAD {chosen.norad_id}, not {self.norad_id}: correct norad_id")
        return self

    def elements(self, near_utc: datetime.datetime | None = None, folder: Path | None = None) -> catalog.ElementSet:
        """Return the element set to fly, checked: of several epochs the nearest to `near_utc`, else the newest.

        A relative `file` is looked up beside `folder` (the working folder if None), then among the shipped data.
        """
        if self.lines is not None:
            chosen = catalog.choose(catalog.parse_lines(self.lines, "lines"), "lines")
            return catalog.ElementSet(self.name or "", chosen.norad_id, chosen.line1, chosen.line2, "lines")
        assert self.file is not None
        path = find(self.file, folder)
        if path is None:
            places = f"in {folder or Path.cwd()} and among the shipped data in {shipped()}"
            looked = "" if Path(self.file).expanduser().is_absolute() else f", looked for {places}"
            raise CatalogError(f"{self.file}: no such file{looked}: check the path")
        return catalog.choose(catalog.read_element_sets(path), self.file, self.name, self.norad_id, near_utc)

    def inline(self, near_utc: datetime.datetime, folder: Path | None = None) -> Tle:
        """Return the same motion with its element set in `lines`, and no file."""
        if self.lines is not None:
            return self
        chosen = self.elements(near_utc, folder)
        return Tle(lines=(chosen.line1, chosen.line2), name=chosen.name or None, norad_id=chosen.norad_id or None)

    def epoch_age_days(self, epochs: Epochs) -> float:
        """Return the largest time between the elements' epoch and the epochs asked for [day]."""
        return _age_days(self.elements(epochs.start_utc), epochs)

    def states(self, epochs: Epochs) -> BodyState:
        """Return position [m] and velocity [m/s] (time, 3) in GCRS axes; SGP4's failures raise `PropagationError`."""
        elements = self.elements(epochs.start_utc)
        age_days = _age_days(elements, epochs)
        if age_days > STALE_DAYS:
            warnings.warn(
                f"tle {elements.label}: flown {age_days:.1f} days from its epoch {elements.epoch_utc:%Y-%m-%dT%H:%MZ}: "
                f"beyond {STALE_DAYS:g} days expect errors of many kilometres; take a set nearer to the run",
                RsoLidarWarning,
                stacklevel=2,
            )
        position_m, velocity_m_s, error = _teme(elements, epochs)
        bad = (error != 0) | ~np.isfinite(position_m).all(axis=1) | ~np.isfinite(velocity_m_s).all(axis=1)
        radius_m = np.linalg.norm(position_m, axis=1)
        bad |= ~((radius_m > _LOWEST_M) & (radius_m < _HIGHEST_M))  # decayed, or drag thrown off by years of flight
        if bad.any():
            raise PropagationError(_failure(elements, epochs, bad, error), bad)
        rotation = gcrs_from_teme(epochs)
        return BodyState(turned(rotation, position_m), turned(rotation, velocity_m_s))


def _age_days(elements: catalog.ElementSet, epochs: Epochs) -> float:
    return float(np.abs(epochs.since(elements.epoch_utc)).max(initial=0.0)) / units.DAY_S


def _failure(elements: catalog.ElementSet, epochs: Epochs, bad: np.ndarray, error: np.ndarray) -> str:
    from sgp4.api import SGP4_ERRORS

    first = int(np.argmax(bad))
    reason = SGP4_ERRORS.get(int(error[first]), "it has decayed or gone astray")
    return (
        f"tle {elements.label}: SGP4 has no state at {int(bad.sum())} of {len(bad)} epochs, first at "
        f"time_s = {epochs.time_s[first]:g}: {reason}: fly nearer to the elements' epoch "
        f"{elements.epoch_utc:%Y-%m-%dT%H:%MZ}, or take another set"
    )


def _teme(elements: catalog.ElementSet, epochs: Epochs) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return SGP4's position [m] and velocity [m/s] (time, 3) in TEME axes, and its error codes (time), 0 = none."""
    from sgp4.api import Satrec

    # A fresh Satrec: the deep-space integrator keeps its state in it, and two threads must not share that.
    model = Satrec.twoline2rv(elements.line1, elements.line2)
    error, position_km, velocity_km_s = model.sgp4_array(*epochs.utc_julian(leap_seconds_at=elements.epoch_utc))
    return position_km * units.KM, velocity_km_s * units.KM, error


def gcrs_from_teme(at: Epochs) -> np.ndarray:
    """Return the rotation matrices (time, 3, 3) that take coordinates in TEME to coordinates in GCRS axes."""
    whole, fraction = at.tt_julian()
    in_hours = fraction * 24.0
    hours = np.floor(in_hours)
    first = ((whole - J2000_TT_JD) * 24.0 + hours).astype(np.int64) - 1  # of the four hours around an epoch
    wanted, row = np.unique(first, return_inverse=True)
    nodes = np.array([[_node(int(hour) + k) for hour in wanted] for k in range(4)]).reshape(4, -1, 3, 3)
    total = np.zeros((len(at), 3, 3))
    for around, weight in zip(nodes, _lagrange(in_hours - hours), strict=True):
        total += weight[:, None, None] * around[row]
    return total


def _lagrange(u: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return the weights of values at -1, 0, 1, 2 for the cubic through them at u in [0, 1]."""
    a, b, c, d = u + 1.0, u, u - 1.0, u - 2.0
    return -b * c * d / 6.0, a * c * d / 2.0, -a * b * d / 2.0, a * b * c / 6.0


def _node(hour: int) -> np.ndarray:
    """Return gcrs_from_teme (3, 3) at a whole hour TT since J2000.0."""
    matrix: np.ndarray = _day_of_nodes(hour // 24)[hour % 24]
    return matrix


@functools.lru_cache(maxsize=4096)
def _day_of_nodes(day: int) -> np.ndarray:
    """Return gcrs_from_teme (24, 3, 3) at the whole hours of one day since J2000.0; always a whole day, for equal bits."""
    from skyfield.sgp4lib import TEME

    time = skyfield_tt(np.full(24, J2000_TT_JD + day), np.arange(24) / 24.0)
    teme_from_gcrs = TEME.rotation_at(time)  # (3, 3, time)
    nodes: np.ndarray = np.ascontiguousarray(teme_from_gcrs.transpose(2, 1, 0))
    nodes.flags.writeable = False
    return nodes
