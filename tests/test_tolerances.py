"""The list of tolerances that rounding could exceed holds those that it should, and no others."""

import ast

import numpy as np
import pytest

from tests.tolerances import Inequalities, Recorder, compare_runs


@pytest.mark.parametrize(("moved", "is_listed"), [(0.0, False), (0.05, False), (0.2, True), (2.0, True)])
def test_what_moves_by_more_than_a_tenth_of_what_is_left_is_listed(moved, is_listed, tmp_path):
    """|3 - 1| against a tolerance of 2.5 leaves 0.5; where the other run has 3 + moved x 0.4, 0.5 - 0.4 moved is left."""
    runs = []
    for actual in (3.0, 3.0 + 0.4 * moved):
        recorder = Recorder(tmp_path)
        recorder.note_close(np.array([1.0, actual]), np.array([1.0, 1.0]), 0.5, 2.0)
        runs.append({("a test", place): noted for place, noted in recorder.records.items()})
    lines = compare_runs(*runs)
    assert bool(lines) == is_listed
    assert all("test_tolerances.py:" in line and "a test" in line for line in lines)


def test_inequalities_of_assertions_are_recorded_and_mean_what_they_meant(tmp_path):
    source = "assert not 1.5 < x < 4.0 or x <= 2.25\nchosen = x > 9.0"
    tree = Inequalities().visit(ast.parse(source))
    recorder = Recorder(tmp_path)
    named = {"__compare__": recorder.compare, "__Lt__": lambda a, b: a < b, "__LtE__": lambda a, b: a <= b}
    for x in (1.0, 2.0, 5.0):
        exec(compile(tree, __file__, "exec"), {"x": x, **named})
    with pytest.raises(AssertionError):
        exec(compile(tree, __file__, "exec"), {"x": 3.0, **named})
    (noted,) = [noted for place, noted in recorder.records.items() if place.endswith("test_tolerances.py:1")]
    # 1.5 - x; x - 4 where the first holds; x - 2.25 where both hold
    assert [float(apart[0]) for apart, _ in noted] == [0.5, -0.5, -2.0, -0.25, -3.5, 1.0, -1.5, -1.0, 0.75]
