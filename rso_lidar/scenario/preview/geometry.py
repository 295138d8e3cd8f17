"""Geometry of a mission at a few hundred of its epochs, computed without casting rays."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from rso_lidar import motion
from rso_lidar.errors import collect_warnings
from rso_lidar.motion import simulate_drive
from rso_lidar.optics import Laser
from rso_lidar.orbit import Epochs
from rso_lidar.pose import PoseTree
from rso_lidar.records import BodyState, Truth
from rso_lidar.scenario.mission.mission import Mission
from rso_lidar.scene import Surface
from rso_lidar.units import SPEED_OF_LIGHT_M_S

_MOST_EPOCHS = 400


@dataclass(frozen=True, eq=False)
class TargetGeometry:
    """Geometry of one target as the lidar sees it, at the epochs (time) of a preview.

    `range_m`, `range_rate_m_s`, `off_boresight_rad` and `in_field` are those of the target's origin. `all_in_field` states
    whether its whole hull is in the field. `across_m` is the wider side of the projected hull, `nearest_m` and
    `farthest_m` are the ranges of the hull's nearest and farthest points. `radius_m` is that of the bounding sphere.
    """

    name: str
    range_m: np.ndarray
    range_rate_m_s: np.ndarray
    off_boresight_rad: np.ndarray
    in_field: np.ndarray
    all_in_field: np.ndarray
    across_m: np.ndarray
    radius_m: float
    nearest_m: np.ndarray
    farthest_m: np.ndarray

    @property
    def light_time_m(self) -> float:
        """Greatest change of range that light time would cause [m]: range rate times range over c."""
        return float(np.abs(self.range_rate_m_s * self.range_m).max()) / SPEED_OF_LIGHT_M_S


@dataclass(frozen=True, eq=False)
class Preview:
    """Geometry of a mission at some of its epochs, the first and the last among them.

    `truth` is a batch that includes the PTU and the lidar. `warnings` are the messages of the warnings that building it
    raised. `pointing_lag_rad` (time) is the angle between the PTU's demand and its actual direction. It is None where the
    drive was not simulated and the PTU is taken to stand on its demand.
    """

    epochs: Epochs
    targets: tuple[TargetGeometry, ...]
    truth: Truth
    warnings: tuple[str, ...]
    pointing_lag_rad: np.ndarray | None

    @property
    def time_s(self) -> np.ndarray:
        """Times of the epochs (time) [s since start_utc]."""
        return self.epochs.time_s

    @property
    def states(self) -> Mapping[str, BodyState]:
        """Inertial states of the bodies, batched over the epochs."""
        return self.truth.states


def preview_mission(mission: Mission, most_epochs: int = _MOST_EPOCHS) -> Preview:
    """Compute the geometry of a mission at some of its frames, the first and the last among them, without casting rays.

    Parameters
    ----------
    mission : a scenario
    most_epochs : greatest number of frames, spread evenly

    Returns
    -------
    Preview
        Truth and geometry of the targets (time), with the warnings that building the mission raised.

    Raises
    ------
    ScenarioError
        If bodies or files of the mission cannot be built.
    """
    numbers = np.unique(np.linspace(0, mission.time.n_frames - 1, most_epochs).round().astype(int))
    epochs = mission.epochs(numbers)
    with collect_warnings() as lines:
        # Warnings of their construction belong to the preview, even where a flight has built them before.
        _ = mission.build_surfaces() if "surfaces" in vars(mission) else mission.surfaces
        _ = mission.camera_surfaces  # a material that a band of a camera lacks is an error before the run
        with mission.locate_errors():
            course = motion.truth(mission.bodies, epochs, **mission.world.motion_arguments)
            angles, rates, lag_rad = _point_lidar(mission, course)
    poses = motion.add_lidar(course.poses, mission.ptu, angles, rates, mission.lidar.mount)
    receivers = [mission.instrument.at(float(time_s)).receiver for time_s in epochs.time_s]
    half_field = np.array([receiver.field_edge for receiver in receivers])
    targets = [
        _trace_target(target.name, mission.surfaces_of(number), poses, half_field, len(epochs))
        for number, target in enumerate(mission.target)
    ]
    return Preview(epochs, tuple(targets), replace(course, poses=poses), tuple(lines), lag_rad)


def _point_lidar(mission: Mission, course: Truth) -> tuple[np.ndarray, np.ndarray, np.ndarray | None]:
    """Compute pan and tilt (time, 2) [rad] of the PTU, their rates [rad/s], and the pointing lag (time) [rad].

    The drive is simulated where the run is short enough for that to take a second or two. Otherwise the PTU stands on its
    demand, and the lag is None.
    """
    ptu = mission.pan_tilt
    if ptu is None:
        return np.zeros((len(course.time_s), 2)), np.zeros((len(course.time_s), 2)), None
    asked = motion.compute_demand(ptu, mission.bodies, course)
    if course.time_s[-1] > ptu.response.preview_limit_s:
        return asked, np.zeros_like(asked), None
    angles, rates = simulate_drive(
        ptu, mission.bodies, course, mission.time.start_utc, **mission.world.motion_arguments
    )
    missed = np.remainder(angles - asked + np.pi, 2.0 * np.pi) - np.pi
    missed[:, 0] *= np.cos(asked[:, 1])
    return angles, rates, np.hypot(missed[:, 0], missed[:, 1])


def _trace_target(
    name: str, surfaces: Sequence[Surface], poses: PoseTree, half_field: np.ndarray, n_epochs: int
) -> TargetGeometry:
    """Compute how the lidar sees one target through half fields (time, 2), tangents to the right and down."""
    seen, _ = poses.place("lidar", name)
    # The range rate from the follower: the PTU's rotation changes no distance.
    link = poses.link("follower", name)
    apart = np.linalg.norm(link.translation_m, axis=-1, keepdims=True)
    toward = link.translation_m / np.where(apart > 0.0, apart, np.inf)  # the rate is zero at the target itself
    rate = np.einsum("...i,...i->...", toward, link.velocity_m_s)
    range_m = np.linalg.norm(seen, axis=-1)
    in_field = is_in_field(seen, half_field)
    off = np.arctan2(np.hypot(seen[..., 0], seen[..., 1]), seen[..., 2])
    there, radius_m = place_hull(surfaces, poses, "lidar", n_epochs), 0.0
    for surface in surfaces:
        hinge_m = np.linalg.norm(np.atleast_2d(poses.pose(name, surface.name).translation), axis=1).max()
        radius_m = max(radius_m, float(hinge_m) + surface.radius_m)
    wholly = np.all(is_in_field(there, half_field), axis=0)
    across_m = np.ptp(there[..., :2], axis=0).max(axis=-1)
    hull_m = np.linalg.norm(there, axis=-1)
    range_m, rate, off, in_field = (np.broadcast_to(values, (n_epochs,)) for values in (range_m, rate, off, in_field))
    return TargetGeometry(
        name, range_m, rate, off, in_field, wholly, across_m, radius_m, hull_m.min(axis=0), hull_m.max(axis=0)
    )


def place_hull(surfaces: Sequence[Surface], poses: PoseTree, axes: str, n_epochs: int) -> np.ndarray:
    """Place the points of the convex hulls of surfaces in other axes.

    Parameters
    ----------
    surfaces : of a target: its body's, and one for each hinge
    poses : tree with the surfaces and the axes in it, of one epoch or of `n_epochs`
    axes : name of the axes
    n_epochs : number of epochs

    Returns
    -------
    numpy.ndarray
        (point, time, xyz) in those axes [m].
    """
    hull: list[np.ndarray] = []
    for surface in surfaces:
        seat = poses.pose(axes, surface.name)
        hull += [np.broadcast_to(seat.apply(point), (n_epochs, 3)) for point in surface.outline]
    return np.stack(hull)


def is_in_field(place_m: np.ndarray, half_field: np.ndarray) -> np.ndarray:
    """Return whether places are in the field of view (…).

    Parameters
    ----------
    place_m : (…, xyz) in lidar axes [m]
    half_field : (…, 2) tangents of the half field, right and down
    """
    ahead = place_m[..., 2:] > 0.0
    tangent = np.abs(place_m[..., :2]) / np.where(ahead, place_m[..., 2:], 1.0)
    inside: np.ndarray = np.all(ahead & (tangent <= half_field), axis=-1)
    return inside


def boresight_light_fraction(laser: Laser, range_m: float) -> float:
    """Return the light on the boresight at `range_m` [m], relative to a laser at the lens; 0 where the beam misses it."""
    right, down, ahead = laser.offset_m
    middle = float(laser.density(np.array(0.0), np.array(0.0)))
    if laser.offset is None or middle == 0.0:
        return 1.0
    depth = range_m - ahead
    return float(laser.density(np.array(-right / depth), np.array(-down / depth))) / middle if depth > 0.0 else 0.0
