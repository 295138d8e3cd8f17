"""The live view, watched by a websocket client on the loopback."""

import base64
import json
import struct
import threading
import time

import numpy as np
import pytest

import rso_lidar as rl
from rso_lidar.errors import RecordingError, ScenarioError
from rso_lidar.loop import LiveView
from rso_lidar.loop.live import queued_view
from rso_lidar.loop.live.frame_messages import WRITERS, stamp_of
from rso_lidar.picture import Stretch

pytest.importorskip("foxglove", reason="the extra live is not installed")
client = pytest.importorskip("websockets.sync.client", reason="websockets is not installed")

FREE = "127.0.0.1:0"
DATA = struct.Struct("<BIQ")  # opcode 1, subscription, log time; the message follows
TOPICS = {*WRITERS, "/targets"}
LENS = {"fov_deg": 20, "f_number": 4, "n_rows": 6, "n_cols": 8}
OF_CAMERAS = {"/nav/image", "/nav/calibration", "/wide/image", "/wide/calibration"}


class Viewer:
    """A viewer that subscribes to some topics, and collects what comes."""

    def __init__(self, url, topics=TOPICS, count=None):
        self.connection = client.connect(url, subprotocols=["foxglove.sdk.v1"], max_size=None, close_timeout=0.2)
        self.socket = self.connection.__enter__()
        self.channels = {}
        while len(self.channels) < (count or len(TOPICS)):
            tree = json.loads(self.receive_text())
            if tree["op"] == "advertise":
                self.channels |= {one["topic"]: one for one in tree["channels"]}
        asked = [{"id": one["id"], "channelId": one["id"]} for name, one in self.channels.items() if name in topics]
        self.socket.send(json.dumps({"op": "subscribe", "subscriptions": asked}))
        self.topic_of = {one["id"]: name for name, one in self.channels.items()}

    def receive_text(self):
        while isinstance(got := self.socket.recv(timeout=20), bytes):
            pass
        return got

    def receive(self, count):
        """Return messages by topic until there are `count`: lists of log time and payload."""
        found = {}
        while sum(map(len, found.values())) < count:
            got = self.socket.recv(timeout=20)
            if isinstance(got, bytes) and got[0] == 1:
                _, subscription, stamp = DATA.unpack_from(got)
                found.setdefault(self.topic_of[subscription], []).append((stamp, got[DATA.size :]))
        return found


@pytest.fixture(scope="module")
def scenario():
    from tests.conftest import BENCH

    return rl.Scenario.loads(BENCH.replace("[1000, 0, 0]", "[300, 0, 0]") + '\n[lidar.detector]\ntype = "empirical"\n')


@pytest.fixture(scope="module")
def frames(scenario):
    return list(rl.simulate(scenario, frames=range(3)))


@pytest.fixture
def watch():
    """Return a function that connects a viewer, which leaves at the end of the test."""
    viewers = []

    def connect(*given):
        viewers.append(Viewer(*given))
        return viewers[-1]

    yield connect
    for viewer in viewers:
        viewer.connection.__exit__(None, None, None)


def wait_until(true):
    end = time.monotonic() + 20
    while not true():
        assert time.monotonic() < end
        time.sleep(0.01)


def test_a_viewer_sees_what_the_sensor_said(scenario, frames, watch):
    with LiveView(scenario, FREE) as view:
        viewer = watch(view.url)
        wait_until(lambda: all(channel.has_sinks() for channel in view._channels.values()))
        view.show(frames[0])
        found = viewer.receive(len(TOPICS))
        assert found.keys() == TOPICS
        assert {stamp for one in found.values() for stamp, _ in one} == {stamp_of(frames[0])}
        assert np.ascontiguousarray(frames[0].range_m, "<f4").tobytes() in found["/lidar/range"][0][1]
        assert np.ascontiguousarray(frames[0].intensity_counts, "<u2").tobytes() in found["/lidar/intensity"][0][1]
        points = np.column_stack([frames[0].points_m[frames[0].valid], frames[0].intensity_counts[frames[0].valid]])
        assert points.astype("<f4").tobytes() in found["/lidar/points"][0][1]
        for name in (b"plate", b"follower", b"ptu", b"lidar"):
            assert name in found["/tf"][0][1]
        angles = json.loads(found["/ptu"][0][1])
        assert angles["pan_measured_rad"] == pytest.approx(frames[0].observation.pan_tilt_rad[0])
        assert b"frame 0: 0 s" in found["/log"][0][1]
        assert b"model/stl" in found["/targets"][0][1]
        assert viewer.channels["/lidar/points"]["schemaName"] == "foxglove.PointCloud"
        assert b"PointCloud" in base64.b64decode(viewer.channels["/lidar/points"]["schema"])
    assert (view.shown, view.dropped) == (1, 0)


