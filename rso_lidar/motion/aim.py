"""The pointing of the lidar: demanded angles of the PTU, and the axes of PTU and lidar on the follower."""

from __future__ import annotations

import datetime
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache, lru_cache
from typing import TYPE_CHECKING

import numpy as np

from rso_lidar import units
from rso_lidar.errors import ScenarioError, suppress_warnings
from rso_lidar.motion.bodies.body import Body
from rso_lidar.motion.body_truth import Flights, truth
from rso_lidar.motion.gimbal.demand import Demand, DemandCurve, TrackPoint, find_pan_tilt
from rso_lidar.motion.gimbal.ptu import Ptu, PtuState, make_ptu_link, sense, start, step
from rso_lidar.motion.mount import Mount
from rso_lidar.orbit import Epochs
from rso_lidar.pose import Link, PoseTree, pose, rotate_vectors
from rso_lidar.records import Command, Truth

if TYPE_CHECKING:
    from scipy.spatial.transform import Rotation


@cache
def lidar_from_ptu() -> Rotation:
    """Return the rotation from PTU axes (x forward, y left, z up) to lidar axes (x right, y down, z ahead)."""
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
    ptu : the pan-tilt unit
    bodies : all bodies
    start_utc : start of the run
    end_s : last instant at which the demand is evaluated [s]
    local : whether the world is local, without an Earth
    sun_direction : direction to the Sun of a local world; None for none
    flights : of commanded state-space models; None for none

    Returns
    -------
    demand ``(time,) -> (time, 2)``: pan and tilt [rad] at times since `start_utc` [s]
    """
    if not isinstance(ptu.point, TrackPoint):
        return ptu.point.demand

    def directions(time_s: np.ndarray) -> np.ndarray:
        with suppress_warnings():
            epochs = Epochs(start_utc, time_s)
            there = truth(bodies, epochs, local=local, sun_direction=sun_direction, flights=flights, rates=False)
            return _find_target_vectors(ptu, bodies, there)

    return FollowingDemand(directions) if flights else DemandCurve(directions, end_s)


class FollowingDemand:
    """A demand that evaluates directions at each instant, for bodies under command.

    Parameters
    ----------
    directions : ``directions(time_s (time,)) -> (time, 3)`` from the PTU to its target, mount axes, any length
    """

    def __init__(self, directions: Callable[[np.ndarray], np.ndarray]) -> None:
        self._directions = directions
        self.pan_rad = 0.0  # of the last call, so that pan is continuous from call to call

    def __call__(self, time_s: np.ndarray) -> np.ndarray:
        """Return pan and tilt (time, 2) [rad] at `time_s` (time,) [s]."""
        pan, tilt = find_pan_tilt(self._directions(time_s))
        pan = np.unwrap(np.append(self.pan_rad, pan))[1:]
        self.pan_rad = float(pan[-1])
        return np.stack([pan, tilt], axis=-1)


def compute_demand(ptu: Ptu, bodies: Sequence[Body], course: Truth) -> np.ndarray:
    """Compute the demanded pan and tilt of a scenario at the epochs of a truth.

    Parameters
    ----------
    ptu : the pan-tilt unit
    bodies : all bodies
    course : truth of the bodies

    Returns
    -------
    demanded pan and tilt (time, 2) [rad]
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
    ptu : the pan-tilt unit
    bodies : all bodies
    course : truth of the bodies
    start_utc : start of the run
    local : whether the world is local, without an Earth
    sun_direction : direction to the Sun of a local world; None for none

    Returns
    -------
    pan and tilt (time, 2) [rad], and their rates (time, 2) [rad/s]
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
    """Compute the vectors (time, 3) [m] from the PTU to its target, in the axes of the mount."""
    assert isinstance(ptu.point, TrackPoint)
    origins = {body.name: body.origin for body in bodies}
    from_follower, _ = course.poses.place("follower", origins.get(ptu.point.at, ptu.point.at))
    toward = rotate_vectors(ptu.mount.rotation.inv(), from_follower - np.asarray(ptu.mount.position_m))
    return np.broadcast_to(toward, (len(course.time_s), 3))


