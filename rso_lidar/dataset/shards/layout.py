"""The arrays of a shard: one labelled frame as records, which state dims, dtype, unit and meaning of each array."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np

from rso_lidar.records import ArraySpec, Record, array, specs

VARIABLE_PREFIX = "variable."  # of the arrays that hold drawn numbers
_CAMERA_PREFIX = "camera."  # of the arrays of images of cameras: camera.<name>.<field>
_COMPONENTS = {  # names of the components of the vectors that a view draws
    "view.offset_fraction": ("right", "down"),
    "view.attitude": ("x", "y", "z", "w"),
    "view.spin_axis": ("x", "y", "z"),
    "view.sun": ("x", "y", "z"),
}


@dataclass(frozen=True, eq=False, repr=False)
class LabelledImage(Record):
    """Image of one camera beside the lidar with its labels. Its arrays in a shard are named ``camera.<name>.<field>``.

    Poses are camera_from_target of the sample's target at the laser flash; pixels are labelled at the middle of the
    exposure, by the part that covers most of each. In a frame without a target, labels of the target are NaN, -1 or 0.
    """

    intensity_counts: np.ndarray = array("row col band", "u2", "count", "output of the sensor, black level included")
    target: np.ndarray = array(
        "row col",
        "i1",
        "1",
        "0 for the sample's target, from 1 for other bodies of the scenario in their order, -1 for sky",
    )
    part: np.ndarray = array("row col", "i2", "1", "index of the part among those of its model, -1 for sky")
    part_class_id: np.ndarray = array("row col", "i1", "1", "index of the common part class, -1 for sky")
    range_m: np.ndarray = array("row col", "f4", "m", "true slant distance from the camera's origin, NaN for sky")
    filled_fraction: np.ndarray = array("row col", "f4", "1", "share of the pixel's area that is on a body")
    exposure_s: np.ndarray = array("", "f8", "s", "time for which each row was exposed")
    start_s: np.ndarray = array("", "f8", "s", "start of the first row's exposure after the laser flash")
    position_m: np.ndarray = array("xyz", "f8", "m", "position of the target's origin in camera axes")
    quaternion_xyzw: np.ndarray = array("quaternion", "f8", "1", "unit quaternion camera_from_target, w at least 0")
    target_pixels: np.ndarray = array("", "i4", "1", "pixels on the target")
    target_electrons: np.ndarray = array("", "f4", "1", "expected electrons of the pixels on the target, in all bands")
    full_pixels: np.ndarray = array("", "i4", "1", "pixels with a full well or the greatest count, in any band")
    box_px: np.ndarray = array(
        "edge", "i2", "1", "first row and column, last row and column of the pixels on the target; -1 where none is"
    )
    intrinsics_px: np.ndarray = array(
        "intrinsic",
        "f8",
        "1",
        "fx, fy, cx, cy in pixels, (0, 0) the centre of the first; distortion is in the sensor file",
    )
    electrons: np.ndarray | None = array(
        "row col band",
        "f4",
        "1",
        "expected electrons in each pixel, before the full well and without noise",
        optional=True,
    )
    keypoint_px: np.ndarray | None = array(
        "keypoint row_col",
        "f4",
        "1",
        "row and column of the keypoints of the target's model at the middle of the exposure, in the order of "
        "`model_keypoints`, 0 at the centre of the first pixel; NaN outside the field and beyond the last",
        optional=True,
    )
    keypoint_visibility: np.ndarray | None = array(
        "keypoint", "u1", "1", "0 outside the field or beyond the last, 1 hidden by a body, 2 visible", optional=True
    )
    normal: np.ndarray | None = array(
        "row col xyz",
        "f4",
        "1",
        "unit normal of what is in the pixel, toward the camera, in camera axes; NaN for sky",
        optional=True,
    )


@dataclass(frozen=True, eq=False, repr=False)
class LabelledFrame(Record):
    """One frame of a dataset with its labels. In a shard every array has the frame as its first dimension.

    Part classes are those that all models share. Poses are lidar_from_target of the sample's target; other bodies are
    clutter. In a frame without a target, labels of the target are NaN, -1 or 0. `camera` holds the images of the cameras
    beside the lidar, by name.
    """

    range_m: np.ndarray = array("row col", "f4", "m", "measured slant range, NaN where nothing was reported")
    intensity_counts: np.ndarray = array("row col", "u2", "count", "fitted pulse amplitude, 0 where none")
    saturated: np.ndarray = array("row col", "u1", "1", "1 where the amplitude clipped")
    true_range_m: np.ndarray = array("row col", "f4", "m", "true range of the brightest cluster, NaN for sky")
    photons: np.ndarray = array("row col", "f4", "1", "expected photons of the whole pixel")
    target: np.ndarray = array(
        "row col",
        "i1",
        "1",
        "0 for the sample's target, from 1 for other bodies of the scenario in their order, -1 for sky",
    )
    part: np.ndarray = array("row col", "i2", "1", "index of the part among those of its model, -1 for sky")
    part_class_id: np.ndarray = array("row col", "i1", "1", "index of the common part class, -1 for sky")
    sample: np.ndarray = array("", "i8", "1", "number of the sample in the dataset")
    step: np.ndarray = array("", "i4", "1", "place of the frame in the sequence of its sample")
    draw: np.ndarray = array("", "i2", "1", "number of the noise draw: same poses and mean light, other noise")
    seed: np.ndarray = array("", "i8", "1", "random seed of the scenario")
    frame_number: np.ndarray = array("", "i4", "1", "number of the frame in the scenario")
    time_s: np.ndarray = array("", "f8", "s", "seconds since the start of the scenario")
    class_id: np.ndarray = array("", "i2", "1", "index of the class, -1 without a target")
    model_id: np.ndarray = array("", "i2", "1", "index of the model, -1 without a target")
    sensor_id: np.ndarray = array("", "i2", "1", "index of the sensor")
    present: np.ndarray = array("", "u1", "1", "1 where the sample has a target")
    position_m: np.ndarray = array("xyz", "f8", "m", "position of the target's origin in lidar axes")
    quaternion_xyzw: np.ndarray = array("quaternion", "f8", "1", "unit quaternion lidar_from_target, w at least 0")
    range_to_target_m: np.ndarray = array("", "f8", "m", "distance of the target's origin from the lidar")
    lit_pixels: np.ndarray = array("", "i4", "1", "pixels with at least one expected photon of the target")
    reporting_pixels: np.ndarray = array("", "i4", "1", "pixels that reported the target")
    total_photons: np.ndarray = array("", "f4", "1", "expected photons of the target in all pixels")
    box_px: np.ndarray = array(
        "edge", "i2", "1", "first row and column, last row and column of the lit pixels; -1 where none is"
    )
    intrinsics_px: np.ndarray = array(
        "intrinsic",
        "f8",
        "1",
        "fx, fy, cx, cy in pixels, (0, 0) the centre of the first; distortion is in the sensor file",
    )
    sun_direction: np.ndarray = array("xyz", "f4", "1", "unit vector to the Sun in lidar axes, NaN where there is none")
    part_light_fraction: np.ndarray = array("part_class", "f4", "1", "share of the target's light by common part class")
    detection_probability: np.ndarray | None = array(
        "row col", "f4", "1", "probability that the pixel reports what is there, 0 for sky", optional=True
    )
    range_sigma_m: np.ndarray | None = array(
        "row col", "f4", "m", "standard deviation of the range that it reports, NaN for sky", optional=True
    )
    part_visibility: np.ndarray | None = array(
        "part_class", "f4", "1", "share of the class's silhouette that is not hidden, NaN if absent", optional=True
    )
    oversampled_range_m: np.ndarray | None = array(
        "fine_row fine_col", "f4", "m", "true range on the finer grid of rays, NaN for sky", optional=True
    )
    oversampled_photons: np.ndarray | None = array(
        "fine_row fine_col", "f4", "1", "expected photons on the finer grid of rays", optional=True
    )
    keypoint_px: np.ndarray | None = array(
        "keypoint row_col",
        "f4",
        "1",
        "row and column of the keypoints of the target's model, in the order of `model_keypoints`, 0 at the centre of the "
        "first pixel; NaN outside the field and beyond the last",
        optional=True,
    )
    keypoint_visibility: np.ndarray | None = array(
        "keypoint", "u1", "1", "0 outside the field or beyond the last, 1 hidden by a body, 2 visible", optional=True
    )
    normal: np.ndarray | None = array(
        "row col xyz",
        "f4",
        "1",
        "unit normal of what is in the pixel, toward the lidar, in lidar axes; NaN for sky",
        optional=True,
    )
    camera: Mapping[str, LabelledImage] = dataclasses.field(default_factory=dict)


def list_entries(frame: LabelledFrame) -> dict[str, np.ndarray]:
    """Return what a shard holds of a frame, by the names of its arrays."""
    entries = {name: getattr(frame, name) for name in specs(LabelledFrame)}
    for camera, image in frame.camera.items():
        entries |= {name_camera_array(camera, field): getattr(image, field) for field in specs(LabelledImage)}
    return {name: entry for name, entry in entries.items() if entry is not None}


def name_camera_array(camera: str, field: str) -> str:
    """Return the name of the array that holds a field of a camera's images."""
    return f"{_CAMERA_PREFIX}{camera}.{field}"


