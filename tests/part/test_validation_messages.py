"""Values in messages: one short line each, whatever the value is."""

import pytest

from rso_lidar.part import show_value


class Broken:
    def __repr__(self):
        raise ValueError("no text")


@pytest.mark.parametrize(
    ("value", "text"),
    [
        ("a\nb", r"'a\nb'"),
        ("x" * 100, "'" + "x" * 56 + "..."),
        (10**5000, "an int of more digits than can be shown"),
        (Broken(), "a Broken"),
        ([10**5000], "a list"),
    ],
    ids=["lines", "long", "digits", "object", "list"],
)
def test_a_value_is_one_short_line(value, text):
    assert show_value(value) == text
