"""Relative navigation filters of many flights at once: an iterated extended Kalman filter, the flights along the last axis.

A measurement is linearised again at the estimate that includes it (Bell and Cathey, IEEE Trans. Automat. Contr. 38 (1993)
294). A direction is otherwise linearised about a range that is some per cent off, and the filter is overconfident. Updates
have Joseph's form, which keeps covariances positive.

Estimates are deviations from a reference path in inertial axes: position, velocity, and the errors of held thrust. Slow
errors of sensors follow them: as states that are estimated, or as states that are considered (Schmidt, in Advances in
Control Systems 3 (1966) 293), whose uncertainty counts in the gains while their estimates stay zero.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from rso_lidar.orbit import invert_state_matrix, state_matrix
from rso_lidar.rpo.navigation.navigation_sensors import NavigationCamera, NavigationLidar
from rso_lidar.rpo.navigation.slow_errors import SlowErrors

ORBIT_STATES = 6  # states of position and velocity
THRUST_STATES = 4  # states of held thrust: its size, and its turns about three axes, in standard deviations
_ITERATIONS = 2  # before the last linearisation: with a camera alone, mean NEES 6.4 (one or more), 14 (none), of 6
_TINY_M = 1e-9
_NO_AXES = np.eye(3)


@dataclass(frozen=True, eq=False)
class ScalarUpdate:
    """One scalar measurement in the filters, linearised.

    Parameters
    ----------
    slope : (3, run) derivative by the position
    gain : (state, run); 0 where the sensor did not measure
    sigma : (run,) standard deviation of the measurement
    slow_slope : (error, run) derivative by the slow errors of all sensors
    """

    slope: np.ndarray
    gain: np.ndarray
    sigma: np.ndarray
    slow_slope: np.ndarray


class FilterBank:
    """Filters of many flights, and the true slow errors of their sensors.

    Parameters
    ----------
    estimate : (6, run) first estimates: deviations from the reference [m], [m/s], inertial axes
    covariance : (6, 6) of their errors
    has_thrust : whether legs are held by thrust with errors
    slow : slow errors of the sensors
    treatment : whether these are estimated, considered, or not in the filter

    Attributes
    ----------
    true_slow : (error, run) true slow errors [m], [rad]
    thrust_places, slow_places : slices of the states of held thrust and of slow errors
    """

    def __init__(
        self,
        estimate: np.ndarray,
        covariance: np.ndarray,
        *,
        has_thrust: bool,
        slow: SlowErrors | None = None,
        treatment: Literal["estimated", "considered", "ignored"] = "estimated",
    ) -> None:
        n_runs = estimate.shape[1]
        self._slow, self._is_considered = slow or SlowErrors(()), treatment == "considered"
        dynamic = ORBIT_STATES + THRUST_STATES * has_thrust
        states = dynamic + len(self._slow) * (treatment != "ignored")
        self.thrust_places, self.slow_places = slice(ORBIT_STATES, dynamic), slice(dynamic, states)
        self.state = np.zeros((states, n_runs))
        self.state[:ORBIT_STATES] = estimate
        self.covariance = np.zeros((states, states, n_runs))
        self.covariance[:ORBIT_STATES, :ORBIT_STATES] = covariance[:, :, None]
        if states > dynamic:
            places = np.arange(dynamic, states)
            self.covariance[places, places] = self._slow.sigma[:, None] ** 2
        self.true_slow = np.zeros((len(self._slow), n_runs))

    @property
    def orbit(self) -> np.ndarray:
        """Estimated deviations (6, run) of position [m] and velocity [m/s]."""
        deviations: np.ndarray = self.state[:ORBIT_STATES]
        return deviations

    @property
    def has_slow(self) -> bool:
        """Whether slow errors of the sensors are states of the filters."""
        return self.slow_places.start < self.slow_places.stop

    def find_slow(self) -> tuple[np.ndarray, np.ndarray]:
        """Return estimates (error, run) of slow errors and their standard deviations [m], [rad]; without rows if ignored."""
        places = np.arange(self.slow_places.start, self.slow_places.stop)
        return self.state[places], np.sqrt(self.covariance[places, places])

    def begin_leg(self) -> None:
        """Begin a leg that is held by thrust, whose errors are not known."""
        self.state[self.thrust_places] = 0.0
        self.covariance[self.thrust_places] = 0.0
        self.covariance[:, self.thrust_places] = 0.0
        places = range(self.thrust_places.start, self.thrust_places.stop)
        self.covariance[places, places] = 1.0

    def draw_slow(self, numbers: np.ndarray, step_s: float | None) -> None:
        """Draw the true slow errors of the sensors at their next instant.

        Parameters
        ----------
        numbers : (error, run) standard normal
        step_s : time since the instant before [s]; None at the first instant
        """
        decay, new_sigma = self._slow.find_step(step_s)
        self.true_slow = decay[:, None] * self.true_slow + new_sigma[:, None] * numbers

    def predict(
        self,
        moved: np.ndarray,
        transition: np.ndarray,
        noise: np.ndarray,
        thrust: np.ndarray | None = None,
        *,
        step_s: float = 0.0,
    ) -> None:
        """Propagate over a step.

        Parameters
        ----------
        moved : (6, run) where the estimates go without errors of held thrust [m], [m/s]
        transition : (6, 6) of small deviations
        noise : (6, 6) covariance that the process noise adds
        thrust : (6, 4) what the errors of held thrust do over the step; None without held thrust
        step_s : length of the step [s], over which slow errors decay
        """
        dynamic = slice(0, self.thrust_places.stop)
        whole = np.eye(dynamic.stop)
        whole[:ORBIT_STATES, :ORBIT_STATES] = transition
        self.state[:ORBIT_STATES] = moved
        if thrust is not None:
            whole[:ORBIT_STATES, ORBIT_STATES:] = thrust
            self.state[:ORBIT_STATES] += apply_matrix(thrust, self.state[self.thrust_places])
        once = self.covariance.copy()
        once[dynamic] = apply_matrix(whole, once[dynamic])
        once = once.transpose(1, 0, 2)
        once[dynamic] = apply_matrix(whole, once[dynamic])
        if self.has_slow:
            decay, new_sigma = self._slow.find_step(step_s)
            places = np.arange(dynamic.stop, len(self.state))
            self.state[self.slow_places] *= decay[:, None]
            once[self.slow_places] *= decay[:, None, None]
            once[:, self.slow_places] *= decay[:, None]
            once[places, places] += new_sigma[:, None] ** 2
        self.covariance = 0.5 * (once + once.transpose(1, 0, 2))
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
        *,
        number: int = 0,
        axes: np.ndarray = _NO_AXES,
    ) -> list[ScalarUpdate]:
        """Measure with a sensor, and update the estimates where the target is within its limits.

        Parameters
        ----------
        sensor : whose view is not closed by the Sun
        reference_m : (3, 1) reference position relative to the target [m], inertial axes
        true_m : (3, run) true position relative to the target [m], inertial axes
        numbers : (3, run) standard normal: two of the direction and one of the range
        number : index of the sensor, whose slow errors are meant
        axes : (3, 3) rtn axes of the target, as columns in inertial axes; only slow errors need them

        Returns
        -------
        list of ScalarUpdate
            as made in this order: two of the direction, and that of the range
        """
        mine = self._slow.find_places(number)
        shown_m = true_m
        if len(mine):
            shown_m = true_m - _combine(self._slow.find_shifts(mine, true_m, axes), self.true_slow[mine])
        expected = reference_m + self.state[:3]
        range_m, along = _split(shown_m)
        first, second = find_axes_across(along)
        bearing = sensor.find_bearing_sigma_rad(range_m)
        turned = along + bearing * (numbers[0] * first + numbers[1] * second)
        seen_range_m = range_m + (sensor.find_range_sigma_m(range_m) * numbers[2] if sensor.measures_range else 0.0)
        off = np.arctan2(np.sqrt(_dot_square(np.cross(expected, true_m, axis=0))), np.sum(expected * true_m, axis=0))
        seen = sensor.can_measure(_split(true_m)[0], off)
        variances = self._find_variances(sensor, expected)
        places, local = np.arange(3), np.arange(3)  # of the measured states: among all, and among `values`
        if self.has_slow:
            places = np.append(places, self.slow_places.start + mine)
            local = np.arange(len(places))
        still, still_here = (self.slow_places, slice(3, None)) if self._is_considered else (None, None)

        def linearise(values: np.ndarray) -> list[tuple[np.ndarray, np.ndarray, np.ndarray]]:
            moves, point = np.zeros((3, 0, 1)), values[:3]
            if len(mine):
                moves = self._slow.find_shifts(mine, point, axes)
                point = point - _combine(moves, values[3:]) if len(values) > 3 else point
            rows = _linearise(point, turned, seen_range_m if sensor.measures_range else None)
            return [(slope, -_sum_products(slope[:, None], moves), at) for slope, at in rows]

        base = self.state[places]
        base[:3] = expected
        values, spread = base, self.covariance[np.ix_(places, places)]
        for _ in range(_ITERATIONS):
            moved, kept = base, spread
            for (slope, slow_slope, at), variance in zip(linearise(values), variances, strict=False):
                whole = np.concatenate([slope, slow_slope])[local]
                innovation = at - _sum_products(whole, moved)
                moved, kept, _ = _assimilate(moved, kept, local, whole, innovation, variance, still=still_here)
            values = np.where(seen, moved, values)
        updates = []
        for (slope, slow_slope, at), variance in zip(linearise(values), variances, strict=False):
            whole = np.concatenate([slope, slow_slope])[local]
            base = self.state[places]
            base[:3] += reference_m
            self.state, self.covariance, gain = _assimilate(
                self.state, self.covariance, places, whole, at - _sum_products(whole, base), variance, seen, still
            )
            by_error = np.zeros((len(self._slow), slope.shape[1]))
            by_error[mine] = slow_slope
            updates.append(ScalarUpdate(slope, gain, np.sqrt(variance), by_error))
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
    places: np.ndarray,
    slope: np.ndarray,
    innovation: np.ndarray,
    variance: np.ndarray,
    seen: np.ndarray | None = None,
    still: slice | None = None,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Update states by one scalar measurement, in Joseph's form.

    Parameters
    ----------
    state, covariance : (state, run) and (state, state, run)
    places : (k,) indices of the states that are measured
    slope : (k, run) derivative of the measurement by these
    innovation, variance : (run,) measured less expected, and the variance of the measurement
    seen : (run,) whether there is a measurement; None if there is in all
    still : states that are considered, not estimated; None (default) for none
    """
    crossed = _project(covariance, places, slope)
    gain = crossed / (_project(crossed[None], places, slope)[0] + variance)
    if seen is not None:
        gain = np.where(seen, gain, 0.0)
    if still is not None:
        gain[still] = 0.0
    left = covariance - gain[:, None] * crossed[None]
    kept = left - _project(left, places, slope)[:, None] * gain[None] + gain[:, None] * (variance * gain)[None]
    return state + gain * innovation, 0.5 * (kept + kept.transpose(1, 0, 2)), gain


