"""True motion of the follower at the instants of its sensors' samples: what gyros, accelerometers and trackers measure."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING

import numpy as np

from rso_lidar import units
from rso_lidar.errors import PropagationError
from rso_lidar.motion.bodies.body import Body
from rso_lidar.motion.course import Course
from rso_lidar.motion.dynamics.flight import Flight, StateSpaceModel
from rso_lidar.motion.motions.motion import chief_of
from rso_lidar.motion.proximity import find_plan
from rso_lidar.orbit import moon_position_m
from rso_lidar.orbit.epochs import Epochs
from rso_lidar.pose import ROOT, length, quaternion_xyzw, rotate_vectors
from rso_lidar.records import BodyMotion, BodyState, Truth

if TYPE_CHECKING:
    from scipy.spatial.transform import Rotation

_HALF_S = 0.5e-3  # half the step of a difference quotient: 1e-12 of rounding over it is 1e-9 of a rate


def find_follower_motion(course: Course, time_s: np.ndarray) -> BodyMotion:
    """Compute the true motion of the follower for its sensors.

    The specific force is the acceleration by thrust: in a proximity operation that of its plan, with a state-space motion
    f(t, x, u) - f(t, x, 0), so that a body without inputs is in free fall. In a local world, which has no gravitation, it is
    the acceleration. Otherwise it is zero: drag, light pressure and impulses are left out.

    Parameters
    ----------
    course : of the run, at an instant that is not before the samples.
    time_s : (time) instants, ascending [s].

    Returns
    -------
    motion at these instants; `targets` holds those that orbit or stand, and `dynamics` the state-space models.
    """
    truth, follower = course.moving(time_s), course.bodies[-1]
    link = truth.poses.link(ROOT, follower.name)
    matrix = np.broadcast_to(link.matrix, (len(time_s), 3, 3))
    body_from_inertial = np.swapaxes(matrix, -1, -2)
    rate = np.broadcast_to(link.angular_velocity_rad_s, (len(time_s), 3))
    state = truth.states[follower.name]
    flights = course.flights_of(follower)
    force = _find_specific_force(course, truth, time_s, flights)
    sky: dict[str, np.ndarray] = {}
    if not course.is_local:
        moon = moon_position_m(Epochs(course.start_utc, time_s)) - state.position_m
        distance = length(state.position_m)
        sky = {
            "sun_direction": np.broadcast_to(truth.sun_direction, (len(time_s), 3)),
            "moon_direction": moon / length(moon)[:, None],
            "earth_direction": -state.position_m / distance[:, None],
            "earth_angle_rad": np.arcsin(np.minimum(units.EARTH_RADIUS_M / distance, 1.0)),
        }
    elif np.isfinite(truth.sun_direction).all():
        sky = {"sun_direction": np.broadcast_to(truth.sun_direction, (len(time_s), 3))}
    return BodyMotion(
        time_s,
        np.broadcast_to(state.position_m, (len(time_s), 3)),
        np.broadcast_to(state.velocity_m_s, (len(time_s), 3)),
        quaternion_xyzw(_as_rotation(matrix)),
        rate,
        rotate_vectors(body_from_inertial, force),
        angular_acceleration_rad_s2=_find_angular_acceleration(course, follower, time_s, flights),
        **sky,
        targets=_find_targets(truth, follower),
        dynamics=_list_dynamics(time_s, flights),
    )


def _as_rotation(matrix: np.ndarray) -> Rotation:
    from scipy.spatial.transform import Rotation

    return Rotation.from_matrix(matrix, assume_valid=True)


def _find_specific_force(course: Course, truth: Truth, time_s: np.ndarray, flights: Mapping[str, Flight]) -> np.ndarray:
    """Find the acceleration of the follower without gravitation (time, 3) in inertial axes [m/s2].

    Parameters
    ----------
    course : of the run.
    truth : batch at the instants.
    time_s : (time) instants [s].
    flights : of the follower's state-space models.
    """
    motion = course.bodies[-1].motion
    if isinstance(motion, StateSpaceModel):
        thrust = flights["motion"].input_rates(time_s)[:, 3:6]
    elif (plan := find_plan(course.bodies[-1], course.bodies, course.start_utc)) is not None:
        thrust = plan.control_m_s2(time_s)
    elif course.is_local:
        return _differentiate(course, lambda at: at.states["follower"].velocity_m_s, time_s)
    else:
        return np.zeros((len(time_s), 3))
    chief = chief_of(motion)
    if chief is None:
        return thrust
    origin = next(body.origin for body in course.bodies if body.name == chief)
    return rotate_vectors(np.broadcast_to(truth.poses.link(ROOT, origin).matrix, (len(time_s), 3, 3)), thrust)


def _find_angular_acceleration(
    course: Course, follower: Body, time_s: np.ndarray, flights: Mapping[str, Flight]
) -> np.ndarray | None:
    """Find the rate of change of the follower's angular velocity (time, 3) in body axes [rad/s2].

    Parameters
    ----------
    course : of the run.
    follower : the body.
    time_s : (time) instants [s].
    flights : of the follower's state-space models.

    Returns
    -------
    It comes from the dynamics of the attitude where the follower has them; without commands it is a difference quotient.
    None if neither is known.
    """
    for place, model in (("attitude", follower.attitude), ("motion", follower.motion)):
        if isinstance(model, StateSpaceModel) and (entries := model.body_rate_entries) is not None:
            return flights[place].rates(time_s)[:, entries]
    if course.flights:
        return None
    return _differentiate(course, lambda at: at.poses.link(ROOT, follower.name).angular_velocity_rad_s, time_s)


def _differentiate(course: Course, read: Callable[[Truth], np.ndarray], time_s: np.ndarray) -> np.ndarray:
    """Differentiate what a truth holds by central differences over 1 ms, one-sided at the start and where it ends.

    Parameters
    ----------
    course : of the run, without commands.
    read : value (time, 3) of a batch of truths.
    time_s : (time) instants [s].
    """
    before, after = np.maximum(time_s - _HALF_S, 0.0), time_s + _HALF_S

    def values(at_s: np.ndarray) -> np.ndarray:
        return np.broadcast_to(read(course.moving(at_s)), (len(at_s), 3))

    try:
        late = values(after)
    except PropagationError:  # a motion that ends with the run
        after = time_s
        late = values(after)
    change: np.ndarray = (late - values(before)) / (after - before)[:, None]
    return change


def _find_targets(truth: Truth, follower: Body) -> dict[str, BodyState]:
    """Return the states of the other bodies relative to the follower, in inertial axes."""
    here = truth.states[follower.name]
    return {
        name: BodyState(state.position_m - here.position_m, state.velocity_m_s - here.velocity_m_s)
        for name, state in truth.states.items()
        if name != follower.name
    }


def _list_dynamics(time_s: np.ndarray, flights: Mapping[str, Flight]) -> dict[str, np.ndarray]:
    """Return states and inputs (time, entry) of the follower's state-space models."""
    found = {}
    for place, flight in flights.items():
        found[f"{place}.state"], found[f"{place}.input"] = flight(time_s), flight.inputs_at(time_s)
    return found