def find_camera(name: str) -> tuple[str, str] | None:
    """Return the camera and the field of an array, or None for an array that is of no camera.

    >>> find_camera("camera.nav.exposure_s"), find_camera("range_m")
    (('nav', 'exposure_s'), None)
    """
    if not name.startswith(_CAMERA_PREFIX):
        return None
    camera, _, field = name.removeprefix(_CAMERA_PREFIX).partition(".")
    return camera, field


def list_cameras(names: Iterable[str]) -> tuple[str, ...]:
    """Return the names of the cameras of which there are arrays among those of a shard, each once."""
    return tuple(dict.fromkeys(place[0] for name in names if (place := find_camera(name)) is not None))


def describe_array(name: str) -> ArraySpec:
    """Return dims, dtype, unit and meaning of an array of a shard, without its first dimension, the frame."""
    if name.startswith(VARIABLE_PREFIX):
        place = name.removeprefix(VARIABLE_PREFIX)
        vector, _, number = place.rpartition(".")
        if vector in _COMPONENTS:
            place = f"{vector}, component {_COMPONENTS[vector][int(number)]}"
        return ArraySpec((), np.dtype("f8"), "1", f"drawn value of {place}, in its unit; NaN where it is not drawn")
    if (of_camera := find_camera(name)) is not None:
        return specs(LabelledImage)[of_camera[1]]
    return specs(LabelledFrame)[name]


def is_image(name: str) -> bool:
    """Return whether an array holds an image of each frame, and not a number or a short vector."""
    return len(describe_array(name).dims) > 1
