"""Quantities of a flight that goals and limits name: relative state, light, own orbit, and cost."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from rso_lidar import units
from rso_lidar.motion import Body, Chief, find_flight, find_plan, get_chief_name
from rso_lidar.orbit import Epochs, Impulse, angle_rad, phase_angle_rad, rotate_to_inertial, sun_position_m
from rso_lidar.part import Vector
from rso_lidar.pose import rotate_vectors
from rso_lidar.records import BodyState
from rso_lidar.rpo import relative_elements_from_states, rtn_matrix
from rso_lidar.scenario import Scenario

_LEAST_M_S = 1e-9  # an impulse below this is rounding, and its exhaust has no direction


class Push(NamedTuple):
    """A maneuver: when it begins [s], its delta-v [m/s], and its direction (3,) in inertial axes, of any length."""

    time_s: float
    size_m_s: float
    direction: np.ndarray


class States:
    """States of target and follower at instants, each evaluated when it is first asked for.

    Parameters
    ----------
    time_s : (time,) since the start [s]
    """

    def __init__(self, scenario: Scenario, target: str, time_s: np.ndarray) -> None:
        self._body, self._bodies, self._name = scenario.bodies[-1], scenario.bodies, target
        self.epochs = Epochs(scenario.time.start_utc, time_s)
        self._chief = Chief(scenario.bodies, target)

    @cached_property
    def target(self) -> BodyState:
        """Inertial state of the target."""
        return self._chief.states(self.epochs)

    @cached_property
    def follower(self) -> BodyState:
        """Inertial state of the follower."""
        return Chief(self._bodies, self._body.name).states(self.epochs)

    @cached_property
    def _relative(self) -> tuple[np.ndarray, np.ndarray]:
        motion: Any = self._body.motion
        if get_chief_name(motion) == self._name:  # no difference of large numbers
            position_m, velocity_m_s = motion.relative(self.epochs, self._chief)
            return position_m, velocity_m_s
        axes, rate_rad_s = rtn_matrix(self.target.position_m, self.target.velocity_m_s)
        turned = np.swapaxes(axes, -1, -2)
        position = rotate_vectors(turned, self.follower.position_m - self.target.position_m)
        velocity = rotate_vectors(turned, self.follower.velocity_m_s - self.target.velocity_m_s)
        return position, velocity - np.cross(rate_rad_s, position)

    @property
    def position_m(self) -> np.ndarray:
        """Position of the follower (time, 3) in the target's rtn axes [m]."""
        return self._relative[0]

    @property
    def velocity_m_s(self) -> np.ndarray:
        """Velocity of the follower (time, 3) relative to the target's rotating rtn axes [m/s]."""
        return self._relative[1]