@dataclass(frozen=True, eq=False)
class AimState:
    """State of the pointing, without which a later flash cannot be repeated; empty without a PTU.

    `trail` holds the states of the PTU at the steps that an exposure may reach back to, each with the command from there on,
    and the present state last. `off_rad` is jitter and misalignment at the last flash, `pan_rad` the last pan of a demand
    that follows a body under command.
    """

    trail: tuple[tuple[PtuState, Command | None], ...]
    off_rad: tuple[float, float]
    pan_rad: float


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
        exposure_s: float = 0.0,
        cameras: Mapping[str, tuple[str, Mount]] | None = None,
    ) -> None:
        """Start at t = 0, with the PTU at rest on its demand.

        Parameters
        ----------
        ptu : the pan-tilt unit; None for a lidar fixed to the follower
        mount : of the lidar
        bodies, start_utc, local, sun_direction, flights : as for `make_demand`
        end_s : time of the last flash [s]
        exposure_s : time during which the pulses of a flash are sent [s]
        cameras : carrier ("follower" or "ptu") and mount of each camera beside the lidar, by name
        """
        self._cameras = {name: (carrier, _lidar_link(pose)) for name, (carrier, pose) in (cameras or {}).items()}
        self._ptu, self._mount, self._exposure_s = ptu, mount, exposure_s
        self._trail: list[tuple[PtuState, Command | None]] = []
        self._off_rad = np.zeros(2)  # jitter and misalignment at the last flash
        if ptu is not None:
            self._demand = make_demand(
                ptu, bodies, start_utc, end_s, local=local, sun_direction=sun_direction, flights=flights
            )
            self._state = start(ptu, self._demand)
            self._off_rad = np.array(ptu.errors.misalignment_deg) * units.DEG

    def at(self, course: Truth, command: Command | None, rng: np.random.Generator) -> Truth:
        """Step the PTU to the next flash, and add the axes of PTU and lidar to its truth.

        Parameters
        ----------
        course : truth of the bodies at the next flash
        command : acts from the present instant on
        rng : random generator of this flash, for jitter and encoder noise

        Returns
        -------
        the same truth with the axes of PTU and lidar, and the angles of the PTU
        """
        self.advance(course.time_s, command)
        if self._ptu is None:
            still = np.zeros(2)
            return replace(course, poses=self._add_axes(course.poses, still, still))
        pointing = sense(self._ptu, self._state, rng)
        self._off_rad = pointing.actual_rad - np.array(self._state.angle_rad)
        poses = self._add_axes(course.poses, pointing.actual_rad, pointing.rate_rad_s)
        return replace(course, poses=poses, pointing=pointing)

    def advance(self, time_s: float, command: Command | None) -> None:
        """Step the PTU to an instant.

        Parameters
        ----------
        time_s : the instant [s]; nothing happens if the PTU is there already, after an exposure
        command : acts from the present instant on
        """
        if self._ptu is None or time_s < self._state.time_s:
            return
        self._trail.append((self._state, command))
        self._state = step(self._ptu, self._state, self._demand, until_s=time_s, command=command)
        while len(self._trail) > 1 and self._trail[1][0].time_s <= time_s - self._exposure_s:
            del self._trail[0]

    def now(self, course: Truth) -> Truth:
        """Add the axes of PTU and lidar to the truth at the present instant, with misalignment but without jitter.

        Parameters
        ----------
        course : truth of the bodies

        Returns
        -------
        the same truth with the axes of PTU and lidar
        """
        angle = rate = np.zeros(2)
        if self._ptu is not None:
            angle = np.array(self._state.angle_rad) + np.array(self._ptu.errors.misalignment_deg) * units.DEG
            rate = np.array(self._state.rate_rad_s)
        return replace(course, poses=self._add_axes(course.poses, angle, rate))

    def during(self, course: Truth) -> Truth:
        """Step the PTU through instants about the flash of the last call of `at`, under the same commands and jitter.

        If the last of them is after the flash, the next step goes on from there, and its command acts from there on.

        Parameters
        ----------
        course : truth of the bodies at these instants, ascending (time), all after the flash before

        Returns
        -------
        the same truths with the axes of PTU and lidar
        """
        angles = rates = np.zeros((len(course.time_s), 2))
        if self._ptu is not None:
            (state, command), *later = self._trail
            rows = []
            for time_s in course.time_s.tolist():
                while later and later[0][0].time_s <= time_s:
                    (state, command), *later = later
                state = step(self._ptu, state, self._demand, max(time_s, state.time_s), command)
                rows.append((*state.angle_rad, *state.rate_rad_s))
            angles, rates = np.hsplit(np.array(rows), 2)
            angles = angles + self._off_rad
            if state.time_s > self._state.time_s:
                self._state = state
        return replace(course, poses=self._add_axes(course.poses, angles, rates))

    def _add_axes(self, poses: PoseTree, angle_rad: np.ndarray, rate_rad_s: np.ndarray) -> PoseTree:
        """Add the axes of PTU, lidar and cameras, for pan and tilt (…, 2) [rad] and their rates [rad/s]."""
        poses = add_lidar(poses, self._ptu, angle_rad, rate_rad_s, self._mount)
        for name, (carrier, link) in self._cameras.items():
            poses = poses.with_node(name, carrier, link)
        return poses

    def save(self) -> AimState:
        """Return the present state, from which `restore` goes on."""
        if self._ptu is None:
            return AimState((), (0.0, 0.0), 0.0)
        pan, tilt = self._off_rad.tolist()
        pan_rad = self._demand.pan_rad if isinstance(self._demand, FollowingDemand) else 0.0
        return AimState((*self._trail, (self._state, None)), (pan, tilt), pan_rad)

    def restore(self, state: AimState) -> None:
        """Go on from a saved state.

        Parameters
        ----------
        state : from `save`, of the pointing of the same PTU

        Raises
        ------
        ScenarioError
            If only one of the two has a PTU
        """
        if (self._ptu is None) != (not state.trail):
            raise ScenarioError(
                "restore: the state and the scenario do not both have a PTU; give a state of this scenario"
            )
        if self._ptu is None:
            return
        *self._trail, (self._state, _) = state.trail
        self._off_rad = np.array(state.off_rad)
        if isinstance(self._demand, FollowingDemand):
            self._demand.pan_rad = state.pan_rad


