"""MCAP files with ROS 2 messages, for ROS 2 and for viewers; neither rso_lidar nor ROS is needed to read them.

A chunk holds some four frames and is flushed. A kill loses at most one chunk and leaves a file that stream readers
accept. Stamps are start_utc + time_s in whole nanoseconds since 1970. Frame ids are the names of the axes; the lidar's
are the optical axes of REP 103.
"""

from __future__ import annotations

import json
import os
import struct
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from rso_lidar.errors import RecordingError, RunError
from rso_lidar.export.formats.camera import PinholeCamera, fit_camera
from rso_lidar.export.formats.companion_camera import CompanionCamera, check_images, read_cameras
from rso_lidar.export.formats.ros_messages import CAMERA_INFO, DEFINITIONS, IMAGE, POINT_CLOUD, TRANSFORMS
from rso_lidar.export.formats.sensor_messages import list_samples, list_topics, make_mounts, to_word
from rso_lidar.export.formats.trajectory import to_stamp_ns
from rso_lidar.export.layout.target_table import tabulate_targets
from rso_lidar.export.writer.frame_stream import take_first
from rso_lidar.files import check_stream, check_writable, write_atomically
from rso_lidar.pose import quaternion_xyzw
from rso_lidar.records import Frame, SensorSamples, Source
from rso_lidar.units import NS_PER_S

LIDAR, FOLLOWER = "lidar", "follower"  # frame ids of what the lidar says, and of the body that carries the sensors
TOPICS = {
    "/tf": TRANSFORMS,
    "/lidar/camera_info": CAMERA_INFO,
    "/lidar/range": IMAGE,
    "/lidar/intensity": IMAGE,
    "/lidar/points": POINT_CLOUD,
    "/labels/target": IMAGE,
    "/labels/part": IMAGE,
}
_FLOAT32 = 7  # PointField
_FIELDS = ("x", "y", "z", "intensity")
_LAST_S = 2**31 - 1  # of a stamp
_CHUNK_BYTES = 96  # a pixel: four frames of 26 bytes a pixel; each chunk keeps 1.2 kB of memory to the end
_LEAST_BYTES = 2**16


@dataclass(frozen=True)
class MessageSpan:
    """Times of the first and last message [ns since 1970], and the type and the number of messages of each topic."""

    first_ns: int
    last_ns: int
    kinds: Mapping[str, str]
    counts: Mapping[str, int]


class RosStream:
    """The ROS 2 messages of successive frames, as dictionaries: what `write_mcap` writes and a ROS node publishes.

    `kinds` holds the type of each topic, and `definitions` the message definition of each type. A message comes with its
    topic and the time [ns since 1970] at which it is known: of a sample, when flight software receives it.
    """

    def __init__(self, first: Frame, place: str | os.PathLike[str] = "ROS") -> None:
        self._place, self._source = Path(place), first.source
        self._sight, self.camera = first.line_of_sight, fit_camera(first.line_of_sight)
        self._sensors = list_topics(first)
        self._mounts = make_mounts(self._sensors, first.source)
        self._cameras = read_cameras(self._place, first)
        of_cameras = _list_camera_topics(self._cameras)
        self.kinds = TOPICS | of_cameras | {topic.topic: topic.kind for topic in self._sensors}
        self.definitions = DEFINITIONS | {topic.kind: topic.definition for topic in self._sensors if topic.definition}

    def convert_frame(self, frame: Frame) -> Iterator[tuple[str, dict[str, Any], int]]:
        """Yield topic, message and time of each message of a frame, without the samples of other sensors."""
        if frame.line_of_sight is not self._sight and not np.array_equal(frame.line_of_sight, self._sight):
            self._sight, self.camera = frame.line_of_sight, fit_camera(frame.line_of_sight)
        at_ns = self.to_stamp_ns(frame.time_s)
        for topic, message in _messages(frame, at_ns, self.camera, self._mounts).items():
            yield topic, message, at_ns
        check_images(self._place, frame, self._cameras)
        for camera in self._cameras.values():
            for topic, message in _make_camera_messages(
                camera, frame.camera[camera.name].intensity_counts, at_ns
            ).items():
                yield topic, message, at_ns

    def describe_cameras(self) -> list[dict[str, Any]]:
        """Return each camera beside the lidar as a table that JSON can hold."""
        return [camera.describe() for camera in self._cameras.values()]

    def convert_samples(self, samples: Mapping[str, SensorSamples]) -> Iterator[tuple[str, dict[str, Any], int]]:
        """Yield topic, message and time of each sample, in the order in which they become available."""
        for available_s, time_s, topic, body in list_samples(self._sensors, samples):
            stamp = to_ros_time(self.to_stamp_ns(time_s))
            yield (
                topic.topic,
                {"header": {"stamp": stamp, "frame_id": topic.axes}} | body,
                self.to_stamp_ns(available_s),
            )

    def to_stamp_ns(self, time_s: float) -> int:
        """Return an instant [s since start_utc] as a stamp [ns since 1970]."""
        at_ns = to_stamp_ns(self._source.start_utc, time_s)
        if not 0 <= at_ns < _LAST_S * NS_PER_S:
            start_utc = self._source.start_utc
            raise RecordingError(f"{self._place}: ROS stamps hold 1970 to 2038, the run is at {start_utc}; shift it")
        return at_ns


