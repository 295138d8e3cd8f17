"""Commands by processes and by dask: the same bytes as in one process, also where a worker is killed as it works."""

import contextlib
import os
import signal
import threading
import time
from pathlib import Path

import pytest

from tests.study.trades.trade_for_tests import STUDY
from tests.study.verification.requirements_for_tests import FILE

EXAMPLE = Path("examples/dispersed_hop.toml").resolve()
COMMANDS = {
    "run": ("run", "bench.toml", "-o", "{place}/out.h5"),
    "trade": ("trade", "study.toml", "-o", "{place}/out.csv"),
    "requirements": ("requirements", "reqs.toml", "bench.toml", "-o", "{place}/out.csv"),
    "requirements-study": ("requirements", "reqs.toml", "study.toml", "-o", "{place}/out.csv"),
    "budget": (
        "budget",
        "gsfl_1064",
        "--find",
        "cubesat_3u",
        "--range",
        "1300m:1500m",
        "--attitudes",
        16,
        "-o",
        "{place}/out.csv",
    ),
    "timeline": ("timeline", "bench.toml", "-o", "{place}/out.csv"),
}
KILLED = ("run", "trade")  # a worker under these; the others go the same way, and a new worker takes seconds
KEPT_OUT = (".html",)  # the report of a trade says when it was made


@pytest.fixture
def call(rso_lidar, text, tmp_path, monkeypatch):
    """Return a function that runs a command with options and returns the bytes of its outputs."""
    monkeypatch.chdir(tmp_path)
    for name, content in (("bench.toml", text), ("study.toml", STUDY), ("reqs.toml", FILE)):
        (tmp_path / name).write_text(content, encoding="utf-8")

    def run(place, words, *options):
        (tmp_path / place).mkdir()
        status, _, said = rso_lidar(*(str(word).format(place=place) for word in words), *options)
        assert status in ((0, 1) if words[0] == "requirements" else (0,)), said
        written = sorted((tmp_path / place).iterdir())
        return {path.name: path.read_bytes() for path in written if path.suffix not in KEPT_OUT}

    return run


@pytest.fixture(scope="module")
def cluster():
    distributed = pytest.importorskip("distributed", reason="needs the extra dask: pip install 'rso-lidar[dask]'")
    with distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address="127.0.0.1:0") as cluster:
        yield cluster


@contextlib.contextmanager
def killing_a_worker(cluster):
    """Kill the first worker that has a call of the command; yield the list of those killed."""
    killed, over = [], threading.Event()

    def watch():
        while not killed and not over.is_set():
            for task in list(cluster.scheduler.tasks.values()):
                if str(task.key).startswith("_call") and (busy := task.processing_on) is not None:
                    nannies = [it for it in cluster.workers.values() if it.worker_address == busy.address]
                    if nannies and nannies[0].pid is not None:
                        killed.append(nannies[0].pid)
                        os.kill(nannies[0].pid, signal.SIGKILL)
                        return
            time.sleep(0.001)

    watching = threading.Thread(target=watch)
    watching.start()
    try:
        yield killed
    finally:
        over.set()
        watching.join()


@pytest.mark.slow
@pytest.mark.parametrize("name", COMMANDS)
def test_engines_write_the_same_bytes_also_where_a_worker_is_killed(call, cluster, name):
    alone = call("alone", COMMANDS[name])
    assert alone == call("pool", COMMANDS[name], "--workers", 2)
    with killing_a_worker(cluster) if name in KILLED else contextlib.nullcontext([name]) as killed:
        by_dask = call("dask", COMMANDS[name], "--engine", "dask", "--scheduler", cluster.scheduler_address)
    assert killed and alone == by_dask


@pytest.mark.parametrize("name", [*COMMANDS, "disperse"])
@pytest.mark.parametrize(
    ("options", "said"),
    [
        (("--engine", "dusk"), "--engine dusk: is not an engine; did you mean 'dask'"),
        (("--scheduler", "local"), "--scheduler local: is for --engine dask; add it, or leave out --scheduler"),
        (("--engine", "dask", "--scheduler", "tcp://127.0.0.1:9"), "no scheduler answers"),
    ],
)
def test_engines_that_cannot_be_taken_are_told_in_one_line(rso_lidar, call, monkeypatch, tmp_path, name, options, said):
    monkeypatch.setattr("rso_lidar.processes._CONNECT_S", "0.05s")
    words = COMMANDS.get(name, ("disperse", EXAMPLE))
    if "tcp://127.0.0.1:9" in options:
        pytest.importorskip("distributed", reason="needs the extra dask: pip install 'rso-lidar[dask]'")
    before = sorted(tmp_path.iterdir())
    status, printed, errors = rso_lidar(*(str(word).format(place=".") for word in words), *options)
    assert (status, printed, len(errors)) == (2, "", 1)
    assert said in errors[0]
    assert sorted(tmp_path.iterdir()) == before


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (
            ("run", "bench.toml", "-o", "x.h5", "--threads", 2, "--engine", "dask"),
            "--threads and --engine dask: frames are",
        ),
        (("run", "bench.toml", "-o", "x.h5", "--threads", 2, "--workers", 2), "--threads and --workers: frames are"),
        (("requirements", "reqs.toml", "none.h5", "--workers", 2), "--workers: is for a scenario or a study"),
        (("requirements", "reqs.toml", "none.h5", "--engine", "dask"), "--engine dask: is for a scenario or a study"),
        (("budget", "gsfl_1064", "--workers", 2), "--workers: is for a whole body"),
        (("budget", "gsfl_1064", "--engine", "dask"), "--engine: is for a whole body"),
    ],
)
def test_engines_without_work_are_told_in_one_line(rso_lidar, call, words, said):
    status, printed, errors = rso_lidar(*words)
    assert (status, printed, len(errors)) == (2, "", 1)
    assert errors[0].startswith(said) or said in errors[0]
