"""Sun, Earth and Moon in a timeline: their angles, and the stray light that they put into a pixel."""

import numpy as np
import pytest

import rso_lidar as rl
from rso_lidar.mission_analysis import fly_open_loop
from rso_lidar.mission_analysis.time_history.sky_light import find_sky_light, tabulate_sky
from rso_lidar.optics.stray.glare import veil
from rso_lidar.scenario import preview_mission
from rso_lidar.scenario.preview.sky import tabulate_environment

LOOK = (
    "time.duration_s=40",
    "lidar.receiver.filter_width_nm=1.0",
    "lidar.receiver.glare.surfaces=8",
)


@pytest.fixture(scope="module")
def flyby():
    scenario = rl.Scenario.load("examples/tdrs_approach.toml", LOOK)
    frames = np.arange(scenario.time.n_frames)
    return scenario, frames, fly_open_loop(scenario, frames)[0]


def test_the_angles_are_those_of_the_check(flyby):
    scenario, frames, truth = flyby
    table = tabulate_sky(scenario, truth, frames)
    known = tabulate_environment(scenario, preview_mission(scenario))
    assert table["earth_limb_off_boresight_rad"] == pytest.approx(known["earth_limb_angle_rad"], abs=1e-4)
    assert table["moon_off_boresight_rad"] == pytest.approx(known["moon_angle_rad"], abs=1e-4)


def test_the_light_is_that_of_a_frame(flyby):
    """The veil on the boresight is what the pixels in the middle of a frame get beside the light of targets."""
    scenario, frames, truth = flyby
    table = tabulate_sky(scenario, truth, frames)
    light = find_sky_light(scenario, truth.at(3))
    names = [f"{body}_veil_photons_per_s" for body in ("sun", "earth", "moon")]
    assert [table[name][3] for name in names] == pytest.approx(light[:3], rel=1e-9)
    dark = scenario.replace(lidar=scenario.lidar.replace(receiver=scenario.lidar.receiver.replace(glare=None)))
    with_sky, without = (
        next(iter(rl.simulate(one, frames=[3], keep=["photons"]))).kept["photons"].background_photons_per_s
        for one in (scenario, dark)
    )
    assert (with_sky - without)[63:65, 63:65].mean() == pytest.approx(light[:3].sum(), rel=2e-3)
    assert light[3] == 0.0  # nothing of the sky is in the field


def test_without_glare_there_are_angles_only_and_nothing_in_a_local_world(flyby):
    scenario, frames, truth = flyby
    plain = scenario.replace(lidar=scenario.lidar.replace(receiver=scenario.lidar.receiver.replace(glare=None)))
    assert set(tabulate_sky(plain, truth, frames)) == {"earth_limb_off_boresight_rad", "moon_off_boresight_rad"}
    bench = rl.Scenario.load("examples/bench_plate.toml")
    numbers = np.arange(bench.time.n_frames)
    assert tabulate_sky(bench, fly_open_loop(bench, numbers)[0], numbers) == {}


def test_a_timeline_draws_it(flyby, tmp_path):
    made = rl.study.timeline(flyby[0], casts=2)
    labels = [axes.get_ylabel() for axes in made.figure().axes]
    assert "Stray light\n[photons/s]" in labels and "Sun, Earth,\nMoon [deg]" in labels
    assert made.save(tmp_path / "timeline.csv").read_text().count("sun_veil_photons_per_s") == 1


def test_the_veil_is_the_same_with_any_number_of_nodes(flyby):
    scenario, _, truth = flyby
    receiver = scenario.lidar.receiver
    sky = rl.optics.see_sky(scenario.lidar.laser, receiver, truth.at(0), scenario.moon_position_m(0.0))
    middle = veil(sky, receiver)[60:68, 60:68].mean()
    assert middle == pytest.approx(find_sky_light(scenario, truth.at(0))[:3].sum(), rel=5e-3)
