"""Edits at one place keep the comments and everything else."""

import datetime
import tomllib

import pytest

pytest.importorskip("tomlkit", reason="edits need tomlkit, of the extra studio")

from rso_lidar.errors import ScenarioError
from rso_lidar.studio.model.editable_toml import set_value

TEXT = """# head
name = "a"  # title

[time]  # clock
duration_s = 10  # short
start_utc = 2024-09-17T12:00:00Z

[[target]]
name = "one"
motion = { type = "fixed", position_m = [1, 2, 3] }  # inline
"""


@pytest.mark.parametrize(
    ("place", "value"),
    [
        ("name", 'with "quotes" and \\ and \x7f'),
        ("time.duration_s", 2.5),
        ("time.start_utc", datetime.datetime(2025, 1, 2, tzinfo=datetime.UTC)),
        ("target[0].motion.position_m", [4.0, 5.0, 6.0]),
        ("target[0].motion", {"type": "tle", "lines": ["1 a", "2 b"]}),
        ("target[1]", {"name": "two"}),
        ("lidar.laser.energy_mj", 50),
        ("world", {"axes": "local"}),
    ],
)
def test_only_the_place_changes(place, value):
    made = set_value(TEXT, place, value)
    expected = tomllib.loads(TEXT)
    here = expected
    *way, last = (int(word) if word.isdigit() else word for word in place.replace("[", ".").replace("]", "").split("."))
    for step in way:
        here = here.setdefault(step, {}) if isinstance(step, str) else here[step]
    here.append(value) if isinstance(last, int) else here.update({last: value})
    assert tomllib.loads(made) == expected
    assert all(comment in made for comment in ("# head", "# clock"))


@pytest.mark.parametrize("place", ["name", "time.duration_s", "time", "target[0]", "target[0].motion", "target"])
def test_what_is_removed_is_gone_and_the_rest_stays(place):
    left = tomllib.loads(set_value(TEXT, place, None))
    assert ("target" in left) == (place not in ("target", "target[0]"))
    assert ("time" in left) == (place != "time")
    assert len(left) == 3 - (place in ("name", "time", "target", "target[0]"))


@pytest.mark.parametrize(
    ("text", "place", "value"),
    [
        ("a = [", "a", 1),
        (TEXT, "name.inner", 1),
        (TEXT, "target[5]", {"name": "far"}),
        (TEXT, "time.duration_s[0]", 1),
        (TEXT, "time.duration_s", object()),
    ],
)
def test_what_cannot_be_placed_is_refused(text, place, value):
    with pytest.raises(ScenarioError):
        set_value(text, place, value)


def test_removing_what_is_not_there_is_refused():
    with pytest.raises(ScenarioError, match="no_such"):
        set_value(TEXT, "no_such", None)
