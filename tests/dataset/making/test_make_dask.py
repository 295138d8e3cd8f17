"""Dask: the same bytes as one process, also where its workers are killed as they work."""

import os
import signal
import subprocess
import sys
import threading
import time

import pytest

import rso_lidar as rl
from rso_lidar import processes
from tests.dataset.making.test_make import hashes


@pytest.mark.slow
def test_killed_workers_lose_nothing(made, tmp_path):
    distributed = pytest.importorskip("distributed", reason="needs the extra dask: pip install 'rso-lidar[dask]'")
    dataset, spec = made
    killed = []
    with distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address="127.0.0.1:0") as cluster:

        def kill(done: int, _count: int) -> None:
            if done in (0, 2):  # while the others are at work
                threading.Timer(0.3, strike).start()

        def strike() -> None:
            worker = next(iter(cluster.workers.values()))
            if worker.pid is not None:
                killed.append(worker.pid)
                os.kill(worker.pid, signal.SIGKILL)

        rl.dataset.make(spec, tmp_path / "made", scheduler=cluster.scheduler_address, on_shard=kill)
        until = time.monotonic() + 5.0
        while len(killed) < 1 and time.monotonic() < until:
            time.sleep(0.05)
    assert killed and hashes(tmp_path / "made") == hashes(dataset.folder)
    assert not list((tmp_path / "made").glob("**/*.part*"))


RAISING = """
from rso_lidar.processes import open_dask_client

if __name__ == "__main__":
    with open_dask_client("local", 1) as client:
        assert client.get_executor().submit(int, "one").exception() is not None
"""


@pytest.mark.slow
def test_dask_prints_nothing_of_what_a_call_raises(tmp_path):
    pytest.importorskip("distributed", reason="needs the extra dask: pip install 'rso-lidar[dask]'")
    (tmp_path / "script.py").write_text(RAISING)
    ended = subprocess.run(
        [sys.executable, tmp_path / "script.py"], capture_output=True, text=True, timeout=120, check=False
    )
    assert ended.returncode == 0 and not ended.stdout + ended.stderr


def test_a_scheduler_that_does_not_answer(made, tmp_path, monkeypatch):
    pytest.importorskip("distributed", reason="needs the extra dask: pip install 'rso-lidar[dask]'")
    monkeypatch.setattr(processes, "_CONNECT_S", "0.2s")
    with pytest.raises(rl.ScenarioError, match="no scheduler answers"):
        rl.dataset.make(made[1], tmp_path / "made", scheduler="tcp://127.0.0.1:9")


def test_dask_that_is_not_installed(made, tmp_path, monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "dask", None)
    with pytest.raises(rl.ScenarioError, match=r"rso-lidar\[dask\]"):
        rl.dataset.make(made[1], tmp_path / "made", scheduler="local")
