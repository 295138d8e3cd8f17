"""Conditions on two objects, such as range, light and line of sight, with bounds on how fast each can change.

A condition is a signed function of the geometry, negative where it holds. Its rate is bounded by the relative speed, the
range and the orbital rates along an interval. `find_bounded_spans` needs no finer scan than these bounds ask for.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from rso_lidar import units
from rso_lidar.orbit.earth.ground import GroundStation
from rso_lidar.orbit.epochs import Epochs
from rso_lidar.orbit.sky.eclipse import shadow_margins_rad
from rso_lidar.orbit.sky.geometry import angle_rad, earth_limb_angle_rad, line_altitude_m, phase_angle_rad
from rso_lidar.orbit.sky.moon import moon_position_m
from rso_lidar.orbit.sky.sun import sun_position_m
from rso_lidar.orbit.two_body.orbit_axes import rtn_matrix
from rso_lidar.pose import dot, length, rotate_vectors
from rso_lidar.records import BodyState

_TOGETHER_M = 1e-3  # closer than this there is no line of sight
# Rates of directions seen from an orbit [rad/s]: the Sun by the Earth's motion and by parallax of 10 km/s, the Moon by its
# own motion and by that parallax.
_SUN_RAD_S, _MOON_RAD_S = 1e-6, 4e-5
EARTH_RAD_S = 7.3e-5  # rotation of a station's horizon
_SLACK = 1.05  # for what the bounds leave out, such as precession of orbital planes


@dataclass(frozen=True, eq=False)
class PairSamples:
    """Two objects at some instants; vectors are (time, 3) in GCRS axes.

    Parameters
    ----------
    epochs : the instants
    observer, target : states of the object that looks and of the one that is seen
    """

    epochs: Epochs
    observer: BodyState
    target: BodyState

    @cached_property
    def line_m(self) -> np.ndarray:
        """Vectors from the observer to the target [m]."""
        line: np.ndarray = self.target.position_m - self.observer.position_m
        return line

    @cached_property
    def rate_m_s(self) -> np.ndarray:
        """Derivatives of `line_m` in inertial axes [m/s]."""
        rate: np.ndarray = self.target.velocity_m_s - self.observer.velocity_m_s
        return rate

    @cached_property
    def range_m(self) -> np.ndarray:
        """Distance (time,) [m]."""
        return length(self.line_m)

    @cached_property
    def sun_m(self) -> np.ndarray:
        """Position of the Sun [m]."""
        return sun_position_m(self.epochs)

    def keep_apart(self, values: np.ndarray) -> np.ndarray:
        """Return values (time,), NaN where the two are at one place and have no line of sight.

        Parameters
        ----------
        values : what depends on the line of sight
        """
        return np.where(self.range_m < _TOGETHER_M, np.nan, values)


class MotionBounds:
    """Bounds (interval,) on the motion of two objects between two instants, from their states at both.

    Speeds change within an interval by less than they do from end to end. Distances change by less than the greatest speed
    times the interval.

    Parameters
    ----------
    low, high : (interval, 12) relative position and velocity, then those of the observer [m], [m/s]
    step_s : (interval,) lengths [s]
    """

    def __init__(self, low: np.ndarray, high: np.ndarray, step_s: np.ndarray) -> None:
        self._low, self._high, self.step_s = low, high, step_s
        self.speed_m_s, self.least_range_m, self.acceleration_m_s2 = _bound_vector(low[:, :6], high[:, :6], step_s)
        self.own_speed_m_s, self.own_radius_m, _ = _bound_vector(low[:, 6:12], high[:, 6:12], step_s)
        ends = low[:, :6] + low[:, 6:12], high[:, :6] + high[:, 6:12]
        self.target_speed_m_s, self.target_radius_m, _ = _bound_vector(*ends, step_s)

    @property
    def greatest_range_m(self) -> np.ndarray:
        """Greatest distance [m]."""
        farthest: np.ndarray = length(self._low[:, :3]) + self.speed_m_s * self.step_s
        return farthest

    @cached_property
    def turning_rad_s(self) -> np.ndarray:
        """Greatest rate of the line of sight [rad/s]."""
        return _divide(self.speed_m_s, self.least_range_m)

    @property
    def own_turning_rad_s(self) -> np.ndarray:
        """Greatest rate of the observer's direction from the Earth's centre, and of its rtn axes [rad/s]."""
        return _divide(self.own_speed_m_s, self.own_radius_m)

    @property
    def target_turning_rad_s(self) -> np.ndarray:
        """Greatest rate of the target's direction from the Earth's centre, and of its rtn axes [rad/s]."""
        return _divide(self.target_speed_m_s, self.target_radius_m)

    @property
    def range_rate_m_s(self) -> np.ndarray:
        """Greatest rate of the range [m/s], from those at both ends and its second derivative between."""
        at_ends = [
            np.abs(dot(rows[:, :3], rows[:, 3:6])) / np.maximum(length(rows[:, :3]), _TOGETHER_M)
            for rows in (self._low, self._high)
        ]
        bend = self.speed_m_s * self.turning_rad_s + self.acceleration_m_s2
        rate: np.ndarray = np.minimum(np.maximum(*at_ends) + 0.5 * bend * self.step_s, self.speed_m_s)
        return rate


def _bound_vector(low: np.ndarray, high: np.ndarray, step_s: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return greatest speed, least length and greatest acceleration of a vector whose states (interval, 6) are known."""
    change = length(high[:, 3:] - low[:, 3:])
    speed = np.maximum(length(low[:, 3:]), length(high[:, 3:])) + change
    least = 0.5 * (length(low[:, :3]) + length(high[:, :3]) - speed * step_s)
    return speed, np.maximum(least, 0.0), 2.0 * _divide(change, step_s)


