"""Samples of sensors as ROS messages, read back by rosbags; and as tables, read back by csv and pyarrow."""

import csv
import dataclasses

import numpy as np
import pytest
from frames_for_tests import SENSORS, SOURCE, make_frame, make_frames
from scipy.spatial.transform import Rotation

from rso_lidar import export
from rso_lidar.errors import RecordingError
from rso_lidar.export.formats.mcap import TOPICS
from rso_lidar.records import (
    AccelerometerSamples,
    GnssSamples,
    GyroSamples,
    RelativeGnssSamples,
    StarTrackerSamples,
    ThrusterSamples,
    WheelSamples,
    join_samples,
)

START_NS = 1726574400 * 10**9
MOUNT = "mount = { position_m = [1.0, 2.0, 3.0], euler_zyx_deg = [90.0, 0.0, 0.0] }"
SCENARIO = f"""
[[sensor]]
name = "gyro"
rate_hz = 20.0
{MOUNT}
[[sensor]]
name = "other-one"
rate_hz = 20.0
mount = {{ position_m = [0.0, 0.0, 3.0] }}
[[sensor]]
name = "felt"
rate_hz = 20.0
{MOUNT}
[[sensor]]
name = "carrier"
target = "tdrs"
axes = "rtn"
"""
KINDS = {
    "/sensors/gyro/imu": "sensor_msgs/msg/Imu",
    "/sensors/other_one/imu": "sensor_msgs/msg/Imu",
    "/sensors/place/position": "geometry_msgs/msg/PointStamped",
    "/sensors/place/velocity": "geometry_msgs/msg/Vector3Stamped",
    "/sensors/carrier/position": "geometry_msgs/msg/Vector3Stamped",
    "/sensors/carrier/velocity": "geometry_msgs/msg/Vector3Stamped",
    "/sensors/stars/attitude": "geometry_msgs/msg/QuaternionStamped",
    "/sensors/spinning/wheels": "sensor_msgs/msg/JointState",
    "/sensors/valves/samples": "rso_lidar_msgs/msg/ThrusterSamples",
}


def sample(k):
    """Return two samples of each kind of sensor in frame k; of some, the second is not valid."""
    rng = np.random.default_rng(k)
    time_s = 0.1 * k + np.array([-0.09, -0.04])
    both, one = (time_s, time_s + 0.02, [True, True]), (time_s, time_s + 0.03, [True, False])

    def numbers(size):
        return rng.normal(size=(2, size))

    return {
        "gyro": GyroSamples(*both, numbers(3)),
        "other-one": AccelerometerSamples(*one, numbers(3)),
        "felt": AccelerometerSamples(time_s, time_s + 0.02, [True, False], numbers(3)),
        "place": GnssSamples(*one, 1e7 * numbers(3), 1e3 * numbers(3)),
        "carrier": RelativeGnssSamples(*both, numbers(3), numbers(3)),
        "stars": StarTrackerSamples(*both, Rotation.random(2, rng=rng).as_quat()),
        "spinning": WheelSamples(*both, numbers(4), np.empty((2, 0))),
        "valves": ThrusterSamples(*one, numbers(6)),
    }


def frames(count):
    source = dataclasses.replace(SOURCE, scenario=SCENARIO)
    for k in range(1, count + 1):
        frame = make_frame(k, source=source)
        yield dataclasses.replace(frame, observation=dataclasses.replace(frame.observation, sensors=sample(k)))


@pytest.fixture(scope="module")
def read(tmp_path_factory):
    """Return messages by topic as rosbags reads them from the folder: (time in the log, message)."""
    pytest.importorskip("mcap_ros2.writer", reason="needs the extra mcap: pip install 'rso-lidar[mcap]'")
    rosbags = pytest.importorskip("rosbags.highlevel", reason="needs rosbags: pip install rosbags")
    typesys = pytest.importorskip("rosbags.typesys", reason="needs rosbags: pip install rosbags")
    path = export.save(tmp_path_factory.mktemp("ros") / "run.rosbag2", frames(3))
    store = typesys.get_typestore(typesys.Stores.ROS2_HUMBLE)
    found = {}
    with rosbags.AnyReader([path], default_typestore=store) as reader:
        assert {one.topic: one.msgtype for one in reader.connections} == TOPICS | KINDS
        assert reader.start_time == START_NS + 30_000_000  # the first sample, and not the first flash
        order = [at for _, at, _ in reader.messages()]
        assert order == sorted(order)
        for connection, at, raw in reader.messages():
            found.setdefault(connection.topic, []).append((at, reader.deserialize(raw, connection.msgtype)))
        assert {topic: info.msgcount for topic, info in reader.topics.items()} == {
            topic: len(messages) for topic, messages in found.items()
        }
    return found


