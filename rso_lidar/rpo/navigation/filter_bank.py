"""Relative navigation filters of many flights at once: an iterated extended Kalman filter, the flights along the last axis.

A measurement is linearised again at the estimate that includes it (Bell and Cathey, IEEE Trans. Automat. Contr. 38 (1993)
294). A direction is otherwise linearised about a range that is some per cent off, and the filter is overconfident. Updates
have Joseph's form, which keeps covariances positive.

Estimates are deviations from a reference path in inertial axes: position, velocity, and the errors of held thrust.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rso_lidar.orbit import invert_state_matrix, state_matrix
from rso_lidar.rpo.navigation.navigation_sensors import NavigationCamera, NavigationLidar

ORBIT_STATES = 6  # states of position and velocity
THRUST_STATES = 4  # states of held thrust: its size, and its turns about three axes, in standard deviations
_ITERATIONS = 2  # before the last linearisation: with a camera alone, mean NEES 6.4 (one or more), 14 (none), of 6
_TINY_M = 1e-9


@dataclass(frozen=True, eq=False)
class ScalarUpdate:
    """One scalar measurement in the filters, linearised.

    Parameters
    ----------
    slope : (3, run) derivative by the position
    gain : (state, run); 0 where the sensor did not measure
    sigma : (run,) standard deviation of the measurement
    """

    slope: np.ndarray
    gain: np.ndarray
    sigma: np.ndarray


class FilterBank:
    """Filters of many flights.

    Parameters
    ----------
    estimate : (6, run) first estimates: deviations from the reference [m], [m/s], inertial axes
    covariance : (6, 6) of their errors
    has_thrust : whether legs are held by thrust with errors
    """

    def __init__(self, estimate: np.ndarray, covariance: np.ndarray, *, has_thrust: bool) -> None:
        n_runs = estimate.shape[1]
        states = ORBIT_STATES + THRUST_STATES * has_thrust
        self.state = np.zeros((states, n_runs))
        self.state[:ORBIT_STATES] = estimate
        self.covariance = np.zeros((states, states, n_runs))
        self.covariance[:ORBIT_STATES, :ORBIT_STATES] = covariance[:, :, None]

    @property
    def orbit(self) -> np.ndarray:
        """Estimated deviations (6, run) of position [m] and velocity [m/s]."""
        deviations: np.ndarray = self.state[:ORBIT_STATES]
        return deviations

    def begin_leg(self) -> None:
        """Begin a leg that is held by thrust, whose errors are not known."""
        self.state[ORBIT_STATES:] = 0.0
        self.covariance[ORBIT_STATES:] = 0.0
        self.covariance[:, ORBIT_STATES:] = 0.0
        places = range(ORBIT_STATES, len(self.state))
        self.covariance[places, places] = 1.0

    def predict(
        self, moved: np.ndarray, transition: np.ndarray, noise: np.ndarray, thrust: np.ndarray | None = None
    ) -> None:
        """Propagate over a step.

        Parameters
        ----------
        moved : (6, run) where the estimates go without errors of held thrust [m], [m/s]
        transition : (6, 6) of small deviations
        noise : (6, 6) covariance that the process noise adds
        thrust : (6, 4) what the errors of held thrust do over the step; None without held thrust
        """
        whole = np.eye(len(self.state))
        whole[:ORBIT_STATES, :ORBIT_STATES] = transition
        self.state[:ORBIT_STATES] = moved
        if thrust is not None:
            whole[:ORBIT_STATES, ORBIT_STATES:] = thrust
            self.state[:ORBIT_STATES] += apply_matrix(thrust, self.state[ORBIT_STATES:])
        once = apply_matrix(whole, self.covariance)
        self.covariance = apply_matrix(whole, once.transpose(1, 0, 2))
        self.covariance = 0.5 * (self.covariance + self.covariance.transpose(1, 0, 2))
        self.covariance[:ORBIT_STATES, :ORBIT_STATES] += noise[:, :, None]

    def add_burn(self, change_m_s: np.ndarray, covariance: np.ndarray) -> None:
        """Add a burn as it was commanded.

        Parameters
        ----------
        change_m_s : (3, run) what it adds to the velocity of the estimate, less that of the reference [m/s]
        covariance : (3, 3, run) of its errors [m2/s2]
        """
        self.state[3:ORBIT_STATES] += change_m_s
        self.covariance[3:ORBIT_STATES, 3:ORBIT_STATES] += covariance

    def observe(
        self,
        sensor: NavigationLidar | NavigationCamera,
        reference_m: np.ndarray,
        true_m: np.ndarray,
        numbers: np.ndarray,
    ) -> list[ScalarUpdate]:
        """Measure with a sensor, and update the estimates where the target is within its limits.

        Parameters
        ----------
        sensor : whose view is not closed by the Sun
        reference_m : (3, 1) reference position relative to the target [m], inertial axes
        true_m : (3, run) true position relative to the target [m], inertial axes
        numbers : (3, run) standard normal: two of the direction and one of the range

        Returns
        -------
        list of ScalarUpdate
            as made in this order: two of the direction, and that of the range
        """
        expected = reference_m + self.state[:3]
        range_m, along = _split(true_m)
        first, second = find_axes_across(along)
        bearing = sensor.find_bearing_sigma_rad(range_m)
        turned = along + bearing * (numbers[0] * first + numbers[1] * second)
        seen_range_m = range_m + (sensor.find_range_sigma_m(range_m) * numbers[2] if sensor.measures_range else 0.0)
        off = np.arctan2(np.sqrt(_dot_square(np.cross(expected, true_m, axis=0))), np.sum(expected * true_m, axis=0))
        seen = sensor.can_measure(range_m, off)
        variances = self._find_variances(sensor, expected)
        place, spread = expected, self.covariance[:3, :3]
        for _ in range(_ITERATIONS):
            rows = _linearise(place, turned, seen_range_m if sensor.measures_range else None)
            moved, kept = expected, spread
            for (slope, at), variance in zip(rows, variances, strict=False):
                moved, kept, _ = _assimilate(moved, kept, slope, at - np.sum(slope * moved, axis=0), variance)
            place = np.where(seen, moved, place)
        rows = _linearise(place, turned, seen_range_m if sensor.measures_range else None)
        updates = []
        for (slope, at), variance in zip(rows, variances, strict=False):
            innovation = at - np.sum(slope * (reference_m + self.state[:3]), axis=0)
            self.state, self.covariance, gain = _assimilate(
                self.state, self.covariance, slope, innovation, variance, seen
            )
            updates.append(ScalarUpdate(slope, gain, np.sqrt(variance)))
        return updates

    def find_orbit_covariance(self, axes: np.ndarray, turn_rad_s: np.ndarray) -> np.ndarray:
        """Return the covariance (run, 6, 6) of position [m] and velocity [m/s] in rotating axes.

        Parameters
        ----------
        axes : (3, 3) the axes, as columns in inertial axes
        turn_rad_s : (3,) their angular velocity, in these axes [rad/s]
        """
        whole = invert_state_matrix(state_matrix(axes, turn_rad_s))
        once = apply_matrix(whole, self.covariance[:ORBIT_STATES, :ORBIT_STATES])
        covariance: np.ndarray = apply_matrix(whole, once.transpose(1, 0, 2)).transpose(2, 0, 1)
        return covariance

    @staticmethod
    def _find_variances(sensor: NavigationLidar | NavigationCamera, expected_m: np.ndarray) -> Sequence[np.ndarray]:
        """Return the variances (run,) of both angles of a direction and of a range, as the filter expects them."""
        range_m, _ = _split(expected_m)
        bearing = sensor.find_bearing_sigma_rad(range_m) ** 2
        return bearing, bearing, sensor.find_range_sigma_m(range_m) ** 2


def find_axes_across(along: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return two unit vectors (3, run) across others, and across each other."""
    least = np.argmin(np.abs(along), axis=0)
    first = np.cross(along, np.eye(3)[:, least], axis=0)
    first = first / np.sqrt(_dot_square(first))
    return first, np.cross(along, first, axis=0)