def _project(matrix: np.ndarray, places: np.ndarray, slope: np.ndarray) -> np.ndarray:
    """Return the product (m, run) of the columns of a matrix (m, state, run) at places (k,) and a slope (k, run)."""
    product: np.ndarray = matrix[:, places[0]] * slope[0]
    for place, row in zip(places[1:], slope[1:], strict=True):
        product = product + matrix[:, place] * row
    return product


def _sum_products(values: np.ndarray, others: np.ndarray) -> np.ndarray:
    """Return the sum (…, run) of products (k, …, run) over the first axis, with the same bits for a run alone."""
    total: np.ndarray = values[0] * others[0]
    for k in range(1, len(values)):
        total = total + values[k] * others[k]
    return total


def _combine(moves: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Return the sum (3, run) of displacements (3, error, run) times values (error, run)."""
    return _sum_products(moves.swapaxes(0, 1), values[:, None])


def _split(vectors: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return sizes (run,) and directions (3, run) of vectors (3, run)."""
    size = np.maximum(np.sqrt(_dot_square(vectors)), _TINY_M)
    return size, vectors / size


def _dot_square(vectors: np.ndarray) -> np.ndarray:
    square: np.ndarray = vectors[0] ** 2 + vectors[1] ** 2 + vectors[2] ** 2
    return square