def _divide(above: np.ndarray, below: np.ndarray) -> np.ndarray:
    """Divide, with 0 where both are 0."""
    with np.errstate(divide="ignore", invalid="ignore"):
        quotient: np.ndarray = np.where(above > 0.0, above / below, 0.0)
    return quotient


@dataclass(frozen=True)
class PairQuantity:
    """A function of two objects' geometry, and a bound on its rate.

    Parameters
    ----------
    value : of samples, (time,)
    rate : greatest rate (interval,) [1/s], of bounds on the motion
    """

    value: Callable[[PairSamples], np.ndarray]
    rate: Callable[[MotionBounds], np.ndarray]

    def less_than(self, limit: float) -> PairQuantity:
        """Return the condition that the quantity is below a limit: negative where it is.

        Parameters
        ----------
        limit : in the unit of the quantity
        """
        return PairQuantity(lambda pair: self.value(pair) - limit, self.rate)

    def more_than(self, limit: float) -> PairQuantity:
        """Return the condition that the quantity is above a limit: negative where it is.

        Parameters
        ----------
        limit : in the unit of the quantity
        """
        return PairQuantity(lambda pair: limit - self.value(pair), self.rate)


RANGE_M: PairQuantity = PairQuantity(lambda pair: pair.range_m, lambda bounds: bounds.range_rate_m_s)
SPEED_M_S: PairQuantity = PairQuantity(lambda pair: length(pair.rate_m_s), lambda bounds: bounds.acceleration_m_s2)
SLEW_RAD_S: PairQuantity = PairQuantity(
    lambda pair: pair.keep_apart(length(np.cross(pair.line_m, pair.rate_m_s)) / np.maximum(pair.range_m**2, 1e-6)),
    lambda bounds: 3.0 * bounds.turning_rad_s**2 + _divide(bounds.acceleration_m_s2, bounds.least_range_m),
)
SUN_ANGLE_RAD: PairQuantity = PairQuantity(
    lambda pair: pair.keep_apart(angle_rad(pair.line_m, pair.sun_m - pair.observer.position_m)),
    lambda bounds: bounds.turning_rad_s + _SUN_RAD_S,
)
MOON_ANGLE_RAD: PairQuantity = PairQuantity(
    lambda pair: pair.keep_apart(angle_rad(pair.line_m, moon_position_m(pair.epochs) - pair.observer.position_m)),
    lambda bounds: bounds.turning_rad_s + _MOON_RAD_S,
)
LIMB_ANGLE_RAD: PairQuantity = PairQuantity(
    lambda pair: pair.keep_apart(earth_limb_angle_rad(pair.line_m, pair.observer.position_m)),
    lambda bounds: bounds.turning_rad_s + _limb_rate_rad_s(bounds.own_turning_rad_s, bounds.own_radius_m),
)
PHASE_RAD: PairQuantity = PairQuantity(
    lambda pair: pair.keep_apart(phase_angle_rad(pair.target.position_m, pair.observer.position_m, pair.sun_m)),
    lambda bounds: bounds.turning_rad_s + _SUN_RAD_S,
)
LINE_ALTITUDE_M: PairQuantity = PairQuantity(
    lambda pair: line_altitude_m(pair.observer.position_m, pair.target.position_m),
    lambda bounds: np.maximum(bounds.own_speed_m_s, bounds.target_speed_m_s),
)


