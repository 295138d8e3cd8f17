"""`rso-lidar track`: the table that it prints, what it writes, and what it refuses."""

import csv
import dataclasses
from functools import partial

import numpy as np
import pytest

import rso_lidar as rl
from rso_lidar import track
from rso_lidar.cli.track import describe_consistency, summarise
from rso_lidar.evaluation import Tracking
from rso_lidar.track.pose import follow

DEG = rl.units.DEG


@pytest.fixture
def bench(recorded):
    return recorded


@pytest.fixture
def call(rso_lidar):
    return partial(rso_lidar, "track")


def test_a_table_and_a_picture(call, bench, tmp_path):
    status, said, errors = call(bench, "-o", tmp_path / "t.png", "--range-noise", "0.1", "--frames", "0:3")
    assert status == 0
    assert errors[-1].startswith("frame 3/3")  # and a rate, on a slow machine
    lines = said.splitlines()
    assert lines[0].startswith("plate: 3 of 3 frames with a fix; range noise 0.1 m")
    assert [line.split()[0] for line in lines[3:-1] if line[0] != " "] == ["centroid", "constant", "constant", "icp"]
    assert lines[-1] == f"{tmp_path / 't.png'}"
    assert (tmp_path / "t.png").read_bytes().startswith(b"\x89PNG")
    assert "icp" not in call(bench, "--no-icp")[1]
    assert call(bench, "--no-icp", "--frames", "2:8:2")[1].startswith("plate: 3 of 3 frames with a fix")
    assert call(bench, "--frames", "20:30")[0] == 2


def test_icp_without_points_enough_is_told(call, text, tmp_path):
    path = tmp_path / "far.h5"
    far = rl.Scenario.loads(text + '\n[lidar.detector]\ntype = "empirical"\n')
    rl.save(path, rl.simulate(far, frames=[0, 1]))
    last = call(path)[1].splitlines()[-1]
    assert last.startswith("icp") and "no pose: it takes 50 points of a frame, and no frame had over" in last
    assert "icp" not in call(path, "--no-icp")[1]


def test_icp_tells_of_hinges():
    errors = [f"centroid_error_{axis}_m" for axis in Tracking.AXES]
    poses = ("icp_error_rad", "icp_long_axis_error_rad", "icp_error_m")
    table = {name: np.ones(2) for name in ("time_s", "points", *errors, *poses)}
    rigid = Tracking("a", "craft", table, {}, 0.1, 1e-4)
    assert summarise(rigid)[-1].startswith("icp")
    angles = {
        "icp_hinge_wing_error_rad": np.radians([1.0, -179.0]),
        "icp_hinge_dish_error_rad": np.radians([2.0, -4.0]),
    }
    hinged = dataclasses.replace(rigid, hinges=("wing", "dish"), table=table | angles)
    wing, dish = summarise(hinged)[-2:]
    assert wing.strip() == "hinge wing: angle 1.00, 1.00 deg, in 50% of the poses half a turn away"
    assert "dish: angle 3.00, 3.80 deg, in 0% of" in dish


@pytest.mark.parametrize(
    ("believed", "verdict"),
    [(1.0, ""), (3.0, "below its bounds: under-confident"), (1 / 3, "above its bounds: over-confident")],
)
def test_a_nis_outside_its_bounds_is_explained(believed, verdict):
    """A filter that is told the noise of its fixes, three times as much, and a third of it (standard deviations)."""
    steps, sigma_m = 400, 0.1
    fixes_m = np.array([0.0, 0.0, 100.0]) + sigma_m * np.random.default_rng(4).standard_normal((steps, 3))
    covariance = np.broadcast_to((believed * sigma_m) ** 2 * np.eye(3), (steps, 3, 3))
    made = track.filter_positions(np.arange(steps, dtype=float), fixes_m, covariance, acceleration_m_s2_sqrt_hz=1e-6)
    said = describe_consistency(made.nis_mean, int(np.isfinite(made.nis).sum()))
    assert said.startswith(verdict) and bool(said) == bool(verdict)
    assert not said or ("lower --range-noise" in said) == (believed > 1.0)


def test_the_table_explains_a_nis_outside_its_bounds(call, bench):
    lines = call(bench, "--no-icp", "--range-noise", "30", "--acceleration", "1")[1].splitlines()
    (place,) = (k for k, line in enumerate(lines) if "NIS mean" in line)
    assert "below its bounds: under-confident" in lines[place + 1]


ARRAY = '{ name = "solar_north", angle = { type = "fixed", angle_deg = 40, rate_deg_s = 10 } }'


@pytest.mark.slow
def test_an_array_that_turns_is_tracked(call, text, tmp_path, monkeypatch):
    """A relay satellite 60 m away through the whole simulator: ICP finds its pose and the angle of the northern array."""
    monkeypatch.setattr(follow, "acquire", partial(follow.acquire, starts=24))  # for time: a quarter of the usual
    craft = text
    for old, new in (
        ('"plate"', '"tdrs"'),
        ('material = { type = "lambertian", reflectance = 0.30 }', f"joint = [{ARRAY}]"),
        ("[1000, 0, 0]", "[60, 0, 0]"),
        ('{ type = "spin", axis = [0, 0, 1], rate_deg_s = 10 }', '{ type = "fixed", euler_zyx_deg = [90, 20, 0] }'),
        ("energy_mj = 50", "energy_mj = 50\ndivergence_deg = 22"),
        ("fov_deg  = 2.5", "fov_deg  = 22"),
        (" = 32", " = 40"),  # rows and columns
    ):
        assert old in craft
        craft = craft.replace(old, new)
    path = tmp_path / "craft.h5"
    rl.save(path, rl.simulate(rl.Scenario.loads(craft + '\n[lidar.detector]\ntype = "empirical"\n'), frames=[1]))
    status, said, _ = call(path, "-o", tmp_path / "t.csv", "--no-shape", "--range-noise", "0.05")
    assert status == 0
    assert said.splitlines()[-2].strip().startswith("hinge solar_north: angle ")
    with (tmp_path / "t.csv").open(encoding="utf-8", newline="") as file:
        (row,) = ({name: float(value) for name, value in row.items()} for row in csv.DictReader(file))
    # 104 points, pixels of 0.6 m.
    assert row["icp_error_rad"] < 3.0 * DEG
    assert row["icp_error_m"] < 0.3
    # 42 deg after a fifth of a second, or the other side of the flat array; five times the standard deviation stated.
    off_rad = row["icp_hinge_solar_north_rad"] - 42.0 * DEG
    assert np.arctan(np.tan(off_rad)) == pytest.approx(0.0, abs=5.0 * DEG)
    assert np.sin(row["icp_hinge_solar_north_error_rad"]) == pytest.approx(np.sin(off_rad), abs=1e-6)


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["-o", "x.jpg"], "unknown suffix '.jpg'"),
        (["-o", "x"], "no suffix"),
        (["-o", "no/such/x.png"], "there is no folder"),
        (["--range-noise", "0"], "metres above 0"),
        (["--range-noise", "nan"], "metres above 0"),
        (["--acceleration", "-1"], "from 0"),
        (["--acceleration", "nan"], "from 0"),
        (["--target", "plats"], "did you mean 'plate'"),
    ],
)
def test_refused_in_one_line(refused, arguments, said):
    refused(arguments, said)
