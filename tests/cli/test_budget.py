"""`rso-lidar budget`: what it prints, what it writes, and what it refuses."""

import pytest

import rso_lidar as rl
from rso_lidar.cli import budget as command
from rso_lidar.errors import RsoLidarError
from rso_lidar.mission_analysis.budgets import attitude_search, finding_range


@pytest.fixture
def call(alone):
    return alone(command.budget)


@pytest.fixture
def scenario(text, tmp_path):
    file = tmp_path / "bench.toml"
    file.write_text(
        text.replace("[lidar.laser]", '[lidar.detector]\ntype = "empirical"\n\n[lidar.laser]'), encoding="utf-8"
    )
    return file


def test_a_camera_by_name(call):
    out = call("gsfl_1064", "--range", "1km:4km", "--target-m", "4,3,2")
    assert "a box of 4 x 3 x 2 m, tumbling" in out
    assert "lambertian 0.3" in out and "3,0" in out
    assert "false alarms a frame" in out


def test_a_camera_by_name_with_a_field_set_anew(call, tmp_path):
    """As a scenario with that preset and that field has it, and under a name that says so."""
    asked = (
        "--range",
        "100m:250m",
        "--set",
        "lidar.laser.energy_mj=20",
        "--set",
        "lidar.detector.detection_efficiency=0.2",
    )
    out = call("geiger_1064", *asked, "-o", tmp_path / "a.csv")
    assert out.startswith("geiger_1064 with lidar.laser.energy_mj=20, lidar.detector.detection_efficiency=0.2: ")
    camera = rl.Lidar(preset="geiger_1064", laser={"energy_mj": 20}, detector={"detection_efficiency": 0.2})
    same = rl.budget(camera, range_m=(100.0, 250.0))
    assert (tmp_path / "a.csv").read_text(encoding="utf-8") == same.csv_text()
    assert same.csv_text() != rl.budget("geiger_1064", range_m=(100.0, 250.0)).csv_text()


def test_a_scenario_with_several_of_everything_to_csv_and_picture(call, scenario, tmp_path):
    asked = (scenario, "--material", "0.3", "--material", "mli_gold", "--tilt-deg", 0, "--tilt-deg", 30)
    beams = ("--divergence-deg", 2, "--divergence-deg", 4, "--probability", 0.5, "--set", "lidar.laser.energy_mj=20")
    out = call(*asked, *beams, "-o", tmp_path / "a.csv")
    assert out.count("mli_gold") == 4 and "P = 0.5 to" in out and "a.csv" in out
    assert (tmp_path / "a.csv").read_text(encoding="utf-8").count("\n") == 1 + 8 * 121
    (tmp_path / "a.png").write_bytes(b"mine")
    with pytest.raises(RsoLidarError, match=r"a\.png: exists already"):
        call(scenario, "-o", tmp_path / "a.png")
    call(scenario, "-o", tmp_path / "a.png", "--overwrite")
    assert (tmp_path / "a.png").read_bytes().startswith(b"\x89PNG")
    assert len(list(tmp_path.iterdir())) == 3


@pytest.mark.parametrize(
    ("asked", "said"),
    [
        (("gsfl_1065",), "no camera of that name; did you mean 'gsfl_1064'"),
        (("none.toml",), "no such file"),
        (("gsfl_1064", "--range", "100m"), "--range 100m: is not a range"),
        (("gsfl_1064", "--range", "1:2"), "has no unit"),
        (("gsfl_1064", "--target-m", "a"), "--target-m a: are not lengths"),
        (("gsfl_1064", "--set", "time.duration_s=1"), "gsfl_1064 has only the table lidar"),
        (("gsfl_1064", "--set", "lidar.laser.energy=1"), "gsfl_1064: lidar: laser: unknown key 'energy'; did you mean"),
        (("gsfl_1064", "--set", "lidar.laser.energy_mj=-1"), "should be greater than 0"),
        (("gsfl_1064", "--set", "lidar.laser"), "is not place=value"),
        (("gsfl_1064", "--set", "lidar=3"), "needs a table"),
        (("gsfl_1065", "--set", "lidar.laser.energy_mj=1"), "no camera of that name"),
        (("gsfl_1064", "-o", "a.txt"), "unknown suffix '.txt'"),
        (("gsfl_1064", "-o", "nowhere/a.png"), "there is no folder"),
        (("gsfl_1064", "--material", "tinfoil"), "no 'tinfoil'"),
    ],
)
def test_refused(call, asked, said, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(RsoLidarError, match=said):
        call(*asked)
    assert not list(tmp_path.iterdir())


def test_how_far_a_body_is_found(call, tmp_path, monkeypatch):
    monkeypatch.setattr(finding_range, "_WORST_PLACES", 4)  # in the pixel grid; the fewer, the quicker
    monkeypatch.setattr(attitude_search, "_FEW_PLACES", 1)
    monkeypatch.setattr(attitude_search, "_PLACES", 2)
    camera = [
        "gsfl_1064",
        "--set",
        'lidar.detector={ type = "empirical" }',
        "--set",
        "lidar.receiver.rays_per_pixel=16",
    ]
    asked = ["--find", "cubesat_1u", "--pixels", "2", "--flashes", "2/3", "--attitudes", "4", "--range", "100m:1km"]
    out = call(*camera, *asked, "-o", str(tmp_path / "found.csv"))
    assert "2 pixels or more, in 2 of 3 flashes or more" in out and "worst attitude" in out
    assert (tmp_path / "found.csv").read_text().startswith("range_m,found_probability")


@pytest.mark.parametrize(
    ("wrong", "why"),
    [
        (["--pixels", "2"], "--pixels: is for a whole body"),
        (["--find", "cubesat_1u", "--tilt-deg", "3"], "--tilt-deg: is for one pixel"),
        (["--find", "cubesat_1u", "--flashes", "3/2"], "--flashes 3/2"),
        (["--find", "cubesat_1u", "--flashes", "two"], "--flashes two"),
        (["--find", "cubesat_1u", "--pixels", "0"], "--pixels 0"),
        (["--find", "cubesat_1u", "--attitudes", "half"], "--attitudes half"),
        (["--find", "cubesat_1u", "--attitudes", "run"], "the body is not of a scenario"),
        (["--find", "cubesat_1v"], "did you mean 'cubesat_1u'"),
    ],
)
def test_a_wrong_question_about_a_body_is_refused(call, wrong, why):
    with pytest.raises(RsoLidarError, match=why):
        call("gsfl_1064", *wrong)
