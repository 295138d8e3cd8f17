"""Records of the navigation filter: an estimate with its covariance, and one measurement with its innovation."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, eq=False)
class NavigationEstimate:
    """Estimated states at an instant, in inertial axes, with their covariance.

    Parameters
    ----------
    time_s : instant since start_utc [s]
    position_m, velocity_m_s : of the follower (xyz) [m], [m/s]
    relative_position_m, relative_velocity_m_s : of the target relative to the follower (xyz) [m], [m/s]
    inertial_from_body : attitude of the follower, a matrix (3, 3)
    covariance : (15, 15) of the errors of these, in this order; the error of the attitude is a small rotation in body axes
        [rad]
    """

    time_s: float
    position_m: np.ndarray
    velocity_m_s: np.ndarray
    relative_position_m: np.ndarray
    relative_velocity_m_s: np.ndarray
    inertial_from_body: np.ndarray
    covariance: np.ndarray


@dataclass(frozen=True, eq=False)
class NavigationUpdate:
    """One measurement in the filter: its instant [s], its source, the innovation, and its NIS."""

    time_s: float
    source: str
    innovation: np.ndarray
    nis: float
