"""Commands by processes and by dask: the same bytes as in one process, also where a worker is killed as it works."""

import contextlib
import os
import signal
import threading
import time
from pathlib import Path
from types import SimpleNamespace
from typing import ClassVar

import pytest

from rso_lidar import processes
from rso_lidar.study.trades import report
from tests.study.targeting.targeting_for_tests import HOLD, IMPULSES, rendezvous, write
from tests.study.trades.trade_for_tests import STUDY
from tests.study.verification.requirements_for_tests import FILE
from tests.test_processes import Elsewhere

EXAMPLE = Path("examples/dispersed_hop.toml").resolve()
TRADE = STUDY[: STUDY.rindex("[[axis]]")].replace(', "range_error_m", "time_in_field_s"', "")  # two points, one figure
COMMANDS = {
    "run": ("run", "run.toml", "-o", "{place}/out.h5"),
    "trade": ("trade", "study.toml", "-o", "{place}/out.csv"),
    "requirements": ("requirements", "reqs.toml", "bench.toml", "-o", "{place}/out.csv"),
    "requirements-study": ("requirements", "reqs.toml", "study.toml", "-o", "{place}/out.csv"),
    "budget": (
        *("budget", "gsfl_1064", "--set", 'lidar.detector.type="empirical"'),
        *("--find", "cubesat_3u", "--range", "1300m:1500m", "--attitudes", 4, "-o", "{place}/out.csv"),
    ),
    "targeter": ("targeter", "targeter.toml", "-o", "{place}/out.csv"),
    "timeline": ("timeline", "bench.toml", "-o", "{place}/out.csv"),
}
KEPT_OUT = (".html",)  # the report of a trade says when it was made


@pytest.fixture
def call(rso_lidar, text, tmp_path, monkeypatch):
    """Return a function that runs a command with options and returns the bytes of its outputs."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(report, "write_report", lambda *_: "a page")  # figures take longer than the work
    small = text.replace(" = 32", " = 16").replace("duration_s     = 2", "duration_s     = 1")
    write(tmp_path, rendezvous(), IMPULSES + HOLD)
    files = (("run.toml", text), ("bench.toml", small), ("study.toml", TRADE), ("reqs.toml", FILE))
    for name, content in files:
        (tmp_path / name).write_text(content, encoding="utf-8")

    def run(place, words, *options):
        (tmp_path / place).mkdir()
        status, _, said = rso_lidar(*(str(word).format(place=place) for word in words), *options)
        assert status in ((0, 1) if words[0] == "requirements" else (0,)), said
        written = sorted((tmp_path / place).iterdir())
        return {path.name: path.read_bytes() for path in written if path.suffix not in KEPT_OUT}

    return run


class Pool(Elsewhere):
    """Two threads in place of two processes, which are sent functions as processes are: by a file."""

    opened: ClassVar[list] = []

    def __init__(self, count):
        super().__init__()
        self.count, self.folder = count, Path.cwd()
        self.opened.append(self)


@pytest.mark.parametrize(
    "name",
    [
        "trade",
        "budget",
        "targeter",
        "timeline",
        *(pytest.param(name, marks=pytest.mark.slow) for name in ("requirements", "requirements-study")),
    ],
)
def test_engines_write_the_same_bytes(call, monkeypatch, name):
    """Each command gives its work to the pool or to the executor of the scheduler; `run`, below, to real processes."""
    executor = Elsewhere()

    @contextlib.contextmanager
    def open_client(scheduler, _workers):
        assert scheduler == "tcp://there:1"
        yield SimpleNamespace(get_executor=lambda: executor)

    alone = call("alone", COMMANDS[name])
    monkeypatch.setattr(Pool, "opened", [])
    monkeypatch.setattr(processes, "Processes", Pool)
    monkeypatch.setattr(processes, "open_dask_client", open_client)
    assert alone == call("pool", COMMANDS[name], "--workers", 2)
    (pool,) = Pool.opened
    assert pool.count == 2 and pool.submitted > 1
    with executor:
        assert alone == call("dask", COMMANDS[name], "--engine", "dask", "--scheduler", "tcp://there:1")
    assert executor.submitted > 1


@pytest.fixture
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
def test_processes_write_the_same_bytes_also_where_a_worker_is_killed(call, cluster):
    alone = call("alone", COMMANDS["run"])
    assert alone == call("pool", COMMANDS["run"], "--workers", 2)
    with killing_a_worker(cluster) as killed:
        by_dask = call("dask", COMMANDS["run"], "--engine", "dask", "--scheduler", cluster.scheduler_address)
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
