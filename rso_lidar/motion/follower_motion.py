"""True motion of the follower at the instants of its sensors' samples: what gyros, accelerometers and trackers measure."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING

import numpy as np

from rso_lidar import units
from rso_lidar.errors import PropagationError, suppress_warnings
from rso_lidar.kernels import kernel, packed
from rso_lidar.motion.bodies.body import Body
from rso_lidar.motion.bodies.orbital_axes import find_moon_m
from rso_lidar.motion.course import Course
from rso_lidar.motion.dynamics.commands import CommandedFlight
from rso_lidar.motion.dynamics.flight import Flight, StateSpaceModel
from rso_lidar.motion.motions.fmu_motion import FmuMotion
from rso_lidar.motion.motions.motion import get_chief_name
from rso_lidar.motion.motions.placement import PlacedMotion
from rso_lidar.motion.motions.state_space import StateSpace
from rso_lidar.motion.proximity import find_flight, find_plan
from rso_lidar.orbit import Epochs
from rso_lidar.pose import ROOT, cross, length, quaternion_xyzw, rotate_vectors
from rso_lidar.records import BodyMotion, BodyState, MotionQuantity, Truth

if TYPE_CHECKING:
    from scipy.spatial.transform import Rotation

_OF_ALL = frozenset({MotionQuantity.PLACE, MotionQuantity.SKY})  # what needs the truth of all bodies
_STEP_S = 1e-3  # of a difference quotient: rounding of 1e-12 becomes 1e-9 of the derivative


class FollowerMotion:
    """True motion of the follower of a run, for its sensors.

    The specific force is the acceleration by thrust: in a proximity operation that of its plan, with a state-space motion
    f(t, x, u) - f(t, x, 0), so that a body without inputs is in free fall, and with an FMU what it states. Dynamics that
    have drag or light pressure too can state it (`specific_force`). For any other motion in a local world, which has no
    gravitation, it is the acceleration. In orbit, under commands to an FMU that does not state it, it is NaN. Otherwise it
    is zero: drag, light pressure and impulses are left out.

    Parameters
    ----------
    course : of the run
    """

    def __init__(self, course: Course) -> None:
        self._course = course
        self._follower = course.bodies[-1]
        motion = self._follower.motion
        self._rigid = motion if isinstance(motion, StateSpace) and motion.turns else None
        self._ahead = (np.empty(0), np.empty((0, 3, 3)), np.empty((0, 3)))  # instants, axes and rates of the chief

    def find(self, time_s: np.ndarray, reads: frozenset[str], list_ahead: Callable[[], np.ndarray]) -> BodyMotion:
        """Compute the motion at some instants.

        Parameters
        ----------
        time_s : (time) instants, ascending, none after the present of the course [s]
        reads : what is read of it, as `MotionQuantity`
        list_ahead : lists later instants [s], for which the axes of a chief without commands are computed ahead

        Returns
        -------
        motion at these instants; `targets` holds the other bodies, and `dynamics` the state-space models
        """
        course, follower = self._course, self._follower
        flights = course.flights_of(follower)
        truth = None
        if self._rigid is None or reads & _OF_ALL:
            truth = course.moving(time_s, for_body=None if reads & _OF_ALL else follower)
        shape = (len(time_s), 3)
        if self._rigid is not None:
            matrix, rate, force = self._follow_rigid_body(self._rigid, time_s, flights["motion"], list_ahead)
        else:
            assert truth is not None
            link = truth.poses.link(ROOT, follower.name)
            matrix = np.broadcast_to(link.matrix, (*shape, 3))
            rate = np.broadcast_to(link.angular_velocity_rad_s, shape)
            thrust = _find_specific_force(course, truth, time_s, flights)
            force = rotate_vectors(np.swapaxes(matrix, -1, -2), thrust)
        state = truth.states[follower.name] if truth else None
        unread = np.full((len(time_s), 4), np.nan)
        return BodyMotion(
            time_s,
            unread[:, :3] if state is None else np.broadcast_to(state.position_m, shape),
            unread[:, :3] if state is None else np.broadcast_to(state.velocity_m_s, shape),
            quaternion_xyzw(_as_rotation(matrix)) if MotionQuantity.ATTITUDE in reads else unread,
            rate,
            force,
            angular_acceleration_rad_s2=(
                _find_angular_acceleration(course, follower, time_s, flights, rate)
                if MotionQuantity.ANGULAR_ACCELERATION in reads
                else None
            ),
            **(_find_sky(course, truth, time_s) if truth and MotionQuantity.SKY in reads else {}),
            targets=_find_targets(truth, follower) if truth and MotionQuantity.PLACE in reads else {},
            dynamics=_list_dynamics(time_s, flights) if MotionQuantity.DYNAMICS in reads else {},
        )

    def _follow_rigid_body(
        self, motion: StateSpace, time_s: np.ndarray, flight: CommandedFlight, list_ahead: Callable[[], np.ndarray]
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Read attitude, angular velocity and specific force from the state of a rigid body.

        Returns
        -------
        inertial_from_body (time, 3, 3), angular velocity (time, 3) [rad/s] and specific force (time, 3) [m/s2] in body axes
        """
        axes_from_body, rate = motion.find_matrices(flight, time_s)
        assert isinstance(flight, Flight)
        force = flight.specific_force(time_s)
        if motion.relative_to is None:
            return axes_from_body, rate, rotate_vectors(np.swapaxes(axes_from_body, -1, -2), force)
        inertial_from_axes, turning = self._find_chief_axes(motion.relative_to, time_s, list_ahead)
        inertial: tuple[np.ndarray, np.ndarray, np.ndarray] = leave_turning_axes(
            inertial_from_axes, turning, packed(axes_from_body), packed(rate), packed(force)
        )
        return inertial

    def _find_chief_axes(
        self, name: str, time_s: np.ndarray, list_ahead: Callable[[], np.ndarray]
    ) -> tuple[np.ndarray, np.ndarray]:
        """Find inertial_from_rtn (time, 3, 3) of a chief, and its angular velocity (time, 3) in rtn axes [rad/s].

        Without commands to the chief, the axes at coming instants are computed in the same batch and kept.
        """
        known_s, matrix, turning = self._ahead
        rows = known_s.searchsorted(time_s)
        if not len(known_s) or rows[-1] >= len(known_s) or (known_s[rows] != time_s).any():
            is_commanded = any(flown.partition(".")[0] != self._follower.name for flown in self._course.flights)
            known_s = time_s if is_commanded else np.unique(np.concatenate([time_s, list_ahead()]))
            origin = next(body for body in self._course.bodies if body.name == name)
            with suppress_warnings():
                link = self._course.moving(known_s, for_body=origin).poses.link(ROOT, origin.origin)
            matrix = packed(np.broadcast_to(link.matrix, (len(known_s), 3, 3)))
            turning = packed(np.broadcast_to(link.angular_velocity_rad_s, (len(known_s), 3)))
            self._ahead = known_s, matrix, turning
            rows = np.searchsorted(known_s, time_s)
        return matrix[rows], turning[rows]


