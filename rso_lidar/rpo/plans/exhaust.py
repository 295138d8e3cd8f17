"""The exhaust of a spacecraft that follows a plan: a cone opposite to the push of its thrust."""

from __future__ import annotations

import numpy as np

from rso_lidar.orbit import angle_rad
from rso_lidar.pose import length

_LEAST_PUSH = 1e-12  # a push below this is rounding, in m/s or m/s2


def plume_margin(push: np.ndarray, away_m: np.ndarray, half_angle_rad: float, range_m: float) -> np.ndarray:
    """Compute how far an object is outside the exhaust: negative where it is inside the cone and its range.

    Parameters
    ----------
    push : (time, 3) delta-v [m/s] or acceleration [m/s2] that thrust gives; the exhaust goes the other way
    away_m : (time, 3) position of the spacecraft from the object [m], in the axes of `push`
    half_angle_rad : between the axis of the cone and its edge [rad]
    range_m : distance up to which the exhaust counts [m]

    Returns
    -------
    ndarray
        (time,) the greater of the angle beyond the edge [rad] and the share by which the distance exceeds the range; 1
        where nothing pushes
    """
    beyond_rad = angle_rad(push, away_m) - half_angle_rad
    margin: np.ndarray = np.maximum(beyond_rad, length(away_m) / range_m - 1.0)
    return np.where(length(push) > _LEAST_PUSH, margin, 1.0)
