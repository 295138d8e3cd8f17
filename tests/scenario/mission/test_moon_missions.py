"""Missions about the Moon: described and flown about its centre, and what is modelled for the Earth only is refused."""

from pathlib import Path

import numpy as np
import pytest
import skyfield

import rso_lidar as rl
from rso_lidar.errors import ScenarioError
from rso_lidar.scenario import list_lunar_bodies

KERNEL = Path(skyfield.__file__).parent / "tests" / "data" / "de430-2015-03-02.bsp"
TEXT = f"""
version = 1
name = "Two craft about the Moon"
[time]
start_utc = 2015-03-02T01:00:00Z
duration_s = 6600
frame_rate_hz = 0.01
[[target]]
name = "orbiter"
model = "plate"
attitude = {{ type = "lvlh_ccsds" }}
[target.motion]
type = "lunar_kepler"
epoch_utc = 2015-03-02T01:00:00Z
semi_major_axis_km = 1787.4
eccentricity = 0.0
inclination_deg = 90
raan_deg = 10
argument_of_perigee_deg = 0
true_anomaly_deg = 0
kernel_file = "{KERNEL.as_posix()}"
[follower]
motion = {{ type = "hill", relative_to = "orbiter", position_m = [0, -300, 0], velocity_m_s = [0, 0, 0] }}
attitude = {{ type = "look_at", at = "orbiter" }}
[lidar]
preset = "gsfl_1064"
"""

GLARE = "[lidar.receiver]\nfilter_width_nm = 1.0\n[lidar.receiver.glare]\n"
STARS = '[[sensor]]\ntype = "star_tracker"\nname = "s"\nrate_hz = 1\n'

pytestmark = pytest.mark.skipif(not KERNEL.exists(), reason="this skyfield has no day of DE430 among its tests")


def test_it_is_described_about_the_moon_and_flown():
    scenario = rl.Scenario.loads(TEXT)
    assert list_lunar_bodies(scenario.bodies) == ["orbiter", "follower"]
    text = scenario.describe()
    assert "lunar_kepler; about the Moon a 1787.4 km, e 0.00000, i 90.000°, period 113.0 min" in text
    assert "1 eclipse: umbra from 1830" in text
    frame = next(rl.simulate(scenario, frames=[3], threads=1))
    assert np.linalg.norm(frame.truth.pose("lidar", "orbiter").translation) == pytest.approx(300.0, abs=1e-6)


def test_what_the_moon_hides_is_said():
    apart = TEXT.replace("position_m = [0, -300, 0]", "position_m = [0, -1500000, 0]").replace('"hill"', '"nonlinear"')
    lines = rl.Scenario.loads(apart).describe()
    assert "target orbiter: the Moon stands between it and the lidar" in lines


@pytest.mark.parametrize(
    ("old", "new", "problem"),
    [
        ("[[target]]", "[world]\nearth_albedo = 0.3\n[[target]]", "world.earth_albedo: 'orbiter' orbits about the Moon"),
        ("[lidar]", "[dispersion]\nposition_sigma_m = [1, 1, 1]\n[lidar]", "dispersion: 'orbiter' orbits about the Moon"),
        ("[lidar]", f"{GLARE}[lidar]", "lidar.receiver.glare: the follower orbits about the Moon"),
        ("[lidar]", '[[sensor]]\ntype = "gnss"\nname = "g"\nrate_hz = 1\n[lidar]', "sensor 'g': GNSS does not serve"),
        ("[lidar]", f"{STARS}[lidar]", "sensor 's': its exclusion angle"),
        (
            'attitude = { type = "lvlh_ccsds" }',
            'attitude = { type = "torqued", inertia_kg_m2 = [1, 2, 2.5], body_rate_deg_s = [0, 0, 1] }',
            "orbiter.attitude: 'torqued' knows the Earth's shadow and air, and the body orbits the Moon; use 'tumble'",
        ),
        ('type = "hill"', 'type = "nonlinear", forces = {}', "follower.motion: forces: are integrated with the Earth's"),
        ("kernel_file", "# kernel_file", "kernel_file: an orbit about the Moon needs the Moon's position"),
        ("start_utc = 2015", "start_utc = 2024", "orbiter.motion: kernel_file: .*does not cover"),
        (KERNEL.name, "none.bsp", r"orbiter\.motion: no file"),
    ],
)  # fmt: skip
def test_what_is_modelled_for_the_earth_only_is_refused_in_one_line(old, new, problem):
    with pytest.raises(rl.RsoLidarError, match=problem) as caught:
        _ = rl.Scenario.loads(TEXT.replace(old, new)).bodies
    assert "\n" not in str(caught.value)


def test_searches_and_fits_are_for_orbits_about_the_earth(tmp_path):
    place = tmp_path / "moon.toml"
    place.write_text(TEXT, encoding="utf-8")
    scenario = rl.Scenario.load(place)
    with pytest.raises(
        ScenarioError, match="orbiter orbits about the Moon, and encounters are searched about the Earth"
    ):
        rl.study.encounters(str(place), "orbiter", within_m=1e4, start_utc=scenario.time.start_utc, days=0.1)