def ns(time_s):
    return START_NS + round(time_s * 1e9)


def stamp_ns(message):
    return message.header.stamp.sec * 10**9 + message.header.stamp.nanosec


def vector(value):
    return [getattr(value, axis) for axis in "xyzw" if hasattr(value, axis)]


def test_gyro_and_accelerometer_of_one_unit_share_messages(read):
    """What is not measured or not valid has covariance[0] = -1; the orientation never is measured."""
    messages = read["/sensors/gyro/imu"]
    assert len(messages) == 6
    for place, (at, message) in enumerate(messages):
        k, number = place // 2 + 1, place % 2
        samples = sample(k)
        assert abs(at - ns(samples["gyro"].available_s[number])) <= 1
        assert abs(stamp_ns(message) - ns(samples["gyro"].time_s[number])) <= 1
        assert message.header.frame_id == "sensors/gyro"
        assert vector(message.angular_velocity) == samples["gyro"].angular_velocity_rad_s[number].tolist()
        force = samples["felt"].specific_force_m_s2[number].tolist()
        assert vector(message.linear_acceleration) == (force if number == 0 else [0, 0, 0])
        marks = (message.orientation_covariance, message.angular_velocity_covariance)
        assert [mark[0] for mark in (*marks, message.linear_acceleration_covariance)] == [-1, 0, -number]
    alone = read["/sensors/other_one/imu"]
    assert len(alone) == 3
    assert alone[1][1].angular_velocity_covariance[0] == -1
    assert vector(alone[1][1].linear_acceleration) == sample(2)["other-one"].specific_force_m_s2[0].tolist()


def test_axes_of_inertial_sensors_are_in_the_tree(read):
    transforms = {one.child_frame_id: one for one in read["/tf"][0][1].transforms}
    mount = transforms["sensors/gyro"]
    assert mount.header.frame_id == "follower"
    assert vector(mount.transform.translation) == [1, 2, 3]
    np.testing.assert_allclose(vector(mount.transform.rotation), [0, 0, 0.5**0.5, 0.5**0.5], atol=1e-15)
    assert vector(transforms["sensors/other-one"].transform.rotation) == [0, 0, 0, 1]


@pytest.mark.parametrize(
    ("topic", "axes", "name", "message_field", "field", "count"),
    [
        ("place/position", "inertial", "place", "point", "position_m", 3),
        ("place/velocity", "inertial", "place", "vector", "velocity_m_s", 3),
        ("carrier/position", "tdrs.rtn", "carrier", "vector", "relative_position_m", 6),
        ("carrier/velocity", "tdrs.rtn", "carrier", "vector", "relative_velocity_m_s", 6),
        ("stars/attitude", "inertial", "stars", "quaternion", "quaternion_xyzw", 6),
    ],
)
def test_vectors_are_those_of_valid_samples(read, topic, axes, name, message_field, field, count):
    messages = read[f"/sensors/{topic}"]
    assert len(messages) == count
    valid = [(k, number) for k in (1, 2, 3) for number in (0, 1) if sample(k)[name].valid[number]]
    for (at, message), (k, number) in zip(messages, valid, strict=True):
        samples = sample(k)[name]
        assert message.header.frame_id == axes
        assert abs(at - ns(samples.available_s[number])) <= 1
        assert abs(stamp_ns(message) - ns(samples.time_s[number])) <= 1
        assert vector(getattr(message, message_field)) == getattr(samples, field)[number].tolist()


def test_wheels_are_joints_and_other_records_have_messages_of_their_own(read):
    wheels = read["/sensors/spinning/wheels"][3][1]
    assert wheels.name == ["wheel_0", "wheel_1", "wheel_2", "wheel_3"]
    assert wheels.velocity.tolist() == sample(2)["spinning"].speed_rad_s[1].tolist()
    assert [len(wheels.position), len(wheels.effort)] == [0, 0]
    valves = [message for _, message in read["/sensors/valves/samples"]]
    assert [message.valid for message in valves] == [True, False] * 3
    assert valves[4].force_n.tolist() == sample(3)["valves"].force_n[0].tolist()


