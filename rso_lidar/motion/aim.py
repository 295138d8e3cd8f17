"""The pointing of the lidar: demanded angles of the PTU, and the axes of PTU and lidar on the follower."""

from __future__ import annotations

import datetime
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cache, lru_cache
from typing import TYPE_CHECKING

import numpy as np

from rso_lidar import units
from rso_lidar.errors import suppress_warnings
from rso_lidar.motion.bodies.body import Body
from rso_lidar.motion.gimbal.demand import Demand, DemandCurve, TrackPoint, find_pan_tilt
from rso_lidar.motion.gimbal.ptu import Ptu, ptu_link, sense, start, step
from rso_lidar.motion.mount import Mount
from rso_lidar.motion.truth import Flights, truth
from rso_lidar.orbit.epochs import Epochs
from rso_lidar.pose import Link, PoseTree, pose, rotate_vectors
from rso_lidar.records import Command, PtuAngles, Truth

if TYPE_CHECKING:
    from scipy.spatial.transform import Rotation


@cache
def lidar_from_ptu() -> Rotation:
    """Return the rotation from PTU axes (x forward, y left, z up) to lidar axes (x right, y down, z ahead).

    Returns
    -------
    the constant rotation lidar_from_ptu.
    """
    from scipy.spatial.transform import Rotation

    return Rotation.from_quat([0.5, -0.5, 0.5, 0.5])  # [[0, -1, 0], [0, 0, -1], [1, 0, 0]]


def make_demand(
    ptu: Ptu,
    bodies: Sequence[Body],
    start_utc: datetime.datetime,
    end_s: float,
    *,
    local: bool,
    sun_direction: Sequence[float] | None = None,
    flights: Flights | None = None,
) -> Demand:
    """Make the demanded pan and tilt of a scenario as a function of time.

    With commanded bodies (`flights`) the demand must not be evaluated beyond the next flash.

    Parameters
    ----------
    ptu : the pan-tilt unit.
    bodies : all bodies.
    start_utc : start of the run.
    end_s : last instant at which the demand is evaluated [s].
    local : whether the world is local, without an Earth.
    sun_direction : direction to the Sun of a local world; None for none.
    flights : of commanded state-space models; None for none.

    Returns
    -------
    demand ``(time,) -> (time, 2)``: pan and tilt [rad] at times since `start_utc` [s].
    """
    if not isinstance(ptu.point, TrackPoint):
        return ptu.point.demand

    def directions(time_s: np.ndarray) -> np.ndarray:
        with suppress_warnings():
            epochs = Epochs(start_utc, time_s)
            there = truth(bodies, epochs, local=local, sun_direction=sun_direction, flights=flights, rates=False)
            return _find_target_vectors(ptu, bodies, there)

    return _make_following_demand(directions) if flights else DemandCurve(directions, end_s)


def _make_following_demand(directions: Callable[[np.ndarray], np.ndarray]) -> Demand:
    """Make a demand that evaluates the directions at each instant; pan is continuous from call to call."""
    last_rad = 0.0

    def follow(time_s: np.ndarray) -> np.ndarray:
        nonlocal last_rad
        pan, tilt = find_pan_tilt(directions(time_s))
        pan = np.unwrap(np.append(last_rad, pan))[1:]
        last_rad = float(pan[-1])
        return np.stack([pan, tilt], axis=-1)

    return follow


def compute_demand(ptu: Ptu, bodies: Sequence[Body], course: Truth) -> np.ndarray:
    """Compute the demanded pan and tilt of a scenario at the epochs of a truth.

    Parameters
    ----------
    ptu : the pan-tilt unit.
    bodies : all bodies.
    course : truth of the bodies.

    Returns
    -------
    demanded pan and tilt (time, 2) [rad].
    """
    if not isinstance(ptu.point, TrackPoint):
        return ptu.point.demand(course.time_s)
    return np.stack(find_pan_tilt(_find_target_vectors(ptu, bodies, course)), axis=-1)


def simulate_drive(
    ptu: Ptu,
    bodies: Sequence[Body],
    course: Truth,
    start_utc: datetime.datetime,
    *,
    local: bool,
    sun_direction: Sequence[float] | None = None,
) -> tuple[np.ndarray, np.ndarray]:
    """Simulate the drive from t = 0 to the epochs of a truth, with misalignment but without jitter.

    It takes about a second for each million ticks of 1 ms.

    Parameters
    ----------
    ptu : the pan-tilt unit.
    bodies : all bodies.
    course : truth of the bodies.
    start_utc : start of the run.
    local : whether the world is local, without an Earth.
    sun_direction : direction to the Sun of a local world; None for none.

    Returns
    -------
    pan and tilt (time, 2) [rad], and their rates (time, 2) [rad/s].
    """
    times = course.time_s
    follow = make_demand(ptu, bodies, start_utc, float(times[-1]), local=local, sun_direction=sun_direction)
    state = start(ptu, follow)
    rows = []
    for time_s in times.tolist():
        state = step(ptu, state, follow, time_s)
        rows.append((*state.angle_rad, *state.rate_rad_s))
    angles, rates = np.hsplit(np.array(rows), 2)
    return angles + np.array(ptu.errors.misalignment_deg) * units.DEG, rates


