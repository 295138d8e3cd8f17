"""Optional members of users' objects: read and checked where they enter."""

import numpy as np
import pytest

from rso_lidar.errors import ScenarioError
from rso_lidar.part import Part, call_member, check_lines, check_text, check_values, read_member, to_real_array


class Own:
    size = 3

    def double(self, value):
        return 2 * value

    def __repr__(self):
        return "Own()"


class Shipped(Part):
    size: float = 2.5


def test_a_member_is_read_where_there_is_one():
    assert read_member(Own(), "size", 1, int, "make it whole") == 3
    assert read_member(Own(), "weight", 1, int, "make it whole") == 1
    assert read_member(Shipped(), "size", 1, int, "make it whole") == 2.5  # a part is checked where it is made
    with pytest.raises(ScenarioError, match=r"Own\(\): size is 3; make it text$"):
        read_member(Own(), "size", "", str, "make it text")
    with pytest.raises(ScenarioError, match=r"Own\(\): double is a method; make it text$"):
        read_member(Own(), "double", "", str, "make it text")


def test_a_method_is_called_where_there_is_one():
    assert call_member(Own(), "double", 4) == 8
    assert call_member(Own(), "halve", 4, default="none") == "none"
    with pytest.raises(ScenarioError, match=r"Own\(\): size is 3; make it a method, or rename it"):
        call_member(Own(), "size", 4)


def test_lines_and_texts():
    assert check_lines(Own(), "say", ("a", "b\nc")) == ["a", "b c"]
    assert check_text(Own(), "say", "a\nb") == "a b"
    for found in (None, "text", 3, [None], {"a": 1}):
        with pytest.raises(ScenarioError, match=r"Own\(\): say\(\) returned .*; return a list of texts"):
            check_lines(Own(), "say", found)
    with pytest.raises(ScenarioError, match=r"say\(\) returned \['a'\]; return a text"):
        check_text(Own(), "say", ["a"])


def test_numbers_have_a_shape_and_limits():
    shares = check_values(Own(), "share", [0, 1.0 + 1e-12, True], shape=(3,), least=0.0, most=1.0)
    assert shares.dtype == float and shares.tolist() == pytest.approx([0.0, 1.0, 1.0])
    assert check_values(Own(), "share", 0.5, shape=(2,)).tolist() == [0.5, 0.5]
    assert float(check_values(Own(), "share", np.inf, least=0.0)) == np.inf
    for found, message in (
        ([0.0, np.nan], r"returned nan; return numbers of shape \(2,\) from 0 to 1"),
        ([0.0, 1.1], r"returned 1\.1; return numbers of shape \(2,\) from 0 to 1"),
        ([0.0], r"returned an array of shape \(1,\); return numbers of shape \(2,\)"),
        ("x", r"returned 'x'; return numbers of shape \(2,\)"),
        ([1j, 0], r"returned \[1j, 0\]; return numbers"),
    ):
        with pytest.raises(ScenarioError, match=r"Own\(\): share\(\) " + message):
            check_values(Own(), "share", found, shape=(2,), least=0.0, most=1.0)


def test_what_are_real_numbers():
    assert to_real_array([1, 2]).dtype == float
    for found in (None, "1", 1j, [[1], [1, 2]], np.array(["1"]), np.datetime64("2024-01-01")):
        assert to_real_array(found) is None