def test_a_viewer_sees_the_images_of_cameras_with_their_pinholes(scenario, watch):
    cameras = [{"name": "nav", "bands": "rgb", "lens": LENS}, {"name": "wide", "lens": LENS | {"fov_deg": 90}}]
    flown = scenario.replace(camera=cameras)
    (frame,) = rl.simulate(flown, frames=[1])
    with LiveView(flown, FREE) as view:
        viewer = watch(view.url, OF_CAMERAS | {"/tf"}, len(TOPICS) + 4)
        wait_until(lambda: all(view._channels[topic].has_sinks() for topic in OF_CAMERAS))
        view.show(frame)
        seen = viewer.receive(5)
    assert seen.keys() == OF_CAMERAS | {"/tf"}
    assert {stamp for messages in seen.values() for stamp, _ in messages} == {stamp_of(frame)}
    assert all(name in seen["/tf"][0][1] for name in (b"nav", b"wide"))
    counts = {name: image.intensity_counts for name, image in frame.camera.items()}
    ((_, image),) = seen["/wide/image"]
    assert counts["wide"].tobytes() in image and b"mono16" in image and b"wide" in image
    ((_, image),) = seen["/nav/image"]
    assert Stretch.of("nav", frame).paint(counts["nav"]).tobytes() in image and b"rgb8" in image
    ((_, calibration),) = seen["/wide/calibration"]
    # Half of 8 columns see half of 90 degrees: a focal length of 4 pixels; (0, 0) is the centre of the first pixel.
    focal = 4.0 / np.tan(np.deg2rad(45.0))
    assert np.array([focal, 0, 3.5, 0, focal, 2.5, 0, 0, 1]).tobytes() in calibration


def test_a_late_viewer_sees_the_scene_and_the_latest_frame(scenario, frames, watch):
    with LiveView(scenario, FREE) as view:
        for frame in frames[:2]:
            view.show(frame)
        wait_until(lambda: view.shown == 2)
        early = watch(view.url, {"/log"})
        assert b"frame 1:" in early.receive(1)["/log"][0][1]
        late = watch(view.url)
        found = late.receive(len(TOPICS))
        assert found.keys() == TOPICS and b"frame 1:" in found["/log"][0][1]
        view.show(frames[2])
        assert b"frame 2:" in early.receive(1)["/log"][0][1]  # and not frame 1 again
        assert "/targets" not in late.receive(len(TOPICS) - 1)  # the meshes do not change


def test_a_slow_view_drops_frames_and_delays_no_one(scenario, frames, monkeypatch):
    release = threading.Event()
    monkeypatch.setattr(LiveView, "_publish", lambda self, frame: release.wait(20))
    with LiveView(scenario, FREE) as view:
        view.show(frames[0])
        wait_until(lambda: view._is_busy)
        for k in range(20):
            view.show(frames[k % 3])
        assert view.dropped == 20 - 4
        release.set()
    assert view.shown + view.dropped == 21


def test_a_viewer_that_does_not_read_delays_no_one(scenario, frames, watch):
    with LiveView(scenario, FREE) as view:
        watch(view.url)  # which reads nothing more
        for _ in range(60):
            view.show(frames[0])
            wait_until(lambda: not view._waiting)
        assert view.shown >= 59 and view.dropped == 0
    view.show(frames[0])  # after the end: ignored
    view.close()
    assert view.shown == 60


def test_a_frame_that_cannot_be_shown_ends_nothing(scenario, frames, monkeypatch):
    def fail(self, frame):
        raise ValueError("no such field")

    monkeypatch.setattr(LiveView, "_publish", fail)
    told = []
    monkeypatch.setattr(queued_view, "warn", told.append)
    with LiveView(scenario, FREE) as view:
        view.show(frames[0])
        view.show(frames[1])
    assert view.shown == 2 and told[0] == "live view: frame 0 could not be shown (no such field)"


def test_only_this_machine_can_connect(scenario):
    for address in ("0.0.0.0:8765", "192.168.1.5:8765", "[::]:8765"):
        with pytest.raises(ScenarioError, match=r"opens only on this machine; give 127\.0\.0\.1:8765"):
            LiveView(scenario, address)
    with LiveView(scenario, FREE) as view, pytest.raises(ScenarioError, match="cannot be opened"):
        LiveView(scenario, view.address.text)


def test_a_missing_library_is_said(scenario, monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "foxglove", None)
    with pytest.raises(RecordingError, match=r"pip install rso-lidar\[live\]"):
        LiveView(scenario, FREE)