class TargetedFlight:
    """The flight of a scenario's follower about a target, as its motion flies it."""

    def __init__(self, scenario: Scenario, target: str) -> None:
        self._scenario, self._target = scenario, target
        self._body: Body = scenario.bodies[-1]

    def find_states(self, time_s: np.ndarray) -> States:
        """Return the states at instants (time,) since the start [s]; at an impulse, those after it."""
        return States(self._scenario, self._target, time_s)

    @cached_property
    def _commands(self) -> list[tuple[float, float, Vector, Any]]:
        """Impulses and burns of the run: start [s], delta-v [m/s], direction of any length, and its axes."""
        bodies, time = self._scenario.bodies, self._scenario.time
        flight, plan = find_flight(self._body, bodies, time.start_utc), find_plan(self._body, bodies, time.start_utc)
        listed: list[tuple[float, float, Vector, Any]] = []
        if flight is not None or plan is not None:
            commands = flight.list_commands(time.duration_s) if flight is not None else plan.impulses if plan else ()
            listed = [(push.time_s, push.size_m_s, _as_vector(push.delta_v_m_s), "chief_rtn") for push in commands]
        for maneuver in getattr(self._body.motion, "maneuvers", ()):
            vector = maneuver.delta_v_m_s if isinstance(maneuver, Impulse) else maneuver.acceleration_m_s2
            along = vector or maneuver.thrust_n
            listed.append((maneuver.edges_s[0], maneuver.size_m_s, along, maneuver.axes))
        return sorted(push for push in listed if push[0] <= time.duration_s)

    @cached_property
    def pushes(self) -> tuple[Push, ...]:
        """Impulses and burns of the run, those of guidance among them; held legs are left out."""
        if not self._commands:
            return ()
        time_s = np.array([command[0] for command in self._commands])
        states, scenario = self.find_states(time_s), self._scenario
        approached, chief_name = states.target, get_chief_name(self._body.motion)
        if chief_name is not None:  # which need not be the target that was asked about
            approached = Chief(scenario.bodies, chief_name).states(Epochs(scenario.time.start_utc, time_s))
        pushes = []
        for k, (at_s, size_m_s, along, axes) in enumerate(self._commands):
            about = approached if axes == "chief_rtn" else states.follower
            place = about.position_m[k].tolist(), about.velocity_m_s[k].tolist()
            pushes.append(Push(at_s, size_m_s, np.array(rotate_to_inertial(along, axes, *place))))
        return tuple(pushes)

    @property
    def delta_v_m_s(self) -> float:
        """Delta-v of the run [m/s]: impulses, burns, and the held legs of the plan, to the end of the run."""
        time = self._scenario.time
        plan = find_plan(self._body, self._scenario.bodies, time.start_utc)
        sizes_m_s = [command[1] for command in self._commands]
        if plan is not None:
            sizes_m_s += [
                plan.continuous_between_m_s(begin_s, end_s)
                for leg, begin_s, end_s in plan.stretches(time.duration_s)
                if leg.acceleration_m_s2 is not None and end_s > begin_s
            ]
        return math.fsum(sizes_m_s)

    @property
    def largest_impulse_m_s(self) -> float:
        """Greatest delta-v of one impulse or burn [m/s]."""
        return max((command[1] for command in self._commands), default=0.0)

    @property
    def last_impulse_s(self) -> float:
        """Instant of the last impulse or burn [s]; 0 without any."""
        return max((command[0] for command in self._commands), default=0.0)

    @property
    def plume_angle_deg(self) -> float:
        """Least angle between the exhaust and the direction to the target, over impulses and burns [deg]."""
        pushes = [push for push in self.pushes if push.size_m_s > _LEAST_M_S]
        if not pushes:
            return 180.0
        states = self.find_states(np.array([push.time_s for push in pushes]))
        away_m = states.follower.position_m - states.target.position_m
        # The exhaust is opposite to the push, and the target opposite to `away_m`.
        return float(np.min(angle_rad(np.array([push.direction for push in pushes]), away_m))) / units.DEG


class FlightQuantity(NamedTuple):
    """A quantity of a flight: unit, meaning, and its values (time,) or (time, 3) from states; None for one of a run."""

    unit: str
    meaning: str
    of_states: Callable[[States], np.ndarray] | None


def _norm(vectors: np.ndarray) -> np.ndarray:
    length: np.ndarray = np.linalg.norm(vectors, axis=-1)
    return length


def _find_range_rate_m_s(states: States) -> np.ndarray:
    rate: np.ndarray = np.sum(states.position_m * states.velocity_m_s, axis=-1) / _norm(states.position_m)
    return rate


def _find_phase_angle_deg(states: States) -> np.ndarray:
    places = states.target.position_m, states.follower.position_m, sun_position_m(states.epochs)
    return phase_angle_rad(*places) / units.DEG


def _find_flight_path_deg(states: States) -> np.ndarray:
    return 90.0 - angle_rad(states.follower.position_m, states.follower.velocity_m_s) / units.DEG


def _find_semi_major_axis_km(states: States) -> np.ndarray:
    r_m, v_m_s = _norm(states.follower.position_m), _norm(states.follower.velocity_m_s)
    size: np.ndarray = 1.0 / (2.0 / r_m - v_m_s**2 / units.EARTH_GM_M3_S2) / units.KM
    return size