def add_lidar(
    poses: PoseTree, ptu: Ptu | None, pan_tilt_rad: np.ndarray, rate_rad_s: np.ndarray, mount: Mount
) -> PoseTree:
    """Add the axes of PTU and lidar to a tree, under the follower.

    lidar_from_target = lidar_from_ptu * ptu_from_follower * follower_from_inertial * inertial_from_target
    (Fuller et al., eq. 5).

    Parameters
    ----------
    poses : tree with the axes of the follower
    ptu : the pan-tilt unit; None for a lidar fixed to the follower
    pan_tilt_rad : pan and tilt (…, 2) [rad]
    rate_rad_s : their rates (…, 2) [rad/s]
    mount : of the lidar

    Returns
    -------
    tree with the axes of the PTU, if there is one, and of the lidar
    """
    carrier = "follower"
    if ptu is not None:
        angles = np.moveaxis(pan_tilt_rad, -1, 0)
        link = make_ptu_link(ptu.mount, angles[0], angles[1], *np.moveaxis(rate_rad_s, -1, 0))
        poses, carrier = poses.with_node("ptu", "follower", link), "ptu"
    return poses.with_node("lidar", carrier, _lidar_link(mount))


@lru_cache(maxsize=16)
def _lidar_link(mount: Mount) -> Link:
    """Return the link of the lidar to its carrier."""
    return mount.link * Link.still(pose(rotation=lidar_from_ptu().inv()))