def test_a_record_of_ones_own_is_a_message_with_all_its_fields(tmp_path):
    pytest.importorskip("mcap_ros2.writer", reason="needs the extra mcap: pip install 'rso-lidar[mcap]'")
    rosbags = pytest.importorskip("rosbags.highlevel", reason="needs rosbags: pip install rosbags")
    with rosbags.AnyReader([export.save(tmp_path / "run.mcap", make_frames(4, sensors=SENSORS))]) as reader:
        own = [it for it in reader.messages() if it[0].topic == "/sensors/own_sensor/samples"]
        (_, _, one) = own[-1]
        message = reader.deserialize(one, own[-1][0].msgtype)
    samples = make_frame(3, sensors=SENSORS).observation.sensors["own sensor"]
    assert message.current_a.tolist() == samples.current_a[0].ravel().tolist()
    assert message.code.tolist() == [samples.code[0]]
    assert message.is_lit.tolist() == samples.is_lit[0].tolist()


def test_two_sensors_with_one_topic_are_refused(tmp_path):
    pytest.importorskip("mcap_ros2.writer", reason="needs the extra mcap: pip install 'rso-lidar[mcap]'")
    with pytest.raises(RecordingError, match="two have the topic /sensors/own_sensor/samples in ROS; rename one"):
        export.save(tmp_path / "run.mcap", make_frames(1, sensors={"own sensor": (1,), "own_sensor": (1,)}))
    assert not list(tmp_path.iterdir())


COLUMNS = ["time_s", "utc", "available_s", "valid", *(f"angular_velocity_{axis}_rad_s" for axis in "xyz")]


def test_csv_has_a_row_for_each_sample_at_full_precision(tmp_path):
    recording = export.open(export.save(tmp_path / "run.h5", make_frames(5, sensors=SENSORS)))
    series = join_samples([frame.observation.sensors for frame in make_frames(5, sensors=SENSORS)])
    path = export.save(tmp_path / "gyro.csv", recording, sensor="gyro")
    with path.open(newline="", encoding="utf-8") as file:
        head, *rows = csv.reader(file)
    gyro = series["gyro"]
    assert head == COLUMNS
    assert [float(row[0]) for row in rows] == gyro.time_s.tolist()
    assert [row[3] for row in rows] == [str(one) for one in gyro.valid.tolist()]
    np.testing.assert_array_equal([[float(cell) for cell in row[4:]] for row in rows], gyro.angular_velocity_rad_s)
    assert rows[2][1].startswith("2024-09-17T12:00:00.0")
    assert (
        export.save(tmp_path / "same.csv", make_frames(5, sensors=SENSORS), sensor="gyro").read_text()
        == path.read_text()
    )
    with export.save(tmp_path / "own.csv", recording[2:], sensor="own sensor").open() as file:
        assert next(file).split(",")[4:7] == ["current_a_0_0", "current_a_0_1", "current_a_0_2"]
        assert len(list(file)) == 2
    with pytest.raises(RecordingError, match=r"--sensor gyr: there is no sensor of that name; did you mean 'gyro'"):
        export.save(tmp_path / "x.csv", recording, sensor="gyr")
    with pytest.raises(RecordingError, match=r"--sensor gyro: .*; the frames have no sensors"):
        export.save(tmp_path / "x.csv", make_frames(1), sensor="gyro")
    assert not (tmp_path / "x.csv").exists()


def test_parquet_has_the_table_of_csv(tmp_path):
    parquet = pytest.importorskip("pyarrow.parquet", reason="needs the extra parquet: pip install 'rso-lidar[parquet]'")
    gyro = join_samples([frame.observation.sensors for frame in make_frames(5, sensors=SENSORS)])["gyro"]
    read = parquet.read_table(export.save(tmp_path / "gyro.parquet", make_frames(5, sensors=SENSORS), sensor="gyro"))
    assert read.column_names == COLUMNS
    assert read["valid"].to_pylist() == gyro.valid.tolist()
    np.testing.assert_array_equal(read[COLUMNS[5]].to_numpy(), gyro.angular_velocity_rad_s[:, 1])
    assert read.schema.metadata[b"sensor"] == b"gyro"
    source = dataclasses.replace(SOURCE, targets=SOURCE.targets[:1])  # the axes of the other are not in the tree
    truth = parquet.read_table(export.save(tmp_path / "truth.parquet", make_frames(3, source=source)))
    head, *rows = export.save(tmp_path / "truth.csv", make_frames(3, source=source)).read_text().splitlines()
    assert truth.column_names == head.split(",")
    assert truth.num_rows == len(rows) == 3
