"""The live view for Rerun: a proxy on the loopback that a late viewer reads."""

import socket
import subprocess
import sys
import time

import pytest

import rso_lidar as rl
from rso_lidar.errors import ScenarioError
from rso_lidar.loop import RerunView
from rso_lidar.picture.viewers.rerun_scene import silence_analytics

chunk = pytest.importorskip("rerun.chunk", reason="the extra view is not installed")


@pytest.fixture(scope="module")
def scenario():
    from tests.conftest import BENCH

    return rl.Scenario.loads(BENCH.replace("[1000, 0, 0]", "[300, 0, 0]") + '\n[lidar.detector]\ntype = "empirical"\n')


def test_a_late_viewer_reads_the_scene(scenario, tmp_path):
    out = tmp_path / "late.rrd"
    with RerunView(scenario, "127.0.0.1:0") as view:
        for frame in rl.simulate(scenario, frames=range(2), threads=1):
            view.show(frame)
        while view.shown < 2:
            time.sleep(0.05)
        with silence_analytics() as environment:
            command = [sys.executable, "-m", "rerun", "--connect", view.url, "--save", str(out)]
            command += ["--port", "auto", "--bind", "127.0.0.1"]
            viewer = subprocess.Popen(command, env=environment, stderr=subprocess.DEVNULL)
            end = time.monotonic() + 30
            while time.monotonic() < end and (not out.exists() or out.stat().st_size < 20_000):
                time.sleep(0.1)
            viewer.terminate()
            viewer.wait()
        with pytest.raises(ScenarioError, match="cannot be opened"):
            RerunView(scenario, view.address.text)
    assert b"cloud" in out.read_bytes() and out.stat().st_size >= 20_000
    assert (view.shown, view.dropped) == (2, 0)
    with pytest.raises(ConnectionRefusedError):
        socket.create_connection((view.address.host, view.address.port), timeout=2)


def test_only_this_machine_can_connect(scenario):
    with pytest.raises(ScenarioError, match="opens only on this machine"):
        RerunView(scenario, "0.0.0.0:9876")