@kernel
def leave_turning_axes(
    inertial_from_axes: np.ndarray, turning: np.ndarray, axes_from_body: np.ndarray, rate: np.ndarray, force: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Refer the attitude and the angular velocity of a body in turning axes to inertial axes.

    Parameters
    ----------
    inertial_from_axes, turning : (time, 3, 3) of the axes, and their angular velocity (time, 3) in themselves [rad/s]
    axes_from_body, rate : (time, 3, 3), and the angular velocity (time, 3) relative to the axes, in body axes [rad/s]
    force : (time, 3) a vector in the axes

    Returns
    -------
    inertial_from_body (time, 3, 3), angular velocity relative to inertial axes (time, 3) and the vector, both in body axes
    """
    matrix, total, turned = np.empty_like(axes_from_body), np.empty_like(rate), np.empty_like(force)
    for k in range(len(rate)):
        for row in range(3):
            x, y, z = axes_from_body[k, 0, row], axes_from_body[k, 1, row], axes_from_body[k, 2, row]
            total[k, row] = rate[k, row] + (x * turning[k, 0] + y * turning[k, 1] + z * turning[k, 2])
            turned[k, row] = x * force[k, 0] + y * force[k, 1] + z * force[k, 2]
            a, b, c = inertial_from_axes[k, row]
            for column in range(3):
                matrix[k, row, column] = (
                    a * axes_from_body[k, 0, column]
                    + b * axes_from_body[k, 1, column]
                    + c * axes_from_body[k, 2, column]
                )
    return matrix, total, turned


def states_specific_force(follower: Body, *, local: bool) -> bool:
    """Return whether the motion of the follower states its specific force: by dynamics, a plan or free fall.

    A path that is prescribed in orbit does not, because the thrust that holds a body on it is not known.

    Parameters
    ----------
    follower : the body
    local : whether the world is local, without gravitation
    """
    motion = follower.motion
    if isinstance(motion, FmuMotion):
        return local or motion.states_specific_force
    return local or isinstance(motion, StateSpace) or not isinstance(motion, PlacedMotion)


def count_dynamics(follower: Body) -> dict[str, int]:
    """Count the entries of each array in `BodyMotion.dynamics`: states and inputs of the follower's state-space models.

    The outputs of an FMU are place and attitude, and no state of actuators, so an FMU has no entries.

    Parameters
    ----------
    follower : the body

    Returns
    -------
    numbers of entries by the name of the array, such as ``motion.state``
    """
    sizes: dict[str, int] = {}
    for place, model in (("motion", follower.motion), ("attitude", follower.attitude)):
        if isinstance(model, StateSpaceModel):
            sizes |= {f"{place}.state": len(model.initial_state), f"{place}.input": len(model.inputs)}
    return sizes


def _find_sky(course: Course, truth: Truth, time_s: np.ndarray) -> dict[str, np.ndarray]:
    """Find the directions (time, 3) from the follower to Sun, Moon and Earth, and the angular radius (time) of the Earth."""
    shape = (len(time_s), 3)
    if course.is_local:
        has_sun = np.isfinite(truth.sun_direction).all()
        return {"sun_direction": np.broadcast_to(truth.sun_direction, shape)} if has_sun else {}
    position = truth.states[course.bodies[-1].name].position_m
    moon = find_moon_m(course.bodies, Epochs(course.start_utc, time_s)) - position
    distance = length(position)
    return {
        "sun_direction": np.broadcast_to(truth.sun_direction, shape),
        "moon_direction": moon / length(moon)[:, None],
        "earth_direction": -position / distance[:, None],
        "earth_angle_rad": np.arcsin(np.minimum(units.EARTH_RADIUS_M / distance, 1.0)),
    }


def _as_rotation(matrix: np.ndarray) -> Rotation:
    from scipy.spatial.transform import Rotation

    return Rotation.from_matrix(matrix, assume_valid=True)


def _find_specific_force(
    course: Course, truth: Truth, time_s: np.ndarray, flights: Mapping[str, CommandedFlight]
) -> np.ndarray:
    """Find the follower's acceleration without gravitation (time, 3) in inertial axes [m/s2], by flights of its models."""
    motion, flight = course.bodies[-1].motion, flights.get("motion")
    if isinstance(flight, Flight):
        thrust = flight.specific_force(time_s)
    elif isinstance(motion, FmuMotion) and motion.states_specific_force:
        thrust = motion.find_specific_force(flight, time_s)
    elif (flown := find_flight(course.bodies[-1], course.bodies, course.start_utc)) is not None:
        thrust = flown.thrust_m_s2(time_s)
    elif (plan := find_plan(course.bodies[-1], course.bodies, course.start_utc)) is not None:
        thrust = plan.control_m_s2(time_s)
    elif course.is_local:
        return _differentiate(course, lambda at: at.states["follower"].velocity_m_s, time_s)
    else:  # under commands the thrust is unknown, unless the FMU states it
        return np.full((len(time_s), 3), 0.0 if flight is None else np.nan)
    chief = get_chief_name(motion)
    if chief is None:
        return thrust
    origin = next(body.origin for body in course.bodies if body.name == chief)
    return rotate_vectors(np.broadcast_to(truth.poses.link(ROOT, origin).matrix, (len(time_s), 3, 3)), thrust)


def _find_angular_acceleration(
    course: Course, follower: Body, time_s: np.ndarray, flights: Mapping[str, CommandedFlight], rate: np.ndarray
) -> np.ndarray:
    """Find the rate of change of the follower's angular velocity (time, 3) in body axes [rad/s2].

    A state-space model in the rtn axes of a chief gives the rate w_rel relative to them. The angular velocity O of the axes,
    taken as constant in them, turns in body axes: (w_rel + O)' = w_rel' - w_rel x O.

    Parameters
    ----------
    flights : of the follower's models, as ``motion`` and ``attitude``
    rate : angular velocity relative to inertial axes (time, 3), in body axes [rad/s]

    Returns
    -------
    It comes from the dynamics of the attitude where the follower has them, else from a difference quotient over 1 ms
    """
    for place in ("attitude", "motion"):
        flight = flights.get(place)
        if isinstance(flight, Flight) and (entries := flight.model.body_rate_entries) is not None:
            relative = flight(time_s)[:, entries]
            change: np.ndarray = flight.rates(time_s)[:, entries] - cross(relative, rate - relative)
            return change
    return _differentiate(course, lambda at: at.poses.link(ROOT, follower.name).angular_velocity_rad_s, time_s)


def _differentiate(course: Course, read: Callable[[Truth], np.ndarray], time_s: np.ndarray) -> np.ndarray:
    """Differentiate what a truth holds over 1 ms: centrally, or backward under commands and where a motion ends.

    Parameters
    ----------
    read : value (time, 3) of a batch of truths
    time_s : (time) instants [s]
    """

    def values(at_s: np.ndarray) -> np.ndarray:
        return np.broadcast_to(read(course.moving(at_s, for_body=course.bodies[-1])), (len(at_s), 3))

    def quotient(back_s: float, on_s: float) -> np.ndarray:
        before, after = np.maximum(time_s - back_s, 0.0), time_s + on_s
        span_s = np.where(after > before, after - before, np.inf)  # nothing is known before t = 0
        change: np.ndarray = (values(after) - values(before)) / span_s[:, None]
        return change

    if course.flights:
        return quotient(_STEP_S, 0.0)
    try:
        return quotient(0.5 * _STEP_S, 0.5 * _STEP_S)
    except PropagationError:
        return quotient(_STEP_S, 0.0)


def _find_targets(truth: Truth, follower: Body) -> dict[str, BodyState]:
    """Return the states of the other bodies relative to the follower, in inertial axes."""
    here = truth.states[follower.name]
    return {
        name: BodyState(state.position_m - here.position_m, state.velocity_m_s - here.velocity_m_s)
        for name, state in truth.states.items()
        if name != follower.name
    }


def _list_dynamics(time_s: np.ndarray, flights: Mapping[str, CommandedFlight]) -> dict[str, np.ndarray]:
    """Return states and inputs (time, entry) of the follower's state-space models."""
    dynamics = {}
    for place, flight in flights.items():
        if isinstance(flight, Flight):  # as `count_dynamics`
            dynamics[f"{place}.state"], dynamics[f"{place}.input"] = flight(time_s), flight.inputs_at(time_s)
    return dynamics