def sun_height_rad(of_target: bool, part: str = "half") -> PairQuantity:
    """Return how far the Sun is clear of the Earth's limb, seen from one of two objects [rad].

    Parameters
    ----------
    of_target : whether from the target, else from the observer
    part : of the Sun's disc: ``"touched"`` by the Earth, ``"covered"`` by it, or ``"half"``
    """

    def value(pair: PairSamples) -> np.ndarray:
        touched, covered = shadow_margins_rad((pair.target if of_target else pair.observer).position_m, pair.sun_m)
        height: np.ndarray = {"touched": touched, "covered": covered, "half": 0.5 * (touched + covered)}[part]
        return height

    def rate(bounds: MotionBounds) -> np.ndarray:
        if of_target:
            return _limb_rate_rad_s(bounds.target_turning_rad_s, bounds.target_radius_m) + _SUN_RAD_S
        return _limb_rate_rad_s(bounds.own_turning_rad_s, bounds.own_radius_m) + _SUN_RAD_S

    return PairQuantity(value, rate)


def _limb_rate_rad_s(turning_rad_s: np.ndarray, radius_m: np.ndarray) -> np.ndarray:
    """Bound the rate of an angle from the Earth's limb: of its centre's direction, and of its angular radius."""
    horizon_m = np.sqrt(np.maximum(radius_m**2 - units.EARTH_RADIUS_M**2, 0.0))
    return turning_rad_s * (1.0 + _divide(np.full_like(radius_m, units.EARTH_RADIUS_M), horizon_m))


def elevation_rad(station: GroundStation) -> PairQuantity:
    """Return the elevation of the target [rad], where the observer is a station on the ground.

    Parameters
    ----------
    station : the observer
    """
    return PairQuantity(
        lambda pair: station.elevation_rad(pair.target.position_m, pair.epochs),
        lambda bounds: bounds.turning_rad_s + EARTH_RAD_S,
    )


def rtn_angle_rad(axis: Sequence[float]) -> PairQuantity:
    """Return the angle between the line of sight and an axis that is fixed in the observer's rtn axes [rad].

    Parameters
    ----------
    axis : in the rtn axes of the observer, of any length
    """

    def value(pair: PairSamples) -> np.ndarray:
        inertial_from_rtn = rtn_matrix(pair.observer.position_m, pair.observer.velocity_m_s)[0]
        toward = rotate_vectors(inertial_from_rtn, np.broadcast_to(np.asarray(axis, dtype=float), pair.line_m.shape))
        return pair.keep_apart(angle_rad(pair.line_m, toward))

    return PairQuantity(value, lambda bounds: bounds.turning_rad_s + bounds.own_turning_rad_s)


@dataclass(frozen=True, eq=False)
class PairCondition:
    """A condition on two objects, as a function of time with bounded rate.

    Parameters
    ----------
    states : ``states(time_s (time,)) -> PairSamples``, with times in seconds
    condition : negative where it holds
    """

    states: Callable[[np.ndarray], PairSamples]
    condition: PairQuantity

    def sample(self, time_s: np.ndarray) -> np.ndarray:
        """Return rows (time, 13) at instants [s]: the condition, and the states that bound its rate.

        Parameters
        ----------
        time_s : instants [s]
        """
        pair = self.states(time_s)
        own = pair.observer
        columns = self.condition.value(pair)[:, None], pair.line_m, pair.rate_m_s, own.position_m, own.velocity_m_s
        return np.concatenate(columns, axis=1)

    def bound_change(self, low: np.ndarray, high: np.ndarray, step_s: np.ndarray) -> np.ndarray:
        """Return the greatest change (interval,) of the condition along intervals.

        Parameters
        ----------
        low, high : (interval, 13) rows at both ends
        step_s : (interval,) lengths [s]
        """
        change: np.ndarray = _SLACK * self.condition.rate(MotionBounds(low[:, 1:], high[:, 1:], step_s)) * step_s
        return change
