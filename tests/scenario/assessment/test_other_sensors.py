"""What `check` says of the other sensors: a line for each, and what keeps them from their stated performance."""

import runpy
from pathlib import Path

import numpy as np
import pytest

import rso_lidar as rl
from rso_lidar.errors import ScenarioError
from rso_lidar.scenario import preview_mission
from rso_lidar.scenario.assessment.other_sensors import advise_on_sensors, describe_sensors
from tests.settings_for_tests import limit_pixels

EXAMPLES = Path(__file__).resolve().parents[3] / "examples"
SMALL = limit_pixels(8)


def load(*sensors, settings=()):
    return rl.Scenario.load(EXAMPLES / "onboard_sensors.toml", (*SMALL, *settings, f"sensor=[{', '.join(sensors)}]"))


def advise(scenario):
    return advise_on_sensors(scenario, preview_mission(scenario))


def test_each_sensor_has_one_line_in_the_units_of_its_datasheet():
    scenario = rl.Scenario.load(EXAMPLES / "onboard_sensors.toml")
    lines = describe_sensors(scenario)
    assert [line.split()[1] for line in lines] == [f"{sensor.name}:" for sensor in scenario.sensor]
    assert lines[0] == (
        "sensor      gyro: gyro (stim300_gyro), angular velocity; 20 Hz (20 per frame); angle random walk 0.15 °/√h, bias "
        "instability 0.488 °/h, turn-on bias 4 °/h, scale factor 500 ppm, misalignment 1 mrad, limit 400 °/s, resolution "
        "0.22 °/h"
    )
    for words in (
        "star_tracker (nst), attitude",
        "2 Hz (2 per frame), latency 0.2 s",
        "Sun exclusion 45°, Moon exclusion 20°",
    ):
        assert words in lines[2]
    assert lines[3].endswith("white velocity error 0.02 m/s; outages 30 to 40 s")
    assert "position and velocity relative to stage, rtn axes; 1 Hz" in lines[4]


def test_schedules_errors_and_outages_in_words():
    outages = ", ".join(f"{{from_s={k}, to_s={k + 0.5}}}" for k in range(5))
    slow, often = describe_sensors(
        load(
            '{type="gyro", name="slow", rate_hz=0.25, phase_s=1}',
            f'{{type="gnss", name="often", rate_hz=1, outages=[{outages}], random_outage={{mean_up_s=60, mean_down_s=5}}}}',
        )
    )
    assert slow.endswith("angular velocity; 0.25 Hz (one every 4 frames), from 1 s; no errors stated")
    assert often.endswith("outages 0 to 0.5 s, 1 to 1.5 s, 3 more, at random, 5 s after 60 s (means)")


def test_a_users_sensor_has_a_line_too():
    own = runpy.run_path(str(EXAMPLES / "seams" / "own_sensor.py"))["SunSensor"]()
    scenario = load().replace(sensor=(own,))
    assert describe_sensors(scenario)[0].endswith("sun_sensor: SunSensor, a Python object; 2 Hz (2 per frame)")
    assert advise(scenario) == []


def test_a_sound_suite_has_no_warning():
    assert advise(rl.Scenario.load(EXAMPLES / "onboard_sensors.toml")) == []


@pytest.mark.slow
def test_check_predicts_the_blinding_of_a_run():
    """A body that turns once in 600 s sweeps its tracker over the Earth and the Sun; the run has a sample for each frame."""
    tracker = (
        '{type="star_tracker", name="tracker", rate_hz=0.1, mount={euler_zyx_deg=[0, 90, 0]}, sun_exclusion_deg=40, '
    )
    settings = (
        "time.duration_s=600",
        "time.frame_rate_hz=0.1",
        'follower.attitude={type="spin", axis=[0, 0, 1], rate_deg_s=0.6}',
        "time.start_utc=2024-09-17T12:50:00Z",
    )
    scenario = load(tracker + "earth_exclusion_deg=10, acquisition_s=20}", settings=settings)
    (line,) = advise(scenario)
    at_once = load(tracker + "earth_exclusion_deg=10}", settings=settings)
    valid = np.concatenate([frame.observation.sensors["tracker"].valid for frame in rl.simulate(at_once)])
    assert 0.1 < np.mean(~valid) < 0.9
    first_s = 10.0 * np.argmin(valid)
    assert f"sensor 'tracker': no attitude {np.mean(~valid):.0%} of the time, first at {first_s:g} s: " in line
    for words in ("the Sun ", "the Earth ", "then searches for 20 s", "turn its mount or the follower"):
        assert words in line
    assert "the Moon" not in line
    (fast,) = advise(load(tracker + "earth_exclusion_deg=10, max_rate_deg_s=0.5}", settings=settings))
    assert "100% of the time" in fast and "the body's rate 100%" in fast and "searches" not in fast


def test_gnss_above_its_service_volume():
    settings = ("time.duration_s=20", 'sensor=[{type="gnss", name="receiver", rate_hz=1}]')
    (line,) = advise(rl.Scenario.load(EXAMPLES / "tdrs_approach.toml", settings))
    assert "'receiver': above the terrestrial service volume (3000 km) 100% of the time" in line


def test_an_accelerometer_on_a_prescribed_path_measures_no_thrust():
    accelerometer = '{type="accelerometer", name="imu", rate_hz=1}'
    fixed = 'follower.motion={type="fixed", relative_to="stage", position_m=[0, -60, 4]}'
    (line,) = advise(load(accelerometer, settings=(fixed,)))
    assert "'imu': measures no thrust" in line and "proximity operation" in line
    assert advise(load(accelerometer)) == []  # in free fall zero is right


def test_a_sensor_without_a_sample_in_the_run():
    gyro = '{{type="gyro", name="late", rate_hz=1, phase_s=50, latency_s={}}}'
    (line,) = advise(load(gyro.format(9.5)))
    assert "'late': no sample becomes available until the last frame, at 59 s" in line
    assert advise(load(gyro.format(9))) == []


@pytest.mark.parametrize(
    ("sensor", "error"),
    [
        ('{type="wheels", name="a", rate_hz=1, dynamics="attitude", speed_entries=[0]}', "not of type state_space"),
        ('{type="thrusters", name="a", rate_hz=1, dynamics="motion", force_entries=[3]}', "has 3 entries.*but entry 3"),
    ],
)
def test_telemetry_without_its_actuators_does_not_load(sensor, error):
    with pytest.raises(ScenarioError, match=error):
        rl.Scenario.load(EXAMPLES / "thrusters.toml", (f"sensor=[{sensor}]",))
