"""`rso-lidar encounters`: what it prints, what it writes, and what it refuses."""

import pytest
import typer
from typer.testing import CliRunner

import rso_lidar as rl
from rso_lidar.cli import encounters as command
from rso_lidar.errors import RsoLidarError
from rso_lidar.shipped import shipped

FLYBY = str(shipped("tle/flyby.tle"))
ASKED = ["--follower", "99003", "--within", "20km", "--start", "2024-09-17T11:00:00Z", "--days", "0.125"]


@pytest.fixture
def call():
    app = typer.Typer()
    app.command()(command.encounters)

    def run(*arguments):
        done = CliRunner().invoke(app, [str(argument) for argument in arguments])
        if done.exception is not None and not isinstance(done.exception, SystemExit):
            raise done.exception
        assert done.exit_code == 0, done.output
        return done.output

    return run


def test_table_csv_plot_and_scenario(call, tmp_path):
    places = [tmp_path / name for name in ("a.csv", "a.png", "a.toml")]
    out = call(FLYBY, *ASKED, "--csv", places[0], "--plot", places[1], "--scenario", "1", "-o", places[2])
    assert "1.5" in out
    assert "good to about a kilometre" in out
    assert all(place.stat().st_size > 100 for place in places)
    assert rl.Scenario.load(places[2]).target[0].name
    assert len(list(tmp_path.iterdir())) == 3  # no drafts are left
    with pytest.raises(RsoLidarError, match=r"a\.csv: exists already"):
        call(FLYBY, *ASKED, "--csv", places[0])
    call(FLYBY, *ASKED, "--csv", places[0], "--overwrite")


def test_nothing_found_is_no_error(call, tmp_path):
    asked = [word if word != "20km" else "1m" for word in ASKED]
    out = call(FLYBY, *asked, "--csv", tmp_path / "a.csv", "--plot", tmp_path / "a.png")
    assert "no encounter found" in out
    assert [place.name for place in tmp_path.iterdir()] == ["a.csv"]  # a header; nothing to draw


def test_a_lidar_of_a_scenario_file(call, tmp_path):
    out = call(FLYBY, *ASKED, "--lidar", shipped("examples/tle_flyby.toml"), "--scenario", 1, "-o", tmp_path / "a.toml")
    assert "tle_flyby.toml: reaches 1,000 to 3,000 m" in out
    assert rl.Scenario.load(tmp_path / "a.toml").lidar.detector.armed_to_m == 3000


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        (["--within", "50"], "has no unit; write 50km or 50m"),
        (["--within", "50miles"], "unknown unit 'miles'"),
        (["--within", "near"], "is no length"),
        (["--start", "tomorrow"], "is no time; write for example"),
        (["--start", "2024-09-17T11:00:00"], "end it with Z"),
        (["--days", "-1"], "days: -1 is no span"),
        (["--follower", "99004"], "did you mean"),
        (["--lidar", "long_range"], "did you mean 'long_range_1064'"),
        (["--sort", "rnage"], "did you mean 'range'"),
        (["--scenario", "1"], "go together"),
        (["--scenario", "99", "-o", "{}/a.toml"], "give a number from 1 to"),
        (["--csv", "{}/none/a.csv"], "there is no folder"),
        (["--plot", "{}/a.xyz"], "unknown suffix '.xyz'"),
    ],
)
def test_bad_input_is_one_line_and_leaves_nothing(call, tmp_path, changed, message):
    changed = [word.format(tmp_path) for word in changed]
    with pytest.raises(RsoLidarError) as told:
        call(FLYBY, *ASKED, *changed)
    assert message in str(told.value)
    assert "\n" not in str(told.value)
    assert list(tmp_path.iterdir()) == []


def test_a_catalogue_that_is_not_there(call, tmp_path):
    with pytest.raises(RsoLidarError, match="no such file"):
        call(tmp_path / "none.tle", *ASKED)
