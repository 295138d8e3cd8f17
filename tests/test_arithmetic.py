"""Which arithmetic is used, who may choose, and how it is told."""

import sys

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
