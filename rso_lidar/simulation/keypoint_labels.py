"""Labels of keypoints: where the named points of all targets are in an image, and which of them are visible."""

from __future__ import annotations

import numpy as np

from rso_lidar import scene, units
from rso_lidar.imaging import Camera
from rso_lidar.optics import Receiver
from rso_lidar.records import CameraImage, Truth
from rso_lidar.scenario import Scenario

# Share of the radius of a target by which a surface may lie before a point that still counts as visible: a quarter of a
# pixel of a craft that is 100 pixels across. A choice, with which the corners of most panels count from both sides.
TOLERANCE = 5e-3
HIDDEN, VISIBLE = 1, 2  # the flags of COCO, whose 0 is outside the field


def label_keypoints(scenario: Scenario, truth: Truth, lens: Receiver) -> dict[str, np.ndarray]:
    """Label the keypoints of all targets in the image of one sensor.

    A point is visible if it is in the field and no surface crosses the ray to it, except within the last 5 thousandths of
    the radius of its target. The sensor is at the "lidar" axes of the truth.

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
    is_hidden = scene.find_hidden(direction, scenario.surfaces, truth, reach_m)
    visibility[asked] = np.where(is_hidden, HIDDEN, VISIBLE)
    place_px = np.stack([row, col], axis=1) - 0.5
    return {
        "keypoint_px": np.where(is_inside[:, None], place_px, np.nan),
        "keypoint_range_m": range_m,
        "keypoint_visibility": visibility,
    }


def place_keypoints(scenario: Scenario, truth: Truth) -> tuple[np.ndarray, np.ndarray]:
    """Return the keypoints of all targets (keypoint, xyz) in lidar axes [m], and tolerances of their visibility [m]."""
    groups = scenario.carried_points
    count = sum(len(group.place) for group in groups)
    places_m, tolerance_m = np.empty((count, 3)), np.empty(count)
    for group in groups:
        origin_m, turn = truth.poses.place("lidar", group.axes)
        places_m[group.place] = origin_m + group.position_m @ turn.T
        tolerance_m[group.place] = TOLERANCE * group.radius_m
    return places_m, tolerance_m


def label_camera_keypoints(
    scenario: Scenario, truth: Truth, camera: Camera, image: CameraImage
) -> dict[str, np.ndarray]:
    """Label the keypoints of all targets in the image of a camera, at the middle of its exposure, as `label_keypoints`."""
    return label_keypoints(scenario, view_from_camera(truth, camera, image), camera.lens)


def view_from_camera(truth: Truth, camera: Camera, image: CameraImage) -> Truth:
    """Return the truth at the middle of the exposure of an image, with the camera at the "lidar" axes."""
    middle_s = camera.start_ms * units.MS + 0.5 * (float(image.exposure_s) + camera.rows_s)
    return truth.view_from(camera.name).extrapolate(middle_s)
