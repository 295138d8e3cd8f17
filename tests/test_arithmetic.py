"""Which arithmetic is used, who may choose, and how it is told."""

import subprocess
import sys

import numpy as np
import pytest

import rso_lidar as rl
from rso_lidar import arithmetic
from rso_lidar.errors import RsoLidarError, RsoLidarWarning


def test_the_variable_chooses(monkeypatch):
    monkeypatch.setenv(arithmetic.VARIABLE, "numpy")
    assert arithmetic.chosen() == "numpy"
    assert not arithmetic.compiled()
    assert arithmetic.name() == "numpy"
    monkeypatch.delenv(arithmetic.VARIABLE)
    assert arithmetic.compiled()
    assert arithmetic.name().startswith("numba ")


def test_an_unknown_arithmetic_is_refused(monkeypatch):
    monkeypatch.setenv(arithmetic.VARIABLE, "fortran")
    with pytest.raises(RsoLidarError, match="RSO_LIDAR_ARITHMETIC: unknown arithmetic 'fortran'; known: numba, numpy"):
        arithmetic.compiled()


def test_using_puts_back_what_was_chosen(monkeypatch):
    monkeypatch.setenv(arithmetic.VARIABLE, "numpy")
    with arithmetic.using("numba"):
        assert arithmetic.chosen() == "numba"
    assert arithmetic.chosen() == "numpy"
    with pytest.raises(RsoLidarError, match="unknown"), arithmetic.using("nothing"):
        pass
    assert arithmetic.chosen() == "numpy"


def test_without_numba_numpy_does_the_work_and_it_is_said(monkeypatch):
    monkeypatch.setitem(sys.modules, "numba", None)  # as if it could not be imported
    arithmetic._numba.cache_clear()
    try:
        with pytest.warns(RsoLidarWarning, match="numba: cannot be imported .*; NumPy does its work, more slowly"):
            assert not arithmetic.compiled()
        assert arithmetic.name() == "numpy"
    finally:
        arithmetic._numba.cache_clear()


def test_a_loop_does_what_its_function_does():
    def total(values):
        found = 0.0
        for value in values:
            found += value
        return found

    values = np.linspace(0.1, 0.9, 101)
    made = arithmetic.loop(total)
    assert made(values) == total(values)  # in the order written, to the bit


@pytest.mark.parametrize("path", arithmetic.CHOICES)
def test_a_recording_names_the_path(text, path):
    with arithmetic.using(path):
        scenario = rl.Scenario.loads(text)
        assert scenario.source.versions["arithmetic"].startswith(path)


def test_one_scenario_names_the_path_of_each_flight(text):
    scenario = rl.Scenario.loads(text)
    with arithmetic.using("numba"):
        compiled = next(rl.simulate(scenario, frames=[0]))
    with arithmetic.using("numpy"):
        reference = next(rl.simulate(scenario, frames=[0]))
    assert compiled.source.versions["arithmetic"].startswith("numba")
    assert reference.source.versions["arithmetic"] == "numpy"


LOOP = """
from rso_lidar.arithmetic import loop
from {package}.constants import LIGHT


@loop
def doubled(x):
    return x * LIGHT
"""


def test_machine_code_is_made_anew_when_an_imported_module_changes(tmp_path):
    package = tmp_path / "room_of_loops"
    package.mkdir()
    (package / "__init__.py").touch()
    (package / "some_loops.py").write_text(LOOP.format(package=package.name))
    asked = "import room_of_loops.some_loops as some; print(some.doubled(1.0), len(some.doubled.stats.cache_hits))"

    def answer():
        done = subprocess.run([sys.executable, "-c", asked], cwd=tmp_path, capture_output=True, text=True, check=True)
        return done.stdout.split()

    (package / "constants.py").write_text("LIGHT = 2.0\n")
    assert answer() == ["2.0", "0"]
    assert answer() == ["2.0", "1"]  # read from disk
    (package / "constants.py").write_text("LIGHT = 30.0\n")
    assert answer() == ["30.0", "0"]


@pytest.mark.parametrize("suffix", [".nbi", ".nbc"])
def test_damaged_machine_code_is_made_anew(tmp_path, suffix):
    (tmp_path / "other_loops.py").write_text(
        LOOP.format(package="constants").replace("constants.constants", "constants")
    )
    (tmp_path / "constants.py").write_text("LIGHT = 2.0\n")
    asked = "import other_loops as some; print(some.doubled(1.0), len(some.doubled.stats.cache_hits))"

    def answer():
        return subprocess.run([sys.executable, "-c", asked], cwd=tmp_path, capture_output=True, text=True, check=True)

    answer()
    for file in (tmp_path / "__pycache__").glob(f"*{suffix}"):
        file.write_bytes(file.read_bytes()[:20])
    again = answer()
    assert again.stdout.split() == ["2.0", "0"]
    assert "cannot be read or kept" in again.stderr


def test_compiling_is_told_once():
    told = []

    def plus(x):
        return x + 1

    made = arithmetic.loop(plus)
    with arithmetic.watch_compiling(lambda: told.append("compiling")):
        assert made(1) == 2
        assert made(1.0) == 2.0
    assert told == ["compiling"]
    assert made(1j) == 1 + 1j
    assert told == ["compiling"], "outside nobody listens"
