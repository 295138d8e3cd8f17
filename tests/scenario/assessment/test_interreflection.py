"""What `check` says of the second bounce: a line for each target, and a warning where it is left out and is much."""

import numpy as np
import pytest

import rso_lidar as rl
from tests.optics.bench_for_tests import corner, write_stl

BENCH = """
version = 1
name = "corner"
[world]
axes = "local"
[time]
start_utc = 2024-09-17T12:00:00Z
duration_s = 1
frame_rate_hz = 1
[[target]]
name = "corner"
model = "corner.stl"
material = {{ type = "lambertian", reflectance = {reflectance} }}
center_of_mass_m = [0, 0, 0]
motion = {{ type = "fixed", position_m = [100, 0, 0] }}
[follower]
motion = {{ type = "fixed", position_m = [0, 0, 0] }}
[lidar]
bounces = {bounces}
[lidar.receiver]
fov_deg = 4
f_number = 8
n_rows = 16
n_cols = 16
[lidar.laser]
divergence_deg = 4
energy_mj = 0.1
"""


@pytest.fixture
def load(tmp_path):
    """Return a function that loads a corner of two plates, open toward the lidar."""
    write_stl(tmp_path / "corner.stl", np.roll(corner(3.0), 1, axis=2))

    def load(reflectance=0.8, bounces=1):
        file = tmp_path / "bench.toml"
        file.write_text(BENCH.format(reflectance=reflectance, bounces=bounces), encoding="utf-8")
        return rl.Scenario.load(file)

    return load


def line_of(scenario):
    (line,) = (line for line in scenario.describe().splitlines() if line.startswith("  bounces"))
    return line


@pytest.mark.slow
def test_a_corner_of_two_plates_adds_its_form_factor(load):
    """Perpendicular squares see a fifth of each other: 0.8 x 0.2 of the light."""
    assert "adds 15." in line_of(load()) or "adds 16." in line_of(load())
    assert "left out: lidar.bounces = 1" in line_of(load())
    assert "simulated" in line_of(load(bounces=2))


def test_much_light_that_is_left_out_is_warned_of(load):
    assert [line for line in load().advice() if "set lidar.bounces = 2" in line]
    assert not [line for line in load(bounces=2).advice() if "bounces" in line]
    assert not [line for line in load(reflectance=0.3).advice() if "bounces" in line]


def test_frames_with_two_bounces(load):
    """Frames do not depend on threads, and have the light that `check` says."""
    once, twice = load(), load(bounces=2)
    (first,), (both,), (again,) = (
        tuple(rl.simulate(one, threads=threads)) for one, threads in ((once, 1), (twice, 1), (twice, 3))
    )
    np.testing.assert_array_equal(both.labels.photons, again.labels.photons)
    np.testing.assert_array_equal(both.intensity_counts, again.intensity_counts)
    more = both.labels.photons.sum(dtype=float) / first.labels.photons.sum(dtype=float) - 1.0
    assert more == pytest.approx(0.155, abs=0.02)


@pytest.mark.parametrize("bounces", ["0", "17", "2.0", '"2"', "true", "-1"])
def test_another_number_of_bounces_is_refused(load, bounces):
    with pytest.raises(rl.ScenarioError, match=r"lidar\.bounces"):
        load(bounces=bounces)
