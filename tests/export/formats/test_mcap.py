"""MCAP, read back by rosbags, which neither wrote the container nor the messages; and what a kill leaves."""

import contextlib
import dataclasses
import json
import os
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from frames_for_tests import SOURCE, line_of_sight, make_frame, make_frames
from scipy.spatial.transform import RigidTransform, Rotation

from rso_lidar import export
from rso_lidar.errors import RecordingError, RunError
from rso_lidar.export.formats.mcap import TOPICS, write_mcap
from rso_lidar.export.formats.ros_messages import DEFINITIONS
from rso_lidar.pose import ROOT

COUNT = 7
START_NS = 1726574400 * 10**9


def test_without_the_extra_the_error_names_it(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "mcap_ros2", None)
    monkeypatch.setitem(sys.modules, "mcap_ros2.writer", None)
    with pytest.raises(RecordingError, match=r"needs an extra: pip install rso-lidar\[mcap\]"):
        write_mcap(tmp_path / "run.mcap", make_frames(2))
    assert not list(tmp_path.iterdir())


def messages(path):
    """Return what rosbags reads: (topic, time, message) in order."""
    rosbags = pytest.importorskip("rosbags.highlevel", reason="needs rosbags: pip install rosbags")
    typesys = pytest.importorskip("rosbags.typesys", reason="needs rosbags: pip install rosbags")
    store = typesys.get_typestore(typesys.Stores.ROS2_HUMBLE)
    with rosbags.AnyReader([path], default_typestore=store) as reader:
        kinds = {connection.topic: connection.msgtype for connection in reader.connections}
        assert kinds == TOPICS
        return [(c.topic, at, reader.deserialize(raw, c.msgtype)) for c, at, raw in reader.messages()]


@pytest.fixture
def written(tmp_path):
    pytest.importorskip("mcap_ros2.writer", reason="needs the extra mcap: pip install 'rso-lidar[mcap]'")
    return write_mcap(tmp_path / "run.mcap", make_frames(COUNT))


def pixels(message, dtype):
    assert message.is_bigendian == 0 and message.step == np.dtype(dtype).itemsize * message.width
    return np.frombuffer(message.data.tobytes(), dtype).reshape(message.height, message.width)


def test_every_message_comes_back(written):
    read = messages(written)
    assert len(read) == COUNT * len(TOPICS)
    for k in range(COUNT):
        frame = make_frame(k)
        ours = {topic: message for topic, at, message in read if at == START_NS + k * 100_000_000}
        assert ours.keys() == TOPICS.keys()
        for topic, message in ours.items():
            stamp = message.transforms[0].header.stamp if topic == "/tf" else message.header.stamp
            assert stamp.sec * 10**9 + stamp.nanosec == START_NS + k * 100_000_000
            assert topic == "/tf" or message.header.frame_id == "lidar"
        for name in ("target", "part"):
            assert ours[f"/labels/{name}"].encoding == "16SC1"
            np.testing.assert_array_equal(pixels(ours[f"/labels/{name}"], "<i2"), getattr(frame.labels, name))
        np.testing.assert_array_equal(pixels(ours["/lidar/range"], "<f4"), frame.range_m)
        np.testing.assert_array_equal(pixels(ours["/lidar/intensity"], "<u2"), frame.intensity_counts)
        assert (ours["/lidar/range"].encoding, ours["/lidar/intensity"].encoding) == ("32FC1", "mono16")
        cloud = ours["/lidar/points"]
        assert (cloud.height, cloud.width, cloud.is_dense, cloud.point_step) == (*frame.range_m.shape, False, 16)
        assert [(field.name, field.offset, field.datatype, field.count) for field in cloud.fields] == [
            ("x", 0, 7, 1), ("y", 4, 7, 1), ("z", 8, 7, 1), ("intensity", 12, 7, 1)
        ]  # fmt: skip
        points = np.frombuffer(cloud.data.tobytes(), "<f4").reshape(*frame.range_m.shape, 4)
        np.testing.assert_array_equal(points[..., :3], frame.points_m.astype("f4"))
        assert np.isnan(points[..., 0]).any()
        np.testing.assert_array_equal(points[..., 3], frame.intensity_counts)


