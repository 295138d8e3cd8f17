"""Earthshine: what turns it on, what is refused, and what does not change it."""

import numpy as np
import pytest

import rso_lidar as rl
from rso_lidar.errors import ScenarioError
from rso_lidar.scene.bounces.earthshine import locate_earth

SETTINGS = ("world.earth_albedo=0.3", "lidar.receiver.filter_width_nm=1", "time.duration_s=10")


def fly(settings, threads=1):
    """Return the hits of the first frame of an example."""
    scenario = rl.Scenario.load("examples/tdrs_approach.toml", settings)
    return next(rl.simulate(scenario, frames=[0], threads=threads, keep=("hits",))).kept["hits"]


def test_it_is_added_to_sunlight_only_and_does_not_depend_on_threads():
    off, on, again = fly(SETTINGS[1:]), fly(SETTINGS), fly(SETTINGS, threads=2)
    assert (on.sunlight_per_sr >= off.sunlight_per_sr).all() and (on.sunlight_per_sr > off.sunlight_per_sr).any()
    np.testing.assert_array_equal(on.sunlight_per_sr, again.sunlight_per_sr)
    np.testing.assert_array_equal(on.brdf_per_sr, off.brdf_per_sr)


def test_without_a_filter_nothing_is_added_and_check_says_so():
    settings = (SETTINGS[0], SETTINGS[2])
    assert fly(settings).sunlight_per_sr is None
    lines = rl.Scenario.load("examples/tdrs_approach.toml", settings).advice()
    assert any("world.earth_albedo asks for light of the Earth" in line for line in lines), lines


def test_two_albedos_of_one_earth_are_said():
    glare = ("lidar.receiver.glare={}", "lidar.receiver.glare.earth_albedo=0.7")
    for settings, is_said in (
        (glare, True),
        (("lidar.receiver.glare={}", "lidar.receiver.glare.earth_albedo=0.3"), False),
    ):
        lines = rl.Scenario.load("examples/tdrs_approach.toml", (*SETTINGS, *settings)).advice()
        assert any("Earth has one albedo" in line for line in lines) is is_said, lines


@pytest.mark.parametrize("position_m", [(0.0, 0.0, 0.0), (6e6, 0.0, 0.0)])
def test_below_the_surface_there_is_no_earth(position_m):
    scenario = rl.Scenario.load("examples/tdrs_approach.toml", SETTINGS)
    truth = rl.Simulation(scenario).advance().truth
    surface = scenario.surfaces[0]
    buried = rl.records.BodyState(np.array(position_m), np.zeros(3))
    truth = rl.records.Truth(truth.time_s, truth.poses, {surface.body: buried}, truth.sun_direction)
    assert locate_earth(surface, truth) is None


@pytest.mark.parametrize("value", ["1.5", "-0.1", "'0.3'", "true", "nan", "[0.3]"])
def test_a_wrong_albedo_is_refused(value):
    with pytest.raises(ScenarioError, match=r"tdrs_approach\.toml: world\.earth_albedo: "):
        rl.Scenario.load("examples/tdrs_approach.toml", (f"world.earth_albedo={value}",))


def test_a_local_world_has_no_earth():
    with pytest.raises(ScenarioError, match="a local world has no Earth, so leave it out"):
        rl.World(axes="local", earth_albedo=0.3)
