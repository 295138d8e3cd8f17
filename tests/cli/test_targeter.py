"""`rso-lidar targeter`: what it writes, and what it refuses."""

import csv
import json

import pytest

import rso_lidar as rl
from tests.study.targeting.targeting_for_tests import HOLD, IMPULSES, rendezvous, write


@pytest.fixture
def file(tmp_path):
    return write(tmp_path, rendezvous(), IMPULSES + HOLD)


def test_a_solved_scenario_a_table_and_text_of_eighty_columns(rso_lidar, file, tmp_path):
    places = [tmp_path / f"solved.{suffix}" for suffix in ("toml", "csv", "json")]
    status, said, _ = rso_lidar("targeter", file, *(word for place in places for word in ("-o", place)))
    assert status == 0
    assert max(map(len, said.splitlines()[:-3])) <= 80
    solved = rl.Scenario.load(places[0])
    with places[1].open(encoding="utf-8", newline="") as table:
        rows = list(csv.DictReader(table))
    pushes = [maneuver.delta_v_m_s for maneuver in solved.follower.motion.maneuvers]
    assert [float(row["after"]) for row in rows[:6]] == pytest.approx([*pushes[0], *pushes[1]])
    assert [row["key"] for row in rows[6:]] == ["goal[0]"] * 3 + ["goal[1]"] * 3
    tree = json.loads(places[2].read_text(encoding="utf-8"))
    assert tree["method"] == "corrector" and len(tree["settings"]) == 6
    status, _, said = rso_lidar("targeter", file, "-o", places[0])
    assert status == 2 and len(said) == 1 and "--overwrite" in said[0]


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("position_m", "positon_m", "did you mean 'position_m'"),
        ("low = -2", "low = 2", "is not below high"),
        ("0.delta_v_m_s.0", "7.delta_v_m_s.0", "maneuvers"),
        ("0.delta_v_m_s.0", "0.delta_v_m_s.1", "is given twice"),
        ("low = -2", "low = 1", "outside 1 to 2"),
        ("equals = [0.0, -30.0, 0.0]", "equals = 3", "is three numbers"),
        ('"follower.motion.maneuvers.1.at_s"', "99999", "is outside the run of 6000 s"),
        ('"follower.motion.maneuvers.1.at_s"', '"follower.motion.type"', "is no number of the scenario"),
        ('scenario = "flight.toml"', 'scenario = "none.toml"', "no file 'none.toml'"),
        ('scenario = "flight.toml"', 'scenario = "flight.toml"\nminimize = "range_m"', "is of an instant"),
        ('scenario = "flight.toml"', 'scenario = "flight.toml"\ntarget = "nobody"', "nobody"),
        (HOLD, "", "has nothing to reach"),
        ("low = -2\nhigh = 2", "low = -0.001\nhigh = 0.001\ninitial = 0", "cannot be reached"),
    ],
)
def test_broken_files_are_refused_in_one_line_and_nothing_is_written(rso_lidar, file, tmp_path, old, new, message):
    text = file.read_text(encoding="utf-8")
    assert old in text
    file.write_text(text.replace(old, new, 1) if "initial" not in new else text.replace(old, new), encoding="utf-8")
    status, _, said = rso_lidar("targeter", file, "-o", tmp_path / "solved.toml")
    assert status == 2 and len(said) == 1 and message in said[0]
    assert not (tmp_path / "solved.toml").exists()


def test_the_targeter_and_its_scenario_are_not_overwritten(rso_lidar, file, tmp_path):
    for own in (file, tmp_path / "flight.toml"):
        before = own.read_bytes()
        status, _, said = rso_lidar("targeter", file, "-o", own, "--overwrite")
        assert status == 2 and len(said) == 1 and "is an input of this command" in said[0]
        assert own.read_bytes() == before
