"""A state with its covariance, and the relative state of two of them."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from rso_lidar import units
from rso_lidar.errors import ScenarioError
from rso_lidar.orbit.two_body.covariance_history import check_covariances
from rso_lidar.orbit.two_body.kepler import semi_major_axis_m
from rso_lidar.part import to_real_array
from rso_lidar.pose import dot

GM = units.EARTH_GM_M3_S2
_SIGMAS = 8.0  # of the position along the relative velocity, that the window of a fast encounter covers


@dataclass(frozen=True, eq=False)
class UncertainState:
    """A state in inertial axes and its covariance.

    Parameters
    ----------
    position_m, velocity_m_s : (3,) in inertial axes [m], [m/s]
    covariance : (6, 6) of position and velocity in the same axes [m2, m2/s, m2/s2], or (3, 3) of position alone [m2].
        Without its part, the velocity counts as known exactly

    Raises
    ------
    ScenarioError
        if the arrays have other shapes or values that are not finite, or the covariance is not symmetric and positive
        semidefinite
    """

    position_m: np.ndarray
    velocity_m_s: np.ndarray
    covariance: np.ndarray

    def __post_init__(self) -> None:
        for name in ("position_m", "velocity_m_s"):
            object.__setattr__(self, name, _check_array(name, getattr(self, name), ((3,),)))
        given = _check_array("covariance", self.covariance, ((3, 3), (6, 6)))
        full = np.zeros((6, 6))
        full[: len(given), : len(given)] = given
        full = check_covariances(full, "covariance", "or give the 3 x 3 part of the position alone")
        object.__setattr__(self, "covariance", full)

    @property
    def fastest_rad_s(self) -> float:
        """Angular rate at perigee [rad/s]."""
        r, v = self.position_m, self.velocity_m_s
        h = np.cross(r, v)
        latus = float(h @ h) / GM
        eccentricity = np.linalg.norm(np.cross(v, h) / GM - r / np.linalg.norm(r))
        perigee = latus / (1.0 + float(eccentricity))
        return float(np.linalg.norm(h)) / perigee**2

    @property
    def period_s(self) -> float:
        """Period of the orbit [s], infinite where there is none."""
        axis = semi_major_axis_m(self.position_m, self.velocity_m_s)
        return 2.0 * math.pi * math.sqrt(axis**3 / GM) if 0.0 < axis < math.inf else math.inf

    def factor(self) -> np.ndarray:
        """Return a matrix (6, 6) L with L L^T = covariance; eigenvalues below 0, from rounding, count as 0."""
        scale = np.sqrt(np.diag(self.covariance))
        unit = np.where(scale > 0.0, scale, 1.0)
        values, vectors = np.linalg.eigh(self.covariance / np.outer(unit, unit))
        root: np.ndarray = unit[:, None] * vectors * np.sqrt(np.maximum(values, 0.0))
        return root


@dataclass(frozen=True, eq=False)
class UncertainSeparation:
    """The state of the second of two objects relative to the first, with the covariance of its position.

    Parameters
    ----------
    position_m, velocity_m_s : (3,) [m], [m/s]
    covariance_m2 : (3, 3) sum of both covariances of position; the errors of the two count as independent [m2]
    """

    position_m: np.ndarray
    velocity_m_s: np.ndarray
    covariance_m2: np.ndarray

    @classmethod
    def between(cls, first: UncertainState, second: UncertainState) -> UncertainSeparation:
        """Return the state of one object relative to another.

        Parameters
        ----------
        first, second : the states, in the same inertial axes; the second is taken relative to the first
        """
        return cls(
            second.position_m - first.position_m,
            second.velocity_m_s - first.velocity_m_s,
            first.covariance[:3, :3] + second.covariance[:3, :3],
        )

    @property
    def speed_m_s(self) -> float:
        """Relative speed [m/s]."""
        return float(np.linalg.norm(self.velocity_m_s))

    @property
    def sigma_along_m(self) -> float:
        """Standard deviation of the position along the relative velocity [m], NaN without relative velocity."""
        speed = self.speed_m_s
        along = self.velocity_m_s / speed if speed > 0.0 else np.full(3, math.nan)
        return math.sqrt(max(float(along @ self.covariance_m2 @ along), 0.0)) if speed > 0.0 else math.nan

    @property
    def closest_s(self) -> float:
        """Time until the closest approach on a straight line [s], NaN without relative velocity."""
        square = float(dot(self.velocity_m_s, self.velocity_m_s))
        return -float(dot(self.position_m, self.velocity_m_s)) / square if square > 0.0 else math.nan

    def encounter_plane(self) -> tuple[np.ndarray, np.ndarray]:
        """Project position and covariance onto the plane normal to the relative velocity.

        Returns
        -------
        miss_m : (2,) position of the second object in the plane [m]
        covariance_m2 : (2, 2) covariance in the plane [m2]

        Raises
        ------
        ScenarioError
            if there is no relative velocity
        """
        if not self.speed_m_s > 0.0:
            raise ScenarioError("encounter: has no relative velocity, so no plane is normal to it; use Monte Carlo")
        along = self.velocity_m_s / self.speed_m_s
        start = np.eye(3)[np.argmin(np.abs(along))]
        first = np.cross(along, start)
        first /= np.linalg.norm(first)
        plane = np.stack([first, np.cross(along, first)])
        return plane @ self.position_m, plane @ self.covariance_m2 @ plane.T


def check_radius(radius_m: Any) -> float:
    """Check the combined hard-body radius of two objects, the sum of both radii.

    Parameters
    ----------
    radius_m : the radius [m]

    Returns
    -------
    float
        the same radius [m]

    Raises
    ------
    ScenarioError
        if it is not a number above 0 and at most 100 km
    """
    value = to_real_array(radius_m)
    if value is None or value.ndim or not 0.0 < float(value) <= 1e5:
        raise ScenarioError(f"radius_m: {radius_m!r:.40} is not a hard-body radius; give metres above 0, at most 1e5")
    return float(value)


def check_window(first: UncertainState, second: UncertainState, radius_m: float, window_s: float | None) -> float:
    """Check the time that is searched on each side of the instant of two states, or choose it.

    Parameters
    ----------
    first, second : the states
    radius_m : combined hard-body radius [m]
    window_s : the time [s]; None for what covers the closest approaches of nearly all draws on straight lines, at most half
        of the shorter period

    Returns
    -------
    float
        the time [s]

    Raises
    ------
    ScenarioError
        if it is not above 0 and at most 30 days
    """
    window = min(
        0.5 * min(first.period_s, second.period_s), _cover_s(UncertainSeparation.between(first, second), radius_m)
    )
    if window_s is None and not 0.0 < window < math.inf:
        raise ScenarioError("window_s: without relative velocity and a period there is no window to choose; give one")
    window = window if window_s is None else float(window_s)
    if not 0.0 < window <= 30.0 * units.DAY_S:
        raise ScenarioError(f"window_s: {window_s!r:.40} is not a window; give seconds above 0, at most 30 days")
    return window


def _cover_s(between: UncertainSeparation, radius_m: float) -> float:
    """Return the time [s] that covers the closest approaches of nearly all draws on straight lines."""
    if not between.speed_m_s > 0.0:
        return math.inf
    return abs(between.closest_s) + (_SIGMAS * between.sigma_along_m + radius_m) / between.speed_m_s


def _check_array(name: str, given: Any, shapes: tuple[tuple[int, ...], ...]) -> np.ndarray:
    """Check a field of a state."""
    array = to_real_array(given)
    if array is None or array.shape not in shapes or not np.isfinite(array).all():
        raise ScenarioError(f"{name}: needs finite numbers of shape {' or '.join(map(str, shapes))}")
    return array.astype(float)
