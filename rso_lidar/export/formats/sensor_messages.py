"""ROS 2 messages of the samples of sensors: which topic a sensor has, and what each of its messages holds.

A stamp is the instant at which a sample holds, and the time in the log is that at which flight software receives it.
Standard messages have no place to say that a sample is not valid, so such samples are left out of them.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from rso_lidar.errors import RecordingError
from rso_lidar.export.formats.ros_messages import IMU, JOINTS, POINT, QUATERNION, VECTOR, define_message
from rso_lidar.part import parse_toml
from rso_lidar.pose import ROOT, build_rotation, quaternion_xyzw
from rso_lidar.records import (
    AccelerometerSamples,
    Frame,
    GnssSamples,
    GyroSamples,
    RelativeGnssSamples,
    SensorSamples,
    Source,
    StarTrackerSamples,
    WheelSamples,
    specs,
)

_UNKNOWN = [0.0] * 9  # covariances that are not stated
_ABSENT = [-1.0] + [0.0] * 8  # sensor_msgs/Imu: element 0 is -1 where there is no measurement
_IDENTITY = {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0}
_TYPES = {"f": "float64", "i": "int64", "u": "uint64", "b": "bool"}  # ROS types by the kind of a dtype
_SAME_UNIT = ("rate_hz", "phase_s", "latency_s", "mount")  # what a gyro and an accelerometer of one IMU share

Body = Callable[[Sequence[SensorSamples], int], dict[str, Any] | None]


@dataclass(frozen=True)
class SensorTopic:
    """A topic with samples: its message type and definition, its axes, its sensors, and what makes a message of a sample.

    `body` gets the samples of each sensor and the number of one, and returns the message without its header; None leaves
    the sample out.
    """

    topic: str
    kind: str
    axes: str
    sensors: tuple[str, ...]
    body: Body
    definition: str = ""  # empty for standard messages


def list_topics(first: Frame) -> list[SensorTopic]:
    """List the topics of the sensors of a recording, in order.

    Raises
    ------
    RecordingError
        If two sensors would have the same topic.
    """
    sensors, tables = first.observation.sensors, _read_tables(first.source)
    sensor_topics: list[SensorTopic] = []
    joined: set[str] = set()
    for name, samples in sensors.items():
        if name not in joined:
            partner = _find_accelerometer(name, sensors, tables, joined) if isinstance(samples, GyroSamples) else None
            joined |= {partner} if partner else set()
            sensor_topics += _make_topics(name, samples, partner, tables.get(name, {}))
    topics = [sensor_topic.topic for sensor_topic in sensor_topics]
    if twice := [topic for topic in topics if topics.count(topic) > 1]:
        raise RecordingError(f"sensors: two have the topic {twice[0]} in ROS; rename one")
    return sensor_topics


def _read_tables(source: Source) -> dict[str, dict[str, Any]]:
    """Return the tables of the sensors of a scenario, by name; a user's own objects have none."""
    tables = parse_toml(source.scenario, "recording", RecordingError).get("sensor", [])
    return {table["name"]: table for table in tables if isinstance(table, dict) and "name" in table}


def _find_accelerometer(
    gyro: str, sensors: Mapping[str, SensorSamples], tables: Mapping[str, Any], taken: set[str]
) -> str | None:
    """Return the accelerometer of the same inertial unit: equal in rate, phase, latency and mount; None without one.

    Parameters
    ----------
    taken : accelerometers that have a gyro already
    """
    for name, samples in sensors.items():
        if isinstance(samples, AccelerometerSamples) and name not in taken and {name, gyro} <= tables.keys():
            ours, theirs = ([tables[of].get(key) for key in _SAME_UNIT] for of in (gyro, name))
            if ours == theirs:
                return name
    return None


def _make_topics(
    name: str, samples: SensorSamples, partner: str | None, table: Mapping[str, Any]
) -> Iterator[SensorTopic]:
    """Yield the topics of a sensor."""
    base, axes = f"/sensors/{to_word(name)}", f"sensors/{name}"
    match samples:
        case GyroSamples() | AccelerometerSamples():
            yield SensorTopic(f"{base}/imu", IMU, axes, (name, partner) if partner else (name,), _make_imu)
        case GnssSamples():
            yield SensorTopic(f"{base}/position", POINT, ROOT, (name,), _vector_maker("point", "position_m"))
            yield SensorTopic(f"{base}/velocity", VECTOR, ROOT, (name,), _vector_maker("vector", "velocity_m_s"))
        case RelativeGnssSamples():
            turned = f"{table['target']}.rtn" if table.get("axes") == "rtn" else ROOT
            for word, field in (("position", "relative_position_m"), ("velocity", "relative_velocity_m_s")):
                yield SensorTopic(f"{base}/{word}", VECTOR, turned, (name,), _vector_maker("vector", field))
        case StarTrackerSamples():
            body = _vector_maker("quaternion", "quaternion_xyzw")
            yield SensorTopic(f"{base}/attitude", QUATERNION, ROOT, (name,), body)
        case WheelSamples() if 0 in (sizes := _count_wheels(samples)) or len(set(sizes)) == 1:
            yield SensorTopic(f"{base}/wheels", JOINTS, axes, (name,), _make_joints)
        case _:
            kind, definition = _define(samples)
            yield SensorTopic(f"{base}/samples", kind, axes, (name,), _make_own, definition)


