"""Which arithmetic is used, who may choose, and how it is told."""

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