def apply_matrix(matrix: np.ndarray, columns: np.ndarray) -> np.ndarray:
    """Return the product (m, …) of a matrix and columns; a column has the same bits alone and among others.

    Parameters
    ----------
    matrix : (m, k), or (m, k, …) with one matrix for each column
    columns : (k, …)
    """
    wide = (slice(None), slice(None), *(None,) * (columns.ndim - 1))
    spread = matrix[wide]
    product: np.ndarray = spread[:, 0] * columns[0]
    for k in range(1, matrix.shape[1]):
        product = product + spread[:, k] * columns[k]
    return product


def _linearise(
    place_m: np.ndarray, direction: np.ndarray, range_m: np.ndarray | None
) -> list[tuple[np.ndarray, np.ndarray]]:
    """Linearise measurements at positions: the slope (3, run), and what slope times position should be (run,).

    Parameters
    ----------
    place_m : (3, run) positions relative to the target [m]
    direction : (3, run) measured directions, of any length
    range_m : (run,) measured ranges [m]; None if there are none
    """
    size, along = _split(place_m)
    ahead = np.sum(direction * along, axis=0)
    ahead = np.where(ahead > 0.0, np.maximum(ahead, _TINY_M), 1.0)
    rows = [(axis / size, np.sum(direction * axis, axis=0) / ahead) for axis in find_axes_across(along)]
    return rows if range_m is None else [*rows, (along, range_m)]


def _assimilate(
    state: np.ndarray,
    covariance: np.ndarray,
    slope: np.ndarray,
    innovation: np.ndarray,
    variance: np.ndarray,
    seen: np.ndarray | None = None,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Update states by one scalar measurement of the position, in Joseph's form.

    Parameters
    ----------
    state, covariance : (state, run) and (state, state, run), the position first
    slope : (3, run) derivative of the measurement
    innovation, variance : (run,) measured less expected, and the variance of the measurement
    seen : (run,) whether there is a measurement; None if there is in all
    """
    crossed = _sum_three(covariance, slope)
    gain = crossed / (np.sum(crossed[:3] * slope, axis=0) + variance)
    if seen is not None:
        gain = np.where(seen, gain, 0.0)
    left = covariance - gain[:, None] * crossed[None]
    kept = left - _sum_three(left, slope)[:, None] * gain[None] + gain[:, None] * (variance * gain)[None]
    return state + gain * innovation, 0.5 * (kept + kept.transpose(1, 0, 2)), gain


def _sum_three(covariance: np.ndarray, slope: np.ndarray) -> np.ndarray:
    product: np.ndarray = covariance[:, 0] * slope[0] + covariance[:, 1] * slope[1] + covariance[:, 2] * slope[2]
    return product


def _split(vectors: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return sizes (run,) and directions (3, run) of vectors (3, run)."""
    size = np.maximum(np.sqrt(_dot_square(vectors)), _TINY_M)
    return size, vectors / size


def _dot_square(vectors: np.ndarray) -> np.ndarray:
    square: np.ndarray = vectors[0] ** 2 + vectors[1] ** 2 + vectors[2] ** 2
    return square