def _find_target_vectors(ptu: Ptu, bodies: Sequence[Body], course: Truth) -> np.ndarray:
    """Compute the vectors from the PTU to its target.

    Parameters
    ----------
    ptu : the pan-tilt unit, which tracks.
    bodies : all bodies.
    course : truth of the bodies.

    Returns
    -------
    vectors (time, 3) in the axes of the mount [m].
    """
    assert isinstance(ptu.point, TrackPoint)
    origins = {body.name: body.origin for body in bodies}
    from_follower, _ = course.poses.place("follower", origins.get(ptu.point.at, ptu.point.at))
    toward = rotate_vectors(ptu.mount.rotation.inv(), from_follower - np.asarray(ptu.mount.position_m))
    return np.broadcast_to(toward, (len(course.time_s), 3))


class Aim:
    """The pointing of the lidar from flash to flash, the same in open and in closed loop."""

    def __init__(
        self,
        ptu: Ptu | None,
        mount: Mount,
        bodies: Sequence[Body],
        start_utc: datetime.datetime,
        end_s: float,
        *,
        local: bool,
        sun_direction: Sequence[float] | None = None,
        flights: Flights | None = None,
    ) -> None:
        """Start at t = 0, with the PTU at rest on its demand.

        Parameters
        ----------
        ptu : the pan-tilt unit; None for a lidar fixed to the follower.
        mount : of the lidar.
        bodies, start_utc, local, sun_direction, flights : as for `make_demand`.
        end_s : time of the last flash [s].
        """
        self._ptu, self._mount = ptu, mount
        if ptu is not None:
            self._demand = make_demand(
                ptu, bodies, start_utc, end_s, local=local, sun_direction=sun_direction, flights=flights
            )
            self._state = self._before = start(ptu, self._demand)
            self._command: Command | None = None
            self._off_rad = np.zeros(2)  # jitter and misalignment at the last flash

    def at(self, course: Truth, command: Command | None, rng: np.random.Generator) -> Truth:
        """Step the PTU to the next flash, and add the axes of PTU and lidar to its truth.

        Parameters
        ----------
        course : truth of the bodies at the next flash.
        command : given at the previous flash.
        rng : random generator of this flash, for jitter and encoder noise.

        Returns
        -------
        the same truth with the axes of PTU and lidar, and the angles of the PTU.
        """
        pointing: PtuAngles | None = None
        actual_rad = rate_rad_s = np.zeros(2)
        if self._ptu is not None:
            self._before, self._command = self._state, command
            self._state = step(self._ptu, self._state, self._demand, until_s=course.time_s, command=command)
            pointing = sense(self._ptu, self._state, rng)
            actual_rad, rate_rad_s = pointing.actual_rad, pointing.rate_rad_s
            self._off_rad = actual_rad - np.array(self._state.angle_rad)
        poses = add_lidar(course.poses, self._ptu, actual_rad, rate_rad_s, self._mount)
        return Truth(course.time_s, poses, course.states, course.sun_direction, pointing, course.sunlit)

    def during(self, course: Truth) -> Truth:
        """Step the PTU through instants about the flash of the last call of `at`, under the same command and jitter.

        If the last of them is after the flash, the next flash goes on from there, and its command holds from there on.

        Parameters
        ----------
        course : truth of the bodies at these instants, ascending (time), all after the flash before.

        Returns
        -------
        the same truths with the axes of PTU and lidar.
        """
        angles = rates = np.zeros((len(course.time_s), 2))
        if self._ptu is not None:
            state, rows = self._before, []
            for time_s in course.time_s.tolist():
                state = step(self._ptu, state, self._demand, max(time_s, state.time_s), self._command)
                rows.append((*state.angle_rad, *state.rate_rad_s))
            angles, rates = np.hsplit(np.array(rows), 2)
            angles = angles + self._off_rad
            if state.time_s > self._state.time_s:
                self._state = state
        poses = add_lidar(course.poses, self._ptu, angles, rates, self._mount)
        return replace(course, poses=poses)


def add_lidar(
    poses: PoseTree, ptu: Ptu | None, pan_tilt_rad: np.ndarray, rate_rad_s: np.ndarray, mount: Mount
) -> PoseTree:
    """Add the axes of PTU and lidar to a tree, under the follower.

    lidar_from_target = lidar_from_ptu * ptu_from_follower * follower_from_inertial * inertial_from_target
    (Fuller et al., eq. 5).

    Parameters
    ----------
    poses : tree with the axes of the follower.
    ptu : the pan-tilt unit; None for a lidar fixed to the follower.
    pan_tilt_rad : pan and tilt (…, 2) [rad].
    rate_rad_s : their rates (…, 2) [rad/s].
    mount : of the lidar.

    Returns
    -------
    tree with the axes of the PTU, if there is one, and of the lidar.
    """
    carrier = "follower"
    if ptu is not None:
        angles = np.moveaxis(pan_tilt_rad, -1, 0)
        link = ptu_link(ptu.mount, angles[0], angles[1], *np.moveaxis(rate_rad_s, -1, 0))
        poses, carrier = poses.with_node("ptu", "follower", link), "ptu"
    return poses.with_node("lidar", carrier, _lidar_link(mount))


@lru_cache(maxsize=16)
def _lidar_link(mount: Mount) -> Link:
    """Return the link of the lidar to its carrier."""
    return mount.link * Link.still(pose(rotation=lidar_from_ptu().inv()))
