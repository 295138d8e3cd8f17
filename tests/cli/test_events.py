"""`rso-lidar events`: what it prints, what it writes, and what it refuses."""

import json
from pathlib import Path

import pytest

import rso_lidar as rl
from rso_lidar.cli import events as command
from rso_lidar.errors import RsoLidarError
from rso_lidar.shipped import shipped

FLYBY = str(shipped("tle/flyby.tle"))
HOP = str(shipped("examples/tdrs_approach.toml"))
ASKED = ["--follower", "99003", "--start", "2024-09-17T11:00:00Z", "--days", "0.125"]


@pytest.fixture
def call(alone):
    return alone(command.events)


def test_table_and_every_file(call, tmp_path):
    places = [tmp_path / f"a{suffix}" for suffix in (".csv", ".json", ".ics", ".png", ".toml")]
    outputs = [word for place in places for word in ("-o", place)]
    station = ["--station", "Graz=47.07,15.49,540,10", "--days", "0.15"]
    out = call(
        FLYBY, *ASKED, *station, "--when", "near = range < 3km", "--when", "contact(Graz)", "--scenario", 1, *outputs
    )
    assert all(place.stat().st_size > 100 and str(place) in out for place in places)
    assert len(list(tmp_path.iterdir())) == len(places)  # no drafts are left
    rows = json.loads(places[1].read_text(encoding="utf-8"))["events"]
    assert {row["event"] for row in rows} == {"near", "contact(Graz)"}
    assert rl.Scenario.load(places[4]).target[0].name
    lines = out.splitlines()
    assert max(map(len, lines[1 : 2 + len(rows)])) <= 80
    with pytest.raises(RsoLidarError, match=r"a\.csv: exists already"):
        call(FLYBY, *ASKED, "-o", places[0])


def test_a_scenario_alone_is_enough(call):
    out = call(HOP, "--days", "0.03", "--when", "range < 1km and beam")
    assert out.startswith("events of tdrs_approach follower and tdrs, 2024-09-17T12:00:00Z + 0.03 days")
    assert len([line for line in out.splitlines() if line.startswith("1  ")]) == 1


def test_fields_of_the_scenario_are_set_as_for_a_run(call, tmp_path):
    """A hold 1500 m behind on the orbit, at rest: within 2 km from the start on, where the hop is not."""
    asked = (HOP, "--days", "0.01", "--when", "range < 2km", "-o", tmp_path / "a.json", "--overwrite")
    rest = ["--set", "follower.motion.position_m=[0,-1500,0]", "--set", "follower.motion.velocity_m_s=[0,0,0]"]
    call(*asked, *rest)
    (row,) = json.loads((tmp_path / "a.json").read_text(encoding="utf-8"))["events"]
    assert row["begin_utc"].startswith("2024-09-17T12:00:00") and row["nearest_m"] == pytest.approx(1500.0, abs=1.0)
    assert "no event found" in call(*asked)


def test_without_an_expression_the_reach_of_the_lidar_counts(call):
    out = call(FLYBY, *ASKED, "--lidar", "gsfl_1064")
    assert "in reach: visible and range < " in out


def test_nothing_found_is_no_error(call, tmp_path):
    out = call(FLYBY, *ASKED, "--when", "range < 1m", "-o", tmp_path / "a.png", "-o", tmp_path / "a.ics")
    assert "no event found" in out
    assert all(place.stat().st_size > 50 for place in tmp_path.iterdir())


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        (["--when", "range < 5"], "--when 'range < 5': '5' has no unit; write 5m"),
        (["--when", "contact(Gratz)", "--station", "Graz=47,15"], "did you mean 'Graz'"),
        (["--station", "Graz=47"], "--station Graz=47: is not a station"),
        (["--set", "name=x"], "--set name=x: changes scenarios, and none of the files is one; leave it out"),
        (["--lidar", HOP, "--set", "lidar.laser.energy=1"], "lidar.laser: unknown key 'energy'"),
        (["--station", "G=100,2"], "--station G: latitude_deg: 100.0 is not within 90"),
        (["--all-pairs"], "exclude each other"),
        (["--days", "90"], "--days: 90 is not a time span"),
        (["--keep-out", "0m"], "--keep-out 0m: is not a radius"),
        (["--target-size", "3"], "--target-size 3: has no unit"),
        (["-o", "{}/a.toml"], "go together"),
        (["--scenario", "1"], "go together"),
        (["--scenario", "999", "-o", "{}/a.toml"], "give a number from 1 to"),
        (["-o", "{}/a.xyz"], "unknown suffix '.xyz'"),
        (["-o", "{}/a.csv", "-o", "{}/a.csv"], "is given twice"),
        (["-o", "{}/a.ics", "--dark"], "--dark: is for pictures"),
    ],
)
def test_bad_input_is_one_line_and_leaves_nothing(call, tmp_path, changed, message):
    changed = [word.format(tmp_path) for word in changed]
    with pytest.raises(RsoLidarError) as told:
        call(FLYBY, *ASKED, *changed)
    assert message in str(told.value)
    assert "\n" not in str(told.value)
    assert list(tmp_path.iterdir()) == []


def test_an_input_is_no_output(call, tmp_path):
    catalog = tmp_path / "a.csv"
    text = Path(FLYBY).read_bytes()
    catalog.write_bytes(text)
    with pytest.raises(RsoLidarError, match=r"a\.csv: is an input of this command; give another name"):
        call(catalog, *ASKED, "-o", catalog, "--overwrite")
    assert catalog.read_bytes() == text


def test_neither_follower_nor_pairs(call):
    with pytest.raises(RsoLidarError, match="needs the object with the lidar; give --follower or --all-pairs"):
        call(FLYBY, *ASKED[2:])
