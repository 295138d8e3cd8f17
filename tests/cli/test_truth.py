"""`rso-lidar truth`: its files and pictures, and what it says to what it cannot write."""

import csv
import json
from functools import partial
from pathlib import Path

import numpy as np
import pytest

import rso_lidar as rl
from rso_lidar import motion

FLYBY = Path(__file__).resolve().parents[2] / "examples" / "tle_flyby.toml"


@pytest.fixture
def call(rso_lidar):
    return partial(rso_lidar, "truth")


def test_a_table(call, bench, tmp_path):
    output = tmp_path / "bench.csv"
    assert call(bench, "-o", output, "--every", "0.4") == (0, f"{output}\n", [])
    with output.open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    assert [float(row["time_s"]) for row in rows] == [0.0, 0.4, 0.8, 1.2, 1.6, 1.8]  # and the last
    frames = list(rl.simulate(rl.Scenario.load(bench), frames=[0, 2, 4, 6, 8, 9]))
    for row, frame in zip(rows, frames, strict=True):
        # every digit is written, so that what is read is what was flown
        assert float(row["pan_actual_rad"]) == frame.truth.pointing.actual_rad[0]
        assert float(row["plate_range_m"]) == pytest.approx(1000.0, abs=1e-9)


@pytest.mark.parametrize("kind", ["relative", "angles", "ptu"])
def test_pictures_of_a_bench(call, bench, tmp_path, kind):
    output = tmp_path / f"{kind}.png"
    assert call(bench, "-o", output, "--figure", kind)[::2] == (0, [])
    assert output.read_bytes().startswith(b"\x89PNG")


def test_a_picture_of_orbits(call, tmp_path):
    output = tmp_path / "orbit.svg"
    assert call(FLYBY, "-o", output, "--figure", "orbit", "--every", "10")[0] == 0
    assert "<svg" in output.read_text(encoding="utf-8")[:1000]


def test_a_globe(call, tmp_path):
    output = tmp_path / "pass.czml"
    assert call(FLYBY, "-o", output, "--every", "20")[0] == 0
    made = json.loads(output.read_text(encoding="utf-8"))
    assert [packet["id"] for packet in made] == [
        "document", "stage", "follower", "follower-stage", "boresight tip", "boresight"
    ]  # fmt: skip
    assert made[0]["clock"]["interval"] == "2024-09-17T11:58:30.000000Z/2024-09-17T12:01:29.000000Z"
    # The boresight ends on the stage: the PTU tracks it, 0.06 degree late at most, at 2.8 km.
    stage, tip = (np.reshape(made[k]["position"]["cartesian"], (-1, 4)) for k in (1, 4))
    assert np.linalg.norm(stage[:, 1:] - tip[:, 1:], axis=-1).max() < 2800 * np.tan(0.06 * np.pi / 180)


def test_orientations_on_a_globe_are_earth_fixed(call, tmp_path):
    # At a fixed attitude in inertial axes the Earth-fixed orientation turns back with the Earth: 7.2921e-5 rad/s.
    output = tmp_path / "still.czml"
    still = 'target=[{name="stage", model="rocket_body", motion={type="tle", file="tle/flyby.tle", norad_id=99002}}]'
    assert call(FLYBY, "-o", output, "--every", "20", "--set", still)[0] == 0
    rows = np.reshape(json.loads(output.read_text(encoding="utf-8"))[1]["orientation"]["unitQuaternion"], (-1, 5))
    cosine = np.abs(np.sum(rows[0, 1:] * rows[-1, 1:]))
    assert 2.0 * np.arccos(min(cosine, 1.0)) == pytest.approx(7.2921e-5 * rows[-1, 0], rel=1e-3)


def test_an_orbit_and_an_attitude_in_files_of_the_standard(call, tmp_path):
    orbit, attitude = tmp_path / "stage.oem", tmp_path / "stage.aem"
    assert call(FLYBY, "-o", orbit, "--body", "stage", "--every", "10")[0] == 0
    assert call(FLYBY, "-o", attitude, "--body", "stage", "--every", "10")[0] == 0
    assert "OBJECT_NAME = stage" in " ".join(orbit.read_text(encoding="utf-8").split())
    scenario = rl.Scenario.load(FLYBY)
    flown = motion.truth(scenario.bodies, scenario.epochs(np.array([40])), local=False).states["stage"]
    read = rl.orbit.Ephemeris(file=str(orbit)).states(scenario.epochs(np.array([40])))
    np.testing.assert_allclose(read.position_m, flown.position_m, atol=2e-6)  # written to 1e-6 m
    assert "QUATERNION" in attitude.read_text(encoding="utf-8")
    lidar = tmp_path / "lidar.aem"  # a mount has an attitude, and no orbit of its own
    assert call(FLYBY, "-o", lidar, "--body", "lidar", "--every", "10")[0] == 0
    status, _, lines = call(FLYBY, "-o", tmp_path / "lidar.oem", "--body", "lidar", "--every", "10")
    assert status == 2 and "no body" in lines[0] and not (tmp_path / "lidar.oem").exists()


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["-o", "out.cvs"], "unknown suffix '.cvs'; did you mean '.csv'?"),
        (["-o", "out"], "the name has no suffix"),
        (["-o", "no/out.csv"], "there is no folder"),
        (["-o", "out.png", "--figure", "angels"], "no such picture; did you mean 'angles'?"),
        (["-o", "out.csv", "--figure", "angles"], "is for pictures"),
        (["-o", "out.png", "--figure", "orbit"], "no body orbits"),
        (["-o", "out.csv", "--every", "0"], "needs seconds above 0"),
        (["-o", "out.csv", "--every", "0.01"], "frames are 0.2 s apart"),
        (["-o", "out.png", "--body", "plat"], "did you mean 'plate'?"),
        (["-o", "out.oem"], "a local world has no Earth"),
        (["-o", "out.czml"], "a local world has no Earth"),
    ],
)
def test_what_cannot_be_written_gets_one_line_and_leaves_nothing(call, bench, tmp_path, monkeypatch, arguments, words):
    monkeypatch.chdir(tmp_path)
    status, out, lines = call(bench, *arguments)
    assert (status, out, len(lines)) == (2, "", 1)
    assert words in lines[0]
    assert [file.name for file in tmp_path.iterdir()] == ["bench.toml"]


def test_an_output_that_exists_is_kept(call, bench, tmp_path):
    output = tmp_path / "bench.csv"
    output.write_text("mine", encoding="utf-8")
    status, _, lines = call(bench, "-o", output)
    assert (status, output.read_text(encoding="utf-8")) == (2, "mine")
    assert "--overwrite" in lines[0]
    assert call(bench, "-o", output, "--overwrite")[0] == 0
    assert output.read_text(encoding="utf-8").startswith("time_s,utc,")


def test_a_scenario_without_a_ptu_has_no_picture_of_it(call, bench, text, tmp_path):
    head, _, rest = text.partition("[ptu]")
    bench.write_text(head + "[lidar.laser]" + rest.partition("[lidar.laser]")[2], encoding="utf-8")
    status, _, lines = call(bench, "-o", tmp_path / "ptu.png", "--figure", "ptu")
    assert status == 2
    assert "no PTU" in lines[0]
