"""A scenario seen without casting a ray: geometry at a few hundred epochs, for the description and the advice."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from rso_lidar import motion
from rso_lidar.errors import RsoLidarWarning
from rso_lidar.optics import Laser
from rso_lidar.orbit import Epochs
from rso_lidar.pose import PoseTree
from rso_lidar.records import BodyState, Truth
from rso_lidar.scenario.mission.mission import Mission
from rso_lidar.scene import Surface
from rso_lidar.units import SPEED_OF_LIGHT_M_S

_MOST_EPOCHS = 400


@dataclass(frozen=True, eq=False)
class Sight:
    """How the lidar sees one target, over the epochs of a preview."""

    name: str
    range_m: np.ndarray
    range_rate_m_s: np.ndarray
    off_boresight_rad: np.ndarray
    in_field: np.ndarray  # its origin
    wholly: np.ndarray  # whether all of its hull is in the field
    across_m: np.ndarray  # the wider side of its hull as it is seen
    radius_m: float
    nearest_m: np.ndarray  # of the target's hull
    farthest_m: np.ndarray

    @property
    def light_time_m(self) -> float:
        """Return by how much light time would change the range at most [m]: range rate times range over c."""
        return float(np.abs(self.range_rate_m_s * self.range_m).max()) / SPEED_OF_LIGHT_M_S


@dataclass(frozen=True, eq=False)
class Preview:
    """Geometry of a scenario at some of its epochs, the first and the last among them."""

    epochs: Epochs
    sights: tuple[Sight, ...]
    truth: Truth  # with ptu and lidar
    warned: tuple[str, ...]
    behind_rad: np.ndarray | None  # (time) of the PTU from what it is asked; None: as if it stood on that

    @property
    def time_s(self) -> np.ndarray:
        """Return the instants (time) [s]."""
        return self.epochs.time_s

    @property
    def states(self) -> Mapping[str, BodyState]:
        """Return the inertial states of the bodies, batched."""
        return self.truth.states


def preview(mission: Mission) -> Preview:
    """Return the geometry of a scenario at up to 400 of its frames."""
    numbers = np.unique(np.linspace(0, mission.time.n_frames - 1, _MOST_EPOCHS).round().astype(int))
    epochs = mission.epochs(numbers)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", RsoLidarWarning)
        _ = mission.surfaces  # what building them warns of is told too
        with mission.placed():
            course = motion.truth(
                mission.bodies, epochs, local=mission.local, sun_direction=mission.world.sun_direction
            )
            angles, rates, behind_rad = _pointed(mission, course)
    poses = motion.with_lidar(course.poses, mission.ptu, angles, rates, mission.lidar.mount)
    receivers = [mission.instrument.at(float(time_s)).receiver for time_s in epochs.time_s]
    half_field = np.array([receiver.field_edge for receiver in receivers])
    sights = [
        _sight(target.name, mission.surfaces_of(number), poses, half_field, len(epochs))
        for number, target in enumerate(mission.target)
    ]
    lines = dict.fromkeys(str(entry.message) for entry in caught if issubclass(entry.category, RsoLidarWarning))
    return Preview(epochs, tuple(sights), replace(course, poses=poses), tuple(lines), behind_rad)


def _pointed(mission: Mission, course: Truth) -> tuple[np.ndarray, np.ndarray, np.ndarray | None]:
    """Return pan and tilt (time, 2) [rad] of the PTU, their rates [rad/s], and how far (time) they are behind what is asked.

    The drive's own where the run is short enough to step it in a second or two; else its demand, and None for the last.
    """
    ptu = mission.pan_tilt
    if ptu is None:
        return np.zeros((len(course.time_s), 2)), np.zeros((len(course.time_s), 2)), None
    asked = motion.asked(ptu, mission.bodies, course)
    if course.time_s[-1] > ptu.response.preview_limit_s:
        return asked, np.zeros_like(asked), None
    world: dict[str, Any] = {"local": mission.local, "sun_direction": mission.world.sun_direction}
    angles, rates = motion.driven(ptu, mission.bodies, course, mission.time.start_utc, **world)
    missed = np.remainder(angles - asked + np.pi, 2.0 * np.pi) - np.pi
    missed[:, 0] *= np.cos(asked[:, 1])
    return angles, rates, np.hypot(missed[:, 0], missed[:, 1])


def _sight(name: str, surfaces: Sequence[Surface], poses: PoseTree, half_field: np.ndarray, n_epochs: int) -> Sight:
    """Return how the lidar sees one target, of one surface or several; `half_field` (time, 2) is the lens's edge."""
    seen, _ = poses.place("lidar", name)
    # The rate of range, without the PTU's own turning, which changes no distance.
    link = poses.link("follower", name)
    apart = np.linalg.norm(link.translation_m, axis=-1, keepdims=True)
    toward = link.translation_m / np.where(apart > 0.0, apart, np.inf)  # at the target itself there is no rate
    rate = np.einsum("...i,...i->...", toward, link.velocity_m_s)
    range_m = np.linalg.norm(seen, axis=-1)
    with np.errstate(divide="ignore", invalid="ignore"):
        tangent = np.abs(seen[..., :2] / seen[..., 2:])
    in_field = (seen[..., 2] > 0) & np.all(tangent <= half_field, axis=-1)
    off = np.arctan2(np.hypot(seen[..., 0], seen[..., 1]), seen[..., 2])
    hull, radius_m = [], 0.0  # (point, time, xyz) in lidar axes
    for surface in surfaces:
        seat = poses.pose("lidar", surface.name)
        hull += [np.broadcast_to(seat.apply(point), (n_epochs, 3)) for point in surface.outline]
        hinge_m = np.linalg.norm(np.atleast_2d(poses.pose(name, surface.name).translation), axis=1).max()
        radius_m = max(radius_m, float(hinge_m) + surface.radius_m)
    there = np.stack(hull)
    ahead = there[..., 2] > 0.0
    tangents = np.abs(there[..., :2]) / np.where(ahead, there[..., 2], 1.0)[..., None]
    wholly = np.all(ahead & np.all(tangents <= half_field, axis=-1), axis=0)
    across_m = np.ptp(there[..., :2], axis=0).max(axis=-1)
    hull_m = np.linalg.norm(there, axis=-1)
    range_m, rate, off, in_field = (np.broadcast_to(values, (n_epochs,)) for values in (range_m, rate, off, in_field))
    return Sight(name, range_m, rate, off, in_field, wholly, across_m, radius_m, hull_m.min(axis=0), hull_m.max(axis=0))


def parallax_share(laser: Laser, range_m: float) -> float:
    """Return the light on the boresight at `range_m` [m] over that of a laser at the lens: 0 where its beam passes by."""
    right, down, ahead = laser.offset_m
    middle = float(laser.density(np.array(0.0), np.array(0.0)))
    if laser.offset is None or middle == 0.0:
        return 1.0
    depth = range_m - ahead
    return float(laser.density(np.array(-right / depth), np.array(-down / depth))) / middle if depth > 0.0 else 0.0