def to_ros_time(at_ns: int) -> dict[str, int]:
    """Return a stamp [ns since 1970] as builtin_interfaces/Time."""
    return {"sec": at_ns // NS_PER_S, "nanosec": at_ns % NS_PER_S}


def write_mcap(path: str | os.PathLike[str], frames: Iterable[Frame], *, overwrite: bool = False) -> Path:
    """Write frames to an MCAP file, with seven messages per frame on the topics of `TOPICS`, and return its path.

    `/lidar/points` is an organised cloud, NaN where nothing came back, with x, y, z [m] and intensity [counts] as
    float32. `/lidar/range` is 32FC1, slant range [m] with NaN. `/lidar/intensity` is mono16. `/tf` holds all axes,
    parent_from_child of each. `/labels/target` and `/labels/part` are 16SC1: indices of targets and their parts, -1 for
    sky. A camera beside the lidar has `/<name>/image_raw` (mono16, rgb16 or 16UC<n>, counts) and `/<name>/camera_info`, with
    the stamp of the flash. Each sample of another sensor is a message of its own, see `sensor_messages`.
    """
    place = check_writable(path, overwrite=overwrite)
    check_mcap(place)
    first, coming = take_first(place, frames)
    with write_atomically(place) as draft:
        write_messages(place, draft, first, coming)
    return place


def check_mcap(place: Path) -> None:
    """Raise a `RecordingError` where the library that writes MCAP is not installed."""
    try:
        import mcap_ros2.writer  # noqa: F401
    except ImportError as error:
        raise RecordingError(
            f"{place}: MCAP needs an extra: pip install rso-lidar[mcap], or choose another format ({error.name} is missing)"
        ) from None


def write_messages(place: Path, draft: Path, first: Frame, frames: Iterable[Frame]) -> MessageSpan:
    """Write the messages of all frames to a file."""
    from mcap_ros2.writer import Writer

    stream = RosStream(first, place)
    kinds = stream.kinds
    counts, ends = dict.fromkeys(kinds, 0), [_LAST_S * NS_PER_S, 0]
    with draft.open("wb") as file:
        writer: Any = Writer(file, chunk_size=max(_CHUNK_BYTES * first.range_m.size, _LEAST_BYTES))
        schemas = {
            kind: writer.register_msgdef(kind, stream.definitions[kind]) for kind in dict.fromkeys(kinds.values())
        }
        writer.add_metadata("rso_lidar", _provenance(first.source, stream))
        for frame in frames:
            check_stream(file, draft, place)
            for topic, message, at_ns in [
                *stream.convert_samples(frame.observation.sensors),
                *stream.convert_frame(frame),
            ]:
                writer.write_message(topic, schemas[kinds[topic]], message, at_ns, at_ns, counts[topic])
                counts[topic] += 1
                ends[:] = min(ends[0], at_ns), max(ends[1], at_ns)
            file.flush()
        writer.finish()
        check_stream(file, draft, place)
    _check_file(place, draft, sum(counts.values()))
    return MessageSpan(ends[0], ends[1], kinds, counts)


def _check_file(place: Path, draft: Path, messages: int) -> None:
    """Raise a `RunError` unless the summary at the end of the file counts the expected messages."""
    from mcap.exceptions import McapError
    from mcap.reader import make_reader

    try:
        with draft.open("rb") as file:
            summary = make_reader(file, validate_crcs=True).get_summary()
    except (McapError, ValueError, struct.error) as error:
        raise RunError(f"{place}: not written: the file cannot be read back ({error}); run again") from error
    count = summary.statistics.message_count if summary and summary.statistics else 0
    if count != messages:
        raise RunError(f"{place}: not written: the file has {count} of {messages} messages; run again")


def _provenance(source: Source, stream: RosStream) -> dict[str, str]:
    """Return the metadata of a file, which suffices to repeat the simulation."""
    return {
        "title": source.title,
        "scenario": source.scenario,
        "start_utc": source.start_utc,
        "seed": str(source.seed),
        "versions": json.dumps(dict(source.versions)),
        "targets": json.dumps(tabulate_targets(source.targets)),
        "quaternion_order": "xyzw",
        "camera_model_error_px": f"{stream.camera.error_px:.3g}",
        "cameras": json.dumps(stream.describe_cameras()),
    }


def _list_camera_topics(cameras: Mapping[str, CompanionCamera]) -> dict[str, str]:
    """Return the type of each topic of the cameras; raise a `RecordingError` if two cameras have the same topic."""
    topics: dict[str, str] = {}
    for name in cameras:
        if (image := f"/{to_word(name)}/image_raw") in topics:
            raise RecordingError(f"cameras: two have the topic {image} in ROS; rename one")
        topics |= {f"/{to_word(name)}/camera_info": CAMERA_INFO, image: IMAGE}
    return topics


def _make_camera_messages(camera: CompanionCamera, counts: np.ndarray, at_ns: int) -> dict[str, dict[str, Any]]:
    """Return the messages of an image by topic.

    Parameters
    ----------
    counts : (row, col, band)
    at_ns : stamp of the flash [ns since 1970]
    """
    rows, cols, bands = camera.shape
    header = {"stamp": to_ros_time(at_ns), "frame_id": camera.name}
    size = {"header": header, "height": rows, "width": cols}
    encoding = {1: "mono16", 3: "rgb16"}.get(bands, f"16UC{bands}")
    return {
        f"/{to_word(camera.name)}/camera_info": _describe_camera(size, camera.pinhole),
        f"/{to_word(camera.name)}/image_raw": _image(size, encoding, counts.astype("<u2")),
    }


def _describe_camera(size: dict[str, Any], camera: PinholeCamera) -> dict[str, Any]:
    """Return a CameraInfo message."""
    focal, centre = camera.focal_px, camera.centre_px
    return {
        **size,
        "distortion_model": "plumb_bob",
        "d": list(camera.distortion),
        "k": list(camera.matrix),
        "r": [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0],
        "p": [focal, 0.0, centre[0], 0.0, 0.0, focal, centre[1], 0.0, 0.0, 0.0, 1.0, 0.0],
        "binning_x": 0,
        "binning_y": 0,
        "roi": {"x_offset": 0, "y_offset": 0, "height": 0, "width": 0, "do_rectify": False},
    }


def _messages(
    frame: Frame, at_ns: int, camera: PinholeCamera, mounts: Sequence[dict[str, Any]]
) -> dict[str, dict[str, Any]]:
    """Return the messages of a frame by topic.

    Parameters
    ----------
    frame : to be written
    at_ns : its stamp [ns since 1970]
    mounts : poses of sensors in the follower's axes
    """
    rows, cols = frame.range_m.shape
    stamp = to_ros_time(at_ns)
    header = {"stamp": stamp, "frame_id": LIDAR}
    on_follower: dict[str, Any] = {"header": {"stamp": stamp, "frame_id": FOLLOWER}}
    cloud = np.empty((rows, cols, len(_FIELDS)), dtype="<f4")
    cloud[..., :3] = frame.points_m
    cloud[..., 3] = frame.intensity_counts
    fields = [{"name": name, "offset": 4 * k, "datatype": _FLOAT32, "count": 1} for k, name in enumerate(_FIELDS)]
    size = {"header": header, "height": rows, "width": cols}
    return {
        "/tf": {"transforms": _transforms(frame, stamp) + [on_follower | mount for mount in mounts]},
        "/lidar/camera_info": _describe_camera(size, camera),
        "/lidar/range": _image(size, "32FC1", frame.range_m.astype("<f4")),
        "/lidar/intensity": _image(size, "mono16", frame.intensity_counts.astype("<u2")),
        "/lidar/points": {
            **size,
            "fields": fields,
            "is_bigendian": False,
            "point_step": 4 * len(_FIELDS),
            "row_step": 4 * len(_FIELDS) * cols,
            "data": cloud.tobytes(),
            "is_dense": False,
        },
        "/labels/target": _image(size, "16SC1", frame.labels.target.astype("<i2")),
        "/labels/part": _image(size, "16SC1", frame.labels.part.astype("<i2")),
    }


def _image(size: dict[str, Any], encoding: str, values: np.ndarray) -> dict[str, Any]:
    """Return an Image message.

    Parameters
    ----------
    values : (row, col) or (row, col, band)
    """
    step = values[0].nbytes
    return {**size, "encoding": encoding, "is_bigendian": 0, "step": step, "data": values.tobytes()}


def _transforms(frame: Frame, stamp: dict[str, int]) -> list[dict[str, Any]]:
    """Return the pose of each set of axes in its parent."""
    poses, transforms = frame.truth.poses, []
    for name, link in poses.items():
        x, y, z = link.translation_m.tolist()
        turn = dict(zip("xyzw", quaternion_xyzw(link.rotation).tolist(), strict=True))
        transforms.append(
            {
                "header": {"stamp": stamp, "frame_id": poses.parent(name)},
                "child_frame_id": name,
                "transform": {"translation": {"x": x, "y": y, "z": z}, "rotation": turn},
            }
        )
    return transforms