def make_mounts(topics: Sequence[SensorTopic], source: Source) -> list[dict[str, Any]]:
    """Return the pose of each inertial sensor in the follower's axes, as transforms without a stamp."""
    tables, mounts = _read_tables(source), []
    for topic in topics:
        table = tables.get(topic.sensors[0])
        if topic.kind == IMU and table is not None:
            mount = table.get("mount", {})
            place = mount.get("position_m", (0.0, 0.0, 0.0))
            rotation = build_rotation(mount.get("quaternion_xyzw"), mount.get("euler_zyx_deg"))
            transform = {"translation": _xyz(place), "rotation": _xyz(quaternion_xyzw(rotation))}
            mounts.append({"child_frame_id": topic.axes, "transform": transform})
    return mounts


def list_samples(
    topics: Sequence[SensorTopic], sensors: Mapping[str, SensorSamples]
) -> list[tuple[float, float, SensorTopic, dict[str, Any]]]:
    """List the messages of samples in the order in which they become available.

    Returns
    -------
    Of each message the instant at which the sample becomes available, that at which it holds [s], its topic, and what it
    holds beside its header.
    """
    messages = []
    for topic in topics:
        samples = [sensors[name] for name in topic.sensors]
        for k, (time_s, available_s) in enumerate(zip(samples[0].time_s, samples[0].available_s, strict=True)):
            if (body := topic.body(samples, k)) is not None:
                messages.append((float(available_s), float(time_s), topic, body))
    return sorted(messages, key=lambda message: message[:2])


# ------------------------------------------------------------------------------------------------------- the inside


def _make_imu(samples: Sequence[SensorSamples], k: int) -> dict[str, Any] | None:
    """Return an Imu message without orientation; what was not measured has covariance[0] = -1."""
    message = {"orientation": _IDENTITY, "orientation_covariance": _ABSENT}
    message |= {"angular_velocity": _xyz((0.0, 0.0, 0.0)), "angular_velocity_covariance": _ABSENT}
    message |= {"linear_acceleration": _xyz((0.0, 0.0, 0.0)), "linear_acceleration_covariance": _ABSENT}
    valid = [record for record in samples if record.valid[k]]
    for record in valid:
        if isinstance(record, GyroSamples):
            message |= {
                "angular_velocity": _xyz(record.angular_velocity_rad_s[k]),
                "angular_velocity_covariance": _UNKNOWN,
            }
        elif isinstance(record, AccelerometerSamples):
            message |= {"linear_acceleration": _xyz(record.specific_force_m_s2[k])}
            message |= {"linear_acceleration_covariance": _UNKNOWN}
    return message if valid else None


def _vector_maker(name: str, field: str) -> Body:
    """Return a function that makes messages of one vector or quaternion."""

    def make(samples: Sequence[SensorSamples], k: int) -> dict[str, Any] | None:
        return {name: _xyz(getattr(samples[0], field)[k])} if samples[0].valid[k] else None

    return make


def _make_joints(samples: Sequence[Any], k: int) -> dict[str, Any] | None:
    """Return a JointState message: speeds and torques of wheels, with the number of each as its name."""
    wheels = samples[0]
    if not wheels.valid[k]:
        return None
    names = [f"wheel_{number}" for number in range(max(_count_wheels(wheels)))]
    speeds, torques = wheels.speed_rad_s[k].tolist(), wheels.torque_n_m[k].tolist()
    return {"name": names, "position": [], "velocity": speeds, "effort": torques}


def _count_wheels(wheels: WheelSamples) -> tuple[int, int]:
    return wheels.speed_rad_s.shape[1], wheels.torque_n_m.shape[1]


def _make_own(samples: Sequence[SensorSamples], k: int) -> dict[str, Any]:
    """Return a message with the fields of the record, each flattened."""
    record = samples[0]
    message: dict[str, Any] = {"valid": bool(record.valid[k])}
    return message | {name: np.ravel(getattr(record, field)[k]).tolist() for field, name in _own_fields(record).items()}


def _define(samples: SensorSamples) -> tuple[str, str]:
    """Return the type of a message with the fields of a record, and its definition."""
    stated = specs(type(samples))
    lines = ["std_msgs/Header header", "bool valid"]
    lines += [f"{_TYPES[stated[field].dtype.kind]}[] {name}" for field, name in _own_fields(samples).items()]
    name = re.sub(r"[^A-Za-z0-9]", "", type(samples).__name__)
    return f"rso_lidar_msgs/msg/{name}", define_message("\n".join(lines))


def _own_fields(samples: SensorSamples) -> dict[str, str]:
    """Return the fields that a record has beside those of all records of samples, with their names in ROS."""
    own = [field for field in specs(type(samples)) if field not in specs(SensorSamples)]
    return {field: to_word(field).lower() for field in own if getattr(samples, field) is not None}


def to_word(name: str) -> str:
    """Return a name with the characters that names in ROS may have."""
    return re.sub(r"[^A-Za-z0-9_]", "_", name)


def _xyz(values: Sequence[float] | np.ndarray) -> dict[str, float]:
    """Return a vector or a quaternion as ROS has it."""
    return dict(zip("xyzw", (float(value) for value in values), strict=False))
