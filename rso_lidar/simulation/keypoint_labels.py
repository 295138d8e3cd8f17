"""Labels of keypoints: where the named points of all targets are in an image, and which of them are visible."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rso_lidar import scene, units
from rso_lidar.imaging import Camera
from rso_lidar.optics import Receiver
from rso_lidar.records import CameraImage, Truth
from rso_lidar.scenario import Scenario
from rso_lidar.scene import Surface

# Share of the radius of a target by which a surface may lie before a point that still counts as visible: a quarter of a
# pixel of a craft that is 100 pixels across. A choice, with which the corners of most panels count from both sides.
TOLERANCE = 5e-3
OUTSIDE, HIDDEN, VISIBLE = 0, 1, 2  # as the flags of COCO


def label_keypoints(
    scenario: Scenario, truth: Truth, lens: Receiver, surfaces: Sequence[Surface] | None = None
) -> dict[str, np.ndarray]:
    """Label the keypoints of all targets in the image of one sensor.

    A point is visible if it is in the field and no surface crosses the ray to it, except within the last 5 thousandths of
    the radius of its target.

    Parameters
    ----------
    scenario : with its targets
    truth : poses of all bodies, with the sensor at the "lidar" axes
    lens : lens and focal plane of the sensor
    surfaces : of all targets (None: those at the laser's wavelength; the geometry is the same)

    Returns
    -------
    dict of ndarray
        Fields of `Labels` and `CameraLabels`; empty if no target has keypoints.
    """
    points, tolerance_m = place_keypoints(scenario, truth)
    if not len(points):
        return {}
    range_m = np.linalg.norm(points, axis=1)
    ahead = points[:, 2] > 0.0
    depth_m = np.where(ahead, points[:, 2], 1.0)
    x, y = points[:, 0] / depth_m, points[:, 1] / depth_m
    # Distortion is only one-to-one within the field.
    edge_x, edge_y = lens.field_edge * (1.0 + 1e-9)
    may_show = ahead & (np.abs(x) <= edge_x) & (np.abs(y) <= edge_y)
    col, row = lens.image_of(np.where(may_show, x, 0.0), np.where(may_show, y, 0.0))
    is_inside = may_show & (col >= 0.0) & (col <= lens.n_cols) & (row >= 0.0) & (row <= lens.n_rows)
    visibility = np.zeros(len(points), np.uint8)
    asked = np.flatnonzero(is_inside)
    reach_m = np.maximum(range_m[asked] - tolerance_m[asked], 0.0)
    direction = points[asked] / range_m[asked, None]
    is_hidden = scene.find_hidden(direction, surfaces or scenario.surfaces, truth, reach_m)
    visibility[asked] = np.where(is_hidden, HIDDEN, VISIBLE)
    place_px = np.stack([row, col], axis=1) - 0.5
    return {
        "keypoint_px": np.where(is_inside[:, None], place_px, np.nan),
        "keypoint_range_m": range_m,
        "keypoint_visibility": visibility,
    }


def place_keypoints(scenario: Scenario, truth: Truth) -> tuple[np.ndarray, np.ndarray]:
    """Place the keypoints of all targets in lidar axes.

    Parameters
    ----------
    scenario : with its targets
    truth : poses of all bodies and of their hinges

    Returns
    -------
    (keypoint, xyz) positions in lidar axes [m], and (keypoint) tolerances of their visibility [m].
    """
    places: list[np.ndarray] = []
    tolerances: list[float] = []
    for number, (target, entry) in enumerate(zip(scenario.target, scenario.source.targets, strict=True)):
        if not entry.keypoints:
            continue
        carriers = {part: joint for joint in target.joints for part in joint.parts}
        tolerance_m = TOLERANCE * max(surface.radius_m for surface in scenario.surfaces_of(number))
        for point in entry.keypoints:
            joint = carriers.get(point.part or "")
            axes = target.name if joint is None else target.joint_axes(joint)
            position_m = np.array(point.position_m) - (0.0 if joint is None else np.array(joint.position_m))
            origin_m, turn = truth.poses.place("lidar", axes)
            places.append(origin_m + turn @ position_m)
            tolerances.append(tolerance_m)
    return np.array(places).reshape(-1, 3), np.array(tolerances)


def label_camera_keypoints(
    scenario: Scenario, truth: Truth, camera: Camera, image: CameraImage
) -> dict[str, np.ndarray]:
    """Label the keypoints of all targets in the image of a camera, at the middle of its exposure.

    Parameters
    ----------
    scenario : with its targets
    truth : poses of all bodies at the flash
    camera : the camera
    image : its image, which tells its exposure

    Returns
    -------
    dict of ndarray
        Fields of `CameraLabels`; empty if no target has keypoints.
    """
    middle_s = camera.start_ms * units.MS + 0.5 * (float(image.exposure_s) + camera.rows_s)
    return label_keypoints(scenario, truth.view_from(camera.name).extrapolate(middle_s), camera.lens)
