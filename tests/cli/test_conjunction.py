"""`rso-lidar conjunction`: what it prints, the scenario it writes, and what it says to bad input."""

import re

import pytest

import rso_lidar as rl
from rso_lidar.shipped import shipped


def test_probabilities_and_a_scenario(rso_lidar, tmp_path):
    place = tmp_path / "close.toml"
    status, out, err = rso_lidar("conjunction", "tle/flyby.cdm", "--samples", 20_000, "-o", place)
    assert (status, err) == (0, [])
    assert re.search(r"^miss distance    120\.0 m", out, re.MULTILINE)
    assert re.search(r"along-track 113\.1, cross-track 0\.0 m", out)  # not -0.0
    assert re.search(r"^Pc by Foster     0\.0008\d+$", out, re.MULTILINE)
    assert re.search(r"^Pc, Monte Carlo  0\.000\d+, standard error .* of 20,000 draws", out, re.MULTILINE)
    assert out.splitlines()[-1] == str(place)
    assert rl.Scenario.load(place).target[0].name == "rocket_body_synthetic"


def test_options_count(rso_lidar):
    _, near, _ = rso_lidar("conjunction", "tle/flyby.cdm", "--radius", "6m", "--samples", 0)
    _, far, _ = rso_lidar("conjunction", "tle/flyby.cdm", "--radius", "0.012km", "--samples", 0)
    small, large = (float(re.search(r"Foster +(\S+)", text)[1]) for text in (near, far))
    assert large / small == pytest.approx(4.0, rel=0.1)  # area of the disc, and a density that is not constant
    assert "Monte Carlo" not in near


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (
            ["tle/flyby.tle"],
            "tle/flyby.tle: line 1: 'ROCKET BODY (SYNTHETIC)' is not KEYWORD = value; correct the line",
        ),
        (
            ["tle/flyby.cdm", "--window", "0"],
            "window_s: 0.0 is not a window; give seconds above 0, at most 30 days",
        ),
        (["nowhere.cdm"], "nowhere.cdm: no such file; check the name"),
        (["tle/flyby.cdm", "--radius", "10"], "--radius 10: has no unit; write 10km or 10m"),
        (
            ["tle/flyby.cdm", "--radius", "0m"],
            "radius_m: 0.0 is not a hard-body radius; give metres above 0, at most 1e5",
        ),
        (["tle/flyby.cdm", "--lidar", "nothing"], "--lidar nothing: no camera of that name"),
        (["tle/flyby.cdm", "-o", "out.png"], "out.png"),
        (["tle/flyby.cdm", "--follower", "3"], "Invalid value for '--follower'"),
    ],
)
def test_bad_input_is_one_line(rso_lidar, tmp_path, monkeypatch, arguments, said):
    monkeypatch.chdir(tmp_path)
    status, out, err = rso_lidar("conjunction", *arguments)
    assert (status, out, len(err)) == (2, "", 1)
    assert said in err[0]
    assert not list(tmp_path.iterdir())


def test_an_existing_file_is_kept(rso_lidar, tmp_path):
    place = tmp_path / "close.toml"
    place.write_text("mine", encoding="utf-8")
    status, _, err = rso_lidar("conjunction", shipped("tle/flyby.cdm"), "--samples", 0, "-o", place)
    assert status == 2
    assert "--overwrite" in err[0]
    assert place.read_text(encoding="utf-8") == "mine"
