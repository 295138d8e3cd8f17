"""The first start: a second process compiles just what a flash calls after its cast, once, where there is nothing yet."""

import functools
import io
import os
import subprocess
import sys

import pytest

import rso_lidar as rl
from rso_lidar import kernels
from rso_lidar.detector import multiply_rows
from rso_lidar.kernels import Kernel
from rso_lidar.simulation import first_start

BEHIND_THE_CAST = ("rso_lidar.optics.returns", "rso_lidar.detector", "rso_lidar.scene.labels")


@pytest.fixture
def called(monkeypatch):
    """Record the loops behind the cast that Python calls, with the types that they are compiled for."""
    import numba

    found = set()
    call = Kernel.__call__

    def record(self, *arguments):
        if self.function.__module__.startswith(BEHIND_THE_CAST):
            found.add((self.function.__name__, *(str(numba.typeof(one)) for one in arguments)))
        return call(self, *arguments)

    monkeypatch.setattr(Kernel, "__call__", record)
    return found


def test_it_compiles_what_a_flash_calls_after_its_cast(called):
    """Each loop for the same types; a flash may call fewer, where no pixel has two pulses, or none fires falsely."""
    list(rl.simulate(rl.Scenario.load("examples/tdrs_approach.toml"), frames=[539], threads=1))
    of_a_flash = set(called)
    called.clear()
    first_start.compile_detection()
    assert len(of_a_flash) > 10
    assert of_a_flash <= called


class Process:
    def __init__(self):
        self.stdin = io.BytesIO()

    def wait(self):
        return 0


@pytest.fixture
def started(monkeypatch):
    found = []
    monkeypatch.setattr(subprocess, "Popen", lambda command, **_: found.append(command) or Process())
    monkeypatch.setattr(first_start, "compile_ahead", functools.cache(first_start.compile_ahead.__wrapped__))
    return found


def test_a_second_process_starts_once_where_nothing_is_compiled(started, monkeypatch):
    monkeypatch.setattr(kernels, "has_machine_code", lambda _: False)
    first_start.compile_ahead()
    first_start.compile_ahead()
    assert len(started) == 1 and started[0][0] == sys.executable


@pytest.mark.parametrize("has_code", [True, None])
def test_no_process_starts_where_loops_are_compiled_or_cannot_be_kept(started, monkeypatch, has_code):
    monkeypatch.setattr(kernels, "has_machine_code", lambda _: has_code)
    first_start.compile_ahead()
    assert not started


def test_no_process_starts_without_an_interpreter(started, monkeypatch):
    monkeypatch.setattr(kernels, "has_machine_code", lambda _: False)
    monkeypatch.setattr(sys, "executable", "/opt/flight/simulator")
    first_start.compile_ahead()
    assert not started


def test_the_command_runs_and_imports_nothing_of_the_current_folder(tmp_path):
    """A child whose parent stays compiles to its end; with everything on disk that takes a second or two."""
    (tmp_path / "numpy.py").write_text("raise SystemExit(3)")
    command = [sys.executable, *first_start._COMMAND]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stderr=subprocess.PIPE, cwd=tmp_path) as child:
        assert child.wait() == 0, child.stderr.read()


def test_the_pipe_to_the_second_process_is_closed():
    process = Process()
    first_start._wait_for(process)
    assert process.stdin.closed


def test_the_second_process_ends_with_the_first(tmp_path):
    """Standard input is closed as the parent ends. With an empty cache, compiling takes longer than this test may."""
    command, cache = [sys.executable, *first_start._COMMAND], {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path)}
    with subprocess.Popen(command, stdin=subprocess.PIPE, stderr=subprocess.PIPE, env=cache) as child:
        child.stdin.close()
        assert child.wait() == 1, child.stderr.read()


def test_machine_code_is_found_where_it_is_kept(tmp_path, monkeypatch):
    store = kernels._Store()
    store.root = tmp_path
    monkeypatch.setattr(kernels, "_store", store)
    assert kernels.has_machine_code(multiply_rows) is False
    folder = kernels._folder_of(multiply_rows)
    folder.mkdir()
    (folder / "loop.nbi").touch()
    assert kernels.has_machine_code(multiply_rows) is True
    store.is_used = False
    assert kernels.has_machine_code(multiply_rows) is None
