"""The folder that ROS 2 plays, opened by rosbags, which needs its metadata.yaml."""

import sys

import pytest
from frames_for_tests import make_frames

from rso_lidar import export
from rso_lidar.errors import RecordingError
from rso_lidar.export.formats.mcap import TOPICS, write_mcap
from rso_lidar.export.formats.rosbag2 import write_rosbag2

COUNT = 5
START_NS, STEP_NS = 1726574400 * 10**9, 100_000_000


def messages(path):
    """Return what rosbags reads: (topic, time, bytes) in order; and the reader's counts."""
    rosbags = pytest.importorskip("rosbags.highlevel", reason="needs rosbags: pip install rosbags")
    typesys = pytest.importorskip("rosbags.typesys", reason="needs rosbags: pip install rosbags")
    store = typesys.get_typestore(typesys.Stores.ROS2_HUMBLE)
    with rosbags.AnyReader([path], default_typestore=store) as reader:
        counts = {topic: info.msgcount for topic, info in reader.topics.items()}
        span = (reader.start_time, reader.duration, reader.message_count)
        return [(c.topic, at, bytes(raw)) for c, at, raw in reader.messages()], counts, span


@pytest.fixture
def written(tmp_path):
    pytest.importorskip("mcap_ros2.writer", reason="needs the extra mcap: pip install 'rso-lidar[mcap]'")
    return export.save(tmp_path / "run.rosbag2", make_frames(COUNT))


def test_the_folder_holds_what_the_file_holds(written, tmp_path):
    assert sorted(entry.name for entry in written.iterdir()) == ["metadata.yaml", "run_0.mcap"]
    read, counts, (start_ns, lasts_ns, count) = messages(written)
    assert counts == dict.fromkeys(TOPICS, COUNT)
    # rosbags adds a nanosecond, as the end of what lasts is not in it.
    assert (start_ns, lasts_ns - 1, count) == (START_NS, (COUNT - 1) * STEP_NS, COUNT * len(TOPICS))
    assert read == messages(write_mcap(tmp_path / "run.mcap", make_frames(COUNT)))[0]


def test_an_older_one_is_replaced_only_on_demand(written):
    with pytest.raises(RecordingError, match="exists already"):
        write_rosbag2(written, make_frames(2))
    write_rosbag2(written, make_frames(2), overwrite=True)
    assert messages(written)[2][2] == 2 * len(TOPICS)
    (written / "notes.txt").write_text("mine")
    with pytest.raises(RecordingError, match=r"holds notes\.txt, which is not an export of rso_lidar"):
        write_rosbag2(written, make_frames(2), overwrite=True)


def test_what_fails_leaves_nothing(tmp_path, monkeypatch):
    with pytest.raises(RecordingError, match="no frames to write"):
        write_rosbag2(tmp_path / "run.rosbag2", [])
    monkeypatch.setitem(sys.modules, "mcap_ros2.writer", None)
    with pytest.raises(RecordingError, match=r"needs an extra: pip install rso-lidar\[mcap\]"):
        write_rosbag2(tmp_path / "run.rosbag2", make_frames(2))
    assert not list(tmp_path.iterdir())
