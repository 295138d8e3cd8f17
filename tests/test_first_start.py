"""The first start: a second process compiles just what a flash calls after its cast, once, where there is nothing yet."""

import os
import subprocess
import sys

import pytest

import rso_lidar as rl
from rso_lidar import first_start, kernels
from rso_lidar.kernels import Kernel

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


@pytest.fixture
def started(monkeypatch):
    found = []
    monkeypatch.setattr(subprocess, "Popen", lambda command, **_: found.append(command) or "process")
    monkeypatch.setattr(os, "cpu_count", lambda: 2)
    first_start.compile_ahead.cache_clear()
    yield found
    first_start.compile_ahead.cache_clear()


def test_a_second_process_starts_once_where_nothing_is_compiled(started, monkeypatch):
    monkeypatch.setattr(kernels, "has_machine_code", lambda: False)
    assert first_start.compile_ahead() == first_start.compile_ahead() == "process"
    assert len(started) == 1 and started[0][0] == sys.executable


@pytest.mark.parametrize("has_code", [True, None])
def test_no_process_starts_where_loops_are_compiled_or_cannot_be_kept(started, monkeypatch, has_code):
    monkeypatch.setattr(kernels, "has_machine_code", lambda: has_code)
    assert first_start.compile_ahead() is None and not started


@pytest.mark.parametrize("without", ["a second core", "an interpreter"])
def test_no_process_starts_without(started, monkeypatch, without):
    monkeypatch.setattr(kernels, "has_machine_code", lambda: False)
    if without == "a second core":
        monkeypatch.setattr(os, "cpu_count", lambda: 1)
    else:
        monkeypatch.setattr(sys, "executable", "/opt/flight/simulator")
    assert first_start.compile_ahead() is None and not started


def test_machine_code_is_found_where_it_is_kept(tmp_path, monkeypatch):
    store = kernels._Store()
    store.root = tmp_path
    monkeypatch.setattr(kernels, "_store", store)
    assert kernels.has_machine_code() is False
    (tmp_path / "one").mkdir()
    (tmp_path / "one" / "loop.nbi").touch()
    assert kernels.has_machine_code() is True
    store.is_used = False
    assert kernels.has_machine_code() is None
