"""Messages of a frame for viewers that speak the Foxglove protocol, one function for each topic.

Frame ids are the names of the axes. The root is the axes that do not rotate at the first target, or else at the follower:
at the distance of an orbit the float32 of a viewer resolves metres. Stamps are start_utc + time_s since 1970.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Sequence
from functools import partial
from typing import Any

import numpy as np

from rso_lidar.export import CompanionCamera, PinholeCamera, fit_camera, to_stamp_ns
from rso_lidar.picture import Shape, Stretch, rerun_scene
from rso_lidar.pose import quaternion_xyzw
from rso_lidar.records import Frame
from rso_lidar.units import NS_PER_S

LIDAR = "lidar"  # frame id of what the sensor says
_GREY = 0.68
_POINT = np.dtype([("x", "<f4"), ("y", "<f4"), ("z", "<f4"), ("intensity", "<f4")])
_ANGLES = ("demand", "actual", "measured")
PTU_SCHEMA = {
    "title": "rso_lidar.PtuAngles",
    "type": "object",
    "properties": {
        "timestamp": {"type": "object", "properties": {"sec": {"type": "integer"}, "nsec": {"type": "integer"}}},
        **{f"{axis}_{name}_rad": {"type": "number"} for axis in ("pan", "tilt") for name in _ANGLES},
    },
}


def stamp_of(frame: Frame) -> int:
    """Return the time of a frame [ns since 1970]."""
    return to_stamp_ns(frame.source.start_utc, frame.time_s)


def _timestamp(frame: Frame) -> Any:
    from foxglove.messages import Timestamp

    return Timestamp(*divmod(stamp_of(frame), NS_PER_S))


def write_transforms(frame: Frame) -> Any:
    """Return the pose of all axes in their parents, without the inertial root."""
    from foxglove.messages import FrameTransform, FrameTransforms, Quaternion, Vector3

    poses, world = frame.truth.poses, rerun_scene.world_of(frame)
    transforms = []
    for name, path in rerun_scene.paths_of(poses, world).items():
        if name == world:
            continue
        parent_from = poses.pose(path[-2], name)
        x, y, z = (float(value) for value in parent_from.translation)
        qx, qy, qz, qw = (float(value) for value in quaternion_xyzw(parent_from.rotation))
        transforms.append(
            FrameTransform(
                timestamp=_timestamp(frame),
                parent_frame_id=path[-2],
                child_frame_id=name,
                translation=Vector3(x=x, y=y, z=z),
                rotation=Quaternion(x=qx, y=qy, z=qz, w=qw),
            )
        )
    return FrameTransforms(transforms=transforms)


def write_range(frame: Frame) -> Any:
    """Return the slant range [m] as an image of float32, NaN where nothing came back."""
    return _write_image(frame, LIDAR, np.ascontiguousarray(frame.range_m, dtype="<f4"), "32FC1")


def write_intensity(frame: Frame) -> Any:
    """Return the intensity [counts] as an image of 16 bits."""
    return _write_image(frame, LIDAR, np.ascontiguousarray(frame.intensity_counts, dtype="<u2"), "mono16")


def _write_image(frame: Frame, axes: str, image: np.ndarray, encoding: str) -> Any:
    """Return an image message.

    Parameters
    ----------
    image : (row, col) values, or (row, col, rgb) bytes
    """
    from foxglove.messages import RawImage

    n_rows, n_cols = image.shape[:2]
    return RawImage(
        timestamp=_timestamp(frame),
        frame_id=axes,
        width=n_cols,
        height=n_rows,
        encoding=encoding,
        step=image.strides[0],
        data=image.tobytes(),
    )


def write_points(frame: Frame) -> Any:
    """Return the points that came back, in lidar axes [m], with intensity [counts]."""
    from foxglove.messages import (
        PackedElementField,
        PackedElementFieldNumericType,
        PointCloud,
        Pose,
        Quaternion,
        Vector3,
    )

    valid = frame.valid
    points = np.zeros(int(valid.sum()), dtype=_POINT)
    for axis, name in enumerate("xyz"):
        points[name] = frame.points_m[..., axis][valid]
    points["intensity"] = frame.intensity_counts[valid]
    kind = PackedElementFieldNumericType.Float32
    fields = [PackedElementField(name=name, offset=4 * k, type=kind) for k, name in enumerate(_POINT.names or ())]
    return PointCloud(
        timestamp=_timestamp(frame),
        frame_id=LIDAR,
        pose=Pose(position=Vector3(), orientation=Quaternion(w=1.0)),
        point_stride=_POINT.itemsize,
        fields=fields,
        data=points.tobytes(),
    )


def write_calibration(frame: Frame) -> Any:
    """Return the camera that fits the lines of sight, with which a viewer places images in space."""
    return _write_pinhole(frame, LIDAR, fit_camera(frame.line_of_sight), frame.valid.shape)


def _write_pinhole(frame: Frame, axes: str, camera: PinholeCamera, shape: tuple[int, ...]) -> Any:
    """Return the calibration of a camera, whose images have rows and columns as in `shape`."""
    from foxglove.messages import CameraCalibration

    n_rows, n_cols = shape[:2]
    projection = [*camera.matrix[:3], 0.0, *camera.matrix[3:6], 0.0, *camera.matrix[6:], 0.0]
    return CameraCalibration(
        timestamp=_timestamp(frame),
        frame_id=axes,
        width=n_cols,
        height=n_rows,
        distortion_model="plumb_bob",
        D=list(camera.distortion),
        K=list(camera.matrix),
        R=[1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0],
        P=projection,
    )


def write_targets(frame: Frame, shapes: Sequence[Shape]) -> Any:
    """Return the true meshes, each in its own axes, as binary STL."""
    from foxglove.messages import Color, ModelPrimitive, Pose, Quaternion, SceneEntity, SceneUpdate, Vector3

    return SceneUpdate(
        entities=[
            SceneEntity(
                timestamp=_timestamp(frame),
                frame_id=shape.axes,
                id=shape.axes,
                frame_locked=True,
                models=[
                    ModelPrimitive(
                        pose=Pose(position=Vector3(), orientation=Quaternion(w=1.0)),
                        scale=Vector3(x=1.0, y=1.0, z=1.0),
                        color=Color(r=_GREY, g=_GREY, b=_GREY, a=1.0),
                        override_color=True,
                        media_type="model/stl",
                        data=write_stl(shape),
                    )
                ],
            )
            for shape in shapes
        ]
    )


def write_stl(shape: Shape) -> bytes:
    """Return the facets of a shape as binary STL: a header of 80 bytes, their number, and 50 bytes for each."""
    facets = np.zeros(len(shape.corners_m), dtype=[("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("more", "<u2")])
    facets["normal"], facets["corners"] = shape.normals, shape.corners_m
    return b"rso_lidar, metres".ljust(80) + len(facets).to_bytes(4, "little") + facets.tobytes()


def write_ptu(frame: Frame) -> bytes | None:
    """Return demanded, true and measured angles of the PTU as JSON; None without one."""
    angles = frame.truth.pointing
    if angles is None:
        return None
    sec, nsec = divmod(stamp_of(frame), NS_PER_S)
    tree: dict[str, Any] = {"timestamp": {"sec": sec, "nsec": nsec}}
    for name in _ANGLES:
        pan, tilt = (float(value) for value in getattr(angles, f"{name}_rad"))
        tree |= {f"pan_{name}_rad": pan, f"tilt_{name}_rad": tilt}
    return json.dumps(tree).encode()


def write_log(frame: Frame) -> Any:
    """Return a line about the frame."""
    from foxglove.messages import Log, LogLevel

    seen = frame.range_m[frame.valid]
    said = f", median {float(np.median(seen)):.2f} m" if seen.size else ""
    message = f"frame {frame.index}: {frame.time_s:g} s, {seen.size:,} returns{said}"
    return Log(timestamp=_timestamp(frame), level=LogLevel.Info, message=message, name="rso_lidar")


WRITERS: dict[str, Callable[[Frame], Any]] = {
    "/tf": write_transforms,
    "/lidar/range": write_range,
    "/lidar/intensity": write_intensity,
    "/lidar/points": write_points,
    "/lidar/calibration": write_calibration,
    "/ptu": write_ptu,
    "/log": write_log,
}
TARGETS = "/targets"
IMAGE, CALIBRATION = "image", "calibration"  # after the name of a camera in its topics


def list_camera_writers(cameras: Iterable[CompanionCamera]) -> dict[str, Callable[[Frame], Any]]:
    """List the functions that write the messages of cameras beside the lidar, by topic."""
    writers: dict[str, Callable[[Frame], Any]] = {}
    for camera in cameras:
        writers[f"/{camera.name}/{IMAGE}"] = partial(write_camera_image, camera)
        writers[f"/{camera.name}/{CALIBRATION}"] = partial(write_camera_calibration, camera)
    return writers


def write_camera_image(camera: CompanionCamera, frame: Frame) -> Any:
    """Return the image of a camera: the counts of a single band, or colours stretched for a screen of three.

    Of another number of bands it has the first. The protocol has no colours of 16 bits.
    """
    counts = frame.camera[camera.name].intensity_counts
    if len(camera.bands) == 3:
        stretched = Stretch.of(camera.name, frame).paint(counts)
        return _write_image(frame, camera.name, np.ascontiguousarray(stretched), "rgb8")
    return _write_image(frame, camera.name, np.ascontiguousarray(counts[..., 0], dtype="<u2"), "mono16")


def write_camera_calibration(camera: CompanionCamera, frame: Frame) -> Any:
    """Return the pinhole of a camera, with its distortion."""
    return _write_pinhole(frame, camera.name, camera.pinhole, camera.shape)