def test_the_tree_of_axes_gives_every_pose(written):
    for topic, at, message in messages(written):
        if topic != "/tf":
            continue
        truth = make_frame((at - START_NS) // 100_000_000).truth
        steps = {one.child_frame_id: one for one in message.transforms}
        assert {name: one.header.frame_id for name, one in steps.items()} == {
            name: truth.poses.parent(name) for name in truth.poses
        }

        def climbed(name, steps=steps):
            """Return inertial_from_name from the messages, as ROS composes transforms."""
            pose = RigidTransform.identity()
            while name != ROOT:
                move, turn = steps[name].transform.translation, steps[name].transform.rotation
                rotation = Rotation.from_quat([turn.x, turn.y, turn.z, turn.w])
                pose = RigidTransform.from_components([move.x, move.y, move.z], rotation) * pose
                name = steps[name].header.frame_id
            return pose

        found = climbed("lidar").inv() * climbed("tdrs")
        # Through the root positions are 8e7 m large, and quaternions rounded to 1e-16: some 1e-7 m.
        np.testing.assert_allclose(found.translation, truth.pose("lidar", "tdrs").translation, atol=3e-7)
        np.testing.assert_allclose(
            found.as_matrix()[:3, :3], truth.pose("lidar", "tdrs").rotation.as_matrix(), atol=1e-14
        )


def test_the_camera_of_a_lens_that_changes(tmp_path):
    pytest.importorskip("mcap_ros2.writer", reason="needs the extra mcap: pip install 'rso-lidar[mcap]'")
    path = write_mcap(tmp_path / "zoom.mcap", make_frames(4, zoom=lambda k: 1.0 + k // 2))
    infos = [message for topic, _, message in messages(path) if topic == "/lidar/camera_info"]
    for k, info in enumerate(infos):
        sight = line_of_sight((12, 10), 1.0 + k // 2)
        seen = np.einsum("ij,rcj->rci", np.reshape(info.k, (3, 3)), sight / sight[..., 2:])
        rows, cols = np.mgrid[:12, :10]
        np.testing.assert_allclose(seen[..., 0], cols, atol=1e-9)
        np.testing.assert_allclose(seen[..., 1], rows, atol=1e-9)
        np.testing.assert_array_equal(np.reshape(info.p, (3, 4))[:, :3], np.reshape(info.k, (3, 3)))
        assert (info.distortion_model, list(info.d)) == ("plumb_bob", [0.0] * 5)
        assert (info.height, info.width) == (12, 10)
    assert infos[0].k[0] == pytest.approx(240.0) and infos[3].k[0] == pytest.approx(480.0)


def test_the_definitions_are_those_of_ros():
    typesys = pytest.importorskip("rosbags.typesys", reason="needs rosbags: pip install rosbags")
    store = typesys.get_typestore(typesys.Stores.ROS2_HUMBLE)
    for kind, text in DEFINITIONS.items():
        own, *parts = text.split("=" * 80 + "\n")
        theirs, *their_parts = store.generate_msgdef(kind, ros_version=2)[0].split("=" * 80 + "\n")
        assert own.strip() == theirs.strip()
        assert {part.strip() for part in parts} == {part.strip() for part in their_parts}


def test_it_says_where_it_comes_from(written):
    reader = pytest.importorskip("mcap.reader", reason="needs the extra mcap: pip install 'rso-lidar[mcap]'")
    with written.open("rb") as stream:
        (record,) = reader.make_reader(stream).iter_metadata()
    assert record.metadata["scenario"] == SOURCE.scenario and record.metadata["seed"] == "20240917"
    told = json.loads(record.metadata["targets"])[0]
    assert (told["name"], told["mesh_sha256"]) == ("tdrs", "ab" * 32)
    assert told["parts"] == list(SOURCE.targets[0].parts)
    assert json.loads(record.metadata["versions"]) == SOURCE.versions


def test_a_recording_gives_the_same_as_its_frames(written, tmp_path):
    recorded = export.save(tmp_path / "run.h5", make_frames(COUNT))
    with export.open(recorded) as frames:
        path = write_mcap(tmp_path / "again.mcap", frames)
    for (topic, at, a), (other, time_ns, b) in zip(messages(written), messages(path), strict=True):
        assert (topic, at) == (other, time_ns)
        if topic != "/tf":  # whose quaternions go through the file once more
            assert str(a) == str(b)
            assert topic == "/lidar/camera_info" or (a.data == b.data).all()


FLY = f"""
import sys, time
sys.path.insert(0, {str(Path(__file__).parents[1])!r})
from frames_for_tests import make_frame
from rso_lidar.export.formats.mcap import write_mcap
def frames():
    for k in range(10_000):
        print(k, flush=True)
        time.sleep(0.002)
        yield make_frame(k, shape=(32, 32))
write_mcap(sys.argv[1], frames())
"""


@pytest.mark.skipif(sys.platform == "win32", reason="SIGKILL is POSIX")
def test_a_kill_loses_the_last_frames_only(tmp_path):
    pytest.importorskip("mcap_ros2.writer", reason="needs the extra mcap: pip install 'rso-lidar[mcap]'")
    from mcap.exceptions import McapError
    from mcap.records import Message
    from mcap.stream_reader import StreamReader

    child = subprocess.Popen([sys.executable, "-c", FLY, str(tmp_path / "run.mcap")], stdout=subprocess.PIPE, text=True)
    told = [int(child.stdout.readline()) for _ in range(30)]
    time.sleep(0.005)
    child.kill()
    rest, _ = child.communicate()
    told += [int(line) for line in rest.splitlines()]
    assert [file.name for file in tmp_path.iterdir()] == ["run.part.mcap"]  # never under its name
    stamps = []
    with (tmp_path / "run.part.mcap").open("rb") as stream:
        with contextlib.suppress(McapError):
            add_stamps(StreamReader(stream).records, stamps, Message)
    whole = [at for at in dict.fromkeys(stamps) if stamps.count(at) == len(TOPICS)]
    assert whole == [START_NS + k * 100_000_000 for k in range(len(whole))]
    assert max(told) - 6 <= len(whole) <= max(told) + 1  # chunks of four frames, and the one in hand


def add_stamps(records, stamps, kind):
    """Add the time of each message to a list, which keeps what came before the file ends."""
    stamps.extend(record.log_time for record in records if isinstance(record, kind))


@pytest.mark.parametrize(
    ("source", "message"),
    [
        ({"start_utc": "2039-01-01T00:00:00Z"}, "ROS stamps hold 1970 to 2038"),
        ({"start_utc": "1969-01-01T00:00:00Z"}, "ROS stamps hold 1970 to 2038"),
    ],
)
def test_instants_that_no_stamp_holds(tmp_path, source, message):
    pytest.importorskip("mcap_ros2.writer", reason="needs the extra mcap: pip install 'rso-lidar[mcap]'")
    with pytest.raises(RecordingError, match=message):
        write_mcap(tmp_path / "run.mcap", make_frames(2, source=dataclasses.replace(SOURCE, **source)))
    assert not list(tmp_path.iterdir())


def test_outputs_that_cannot_be(written):
    with pytest.raises(RecordingError, match="exists already; give --overwrite"):
        write_mcap(written, make_frames(2))
    with pytest.raises(RecordingError, match="there is no folder"):
        write_mcap(written.parent / "no" / "run.mcap", make_frames(2))
    with pytest.raises(RecordingError, match="no frames to write"):
        write_mcap(written, [], overwrite=True)
    assert len(messages(written)) == COUNT * len(TOPICS)


@pytest.mark.parametrize(
    "meddle", [lambda draft: os.truncate(draft, 1000), lambda draft: draft.unlink()], ids=["cut", "removed"]
)
def test_a_file_that_another_program_touched_is_not_published(tmp_path, meddle):
    pytest.importorskip("mcap_ros2", reason="needs the extra mcap: pip install 'rso-lidar[mcap]'")

    def flying():
        yield from make_frames(2)
        meddle(tmp_path / "a.part.mcap")
        yield make_frame(2)

    with pytest.raises(RunError, match=r"a\.mcap: not written: another program (truncated|removed)"):
        export.save(tmp_path / "a.mcap", flying())
    assert list(tmp_path.iterdir()) == []
