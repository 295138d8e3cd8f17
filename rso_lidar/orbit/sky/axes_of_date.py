"""Axes of date: the mean equator (MOD) and the true equator (TOD) with their equinoxes, and TEME.

The rotations are skyfield's: IAU 2006 precession, IAU 2000A nutation and the frame bias. They are computed at whole hours
TT and interpolated by a cubic through the four hours around an epoch. That is within skyfield's own rounding (1e-13 rad,
5 um at GEO) and far faster. The hours are absolute, so the bits of a state do not depend on the other epochs.
"""

from __future__ import annotations

import functools
from typing import Any, Literal

import numpy as np

from rso_lidar.orbit.epochs import J2000_TT_JD, Epochs, skyfield_tt

DateAxes = Literal["mod", "tod", "teme"]


def gcrs_from_axes_of_date(axes: DateAxes, at: Epochs) -> np.ndarray:
    """Return the rotation matrices (time, 3, 3) that take coordinates in axes of date to GCRS coordinates.

    Parameters
    ----------
    axes : "mod" (mean equator and equinox), "tod" (true equator and equinox) or "teme" (true equator, mean equinox)
    """
    whole, fraction = at.tt_julian()
    in_hours = fraction * 24.0
    hours = np.floor(in_hours)
    first = ((whole - J2000_TT_JD) * 24.0 + hours).astype(np.int64) - 1  # first of the four hours around an epoch
    wanted, row = np.unique(first, return_inverse=True)
    around = np.add.outer(range(4), wanted).ravel().tolist()
    nodes = np.array([_day_of_matrices(axes, hour // 24)[hour % 24] for hour in around]).reshape(4, -1, 3, 3)
    total = np.zeros((len(at), 3, 3))
    for node, weight in zip(nodes, _lagrange(in_hours - hours), strict=True):
        total += weight[:, None, None] * node[row]
    return total


def _lagrange(u: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return the weights of values at -1, 0, 1, 2 for the cubic through them, at u in [0, 1]."""
    a, b, c, d = u + 1.0, u, u - 1.0, u - 2.0
    return -b * c * d / 6.0, a * c * d / 2.0, -a * b * d / 2.0, a * b * c / 6.0


@functools.lru_cache(maxsize=4096)
def _day_of_matrices(axes: DateAxes, day: int) -> np.ndarray:
    """Return gcrs_from_axes (24, 3, 3) at the whole hours of a day since J2000.0.

    It is always a whole day, because the bits of skyfield's sums depend on the number of instants.
    """
    time = skyfield_tt(np.full(24, J2000_TT_JD + day), np.arange(24) / 24.0)
    nodes: np.ndarray = np.ascontiguousarray(_skyfield_frame(axes).rotation_at(time).transpose(2, 1, 0))
    nodes.flags.writeable = False
    return nodes


def _skyfield_frame(axes: DateAxes) -> Any:
    """Return skyfield's frame, whose `rotation_at` is axes_from_gcrs (3, 3, time)."""
    from skyfield import framelib, sgp4lib

    if axes == "mod":
        return framelib.mean_equator_and_equinox_of_date
    return framelib.true_equator_and_equinox_of_date if axes == "tod" else sgp4lib.TEME