def _find_momentum(states: States) -> np.ndarray:
    return np.cross(states.follower.position_m, states.follower.velocity_m_s)


def _find_eccentricity(states: States) -> np.ndarray:
    r_m, v_m_s = states.follower.position_m, states.follower.velocity_m_s
    pull = np.cross(v_m_s, _find_momentum(states)) / units.EARTH_GM_M3_S2
    return _norm(pull - r_m / _norm(r_m)[:, None])


def _find_inclination_deg(states: States) -> np.ndarray:
    return angle_rad(_find_momentum(states), np.array([0.0, 0.0, 1.0])) / units.DEG


def _element(number: int) -> Callable[[States], np.ndarray]:
    def find(states: States) -> np.ndarray:
        column: np.ndarray = relative_elements_from_states(states.target, states.follower)[:, number]
        return column

    return find


_ELEMENTS = ("a", "lambda", "ex", "ey", "ix", "iy")

QUANTITIES: dict[str, FlightQuantity] = {
    "position_m": FlightQuantity("m", "Position in the target's rtn axes; three numbers.", lambda at: at.position_m),
    "velocity_m_s": FlightQuantity(
        "m/s", "Velocity relative to the target's rotating rtn axes; three numbers.", lambda at: at.velocity_m_s
    ),
    "radial_m": FlightQuantity("m", "Radial position.", lambda at: at.position_m[:, 0]),
    "along_track_m": FlightQuantity("m", "Along-track position.", lambda at: at.position_m[:, 1]),
    "cross_track_m": FlightQuantity("m", "Cross-track position.", lambda at: at.position_m[:, 2]),
    "range_m": FlightQuantity(
        "m", "Distance between the origins of follower and target.", lambda at: _norm(at.position_m)
    ),
    "range_rate_m_s": FlightQuantity("m/s", "Rate of that distance, positive while it grows.", _find_range_rate_m_s),
    "speed_m_s": FlightQuantity(
        "m/s", "Magnitude of the velocity relative to the target.", lambda at: _norm(at.velocity_m_s)
    ),
    "phase_angle_deg": FlightQuantity(
        "deg", "Angle at the target between Sun and follower: 0 with the Sun behind the lidar.", _find_phase_angle_deg
    ),
    **{
        f"delta_{name}_m": FlightQuantity(
            "m", f"Osculating relative element delta {name}, times the semi-major axis.", _element(k)
        )
        for k, name in enumerate(_ELEMENTS)
    },
    "radius_km": FlightQuantity(
        "km",
        "Distance of the follower from the Earth's centre.",
        lambda at: _norm(at.follower.position_m) / units.KM,
    ),
    "semi_major_axis_km": FlightQuantity("km", "Osculating semi-major axis of the follower.", _find_semi_major_axis_km),
    "eccentricity": FlightQuantity("", "Osculating eccentricity of the follower.", _find_eccentricity),
    "inclination_deg": FlightQuantity(
        "deg", "Osculating inclination of the follower to the GCRS equator.", _find_inclination_deg
    ),
    "flight_path_angle_deg": FlightQuantity(
        "deg", "Angle of the follower's velocity above the local horizontal.", _find_flight_path_deg
    ),
    "delta_v_m_s": FlightQuantity("m/s", "Delta-v of the run: impulses, burns, and held legs of a plan.", None),
    "largest_impulse_m_s": FlightQuantity("m/s", "Greatest delta-v of one impulse or burn.", None),
    "last_impulse_s": FlightQuantity("s", "Instant of the last impulse or burn.", None),
    "plume_angle_deg": FlightQuantity(
        "deg", "Least angle between exhaust and the direction to the target, over impulses and burns.", None
    ),
}
VECTORS = ("position_m", "velocity_m_s")


def _as_vector(array: np.ndarray) -> Vector:
    x, y, z = array.tolist()
    return x, y, z
