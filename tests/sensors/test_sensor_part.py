"""What all described sensors have: chunks of samples, outages, states, and messages for wrong tables."""

import numpy as np
import pytest

from rso_lidar import sensors
from rso_lidar.errors import ScenarioError
from rso_lidar.records import BodyState, SensorSamples, specs
from rso_lidar.sensors.sensor_part import flicker, gauss_markov_allan_variance
from tests.sensors.motion_for_tests import make_motion

MOUNT = {"position_m": (0.1, -0.2, 0.3), "euler_zyx_deg": (10.0, 20.0, 30.0)}
BURSTS = {"mean_up_s": 0.5, "mean_down_s": 0.2}
ALL = [
    sensors.Gyro(
        name="gyro", rate_hz=100.0, mount=MOUNT, angle_random_walk_deg_sqrt_h=0.15, bias_instability_deg_h=0.3,
        rate_random_walk_deg_h_sqrt_h=0.1, turn_on_bias_deg_h=4.0, scale_factor_ppm=500.0, misalignment_mrad=1.0,
        max_rate_deg_s=1.5, resolution_deg_h=0.2, random_outage=BURSTS, outages=[{"from_s": 0.3, "to_s": 0.4}],
    ),
    sensors.Accelerometer(
        name="accelerometer", rate_hz=100.0, mount=MOUNT, velocity_random_walk_m_s_sqrt_h=0.06, bias_instability_ug=50.0,
        acceleration_random_walk_ug_sqrt_h=10.0, turn_on_bias_ug=700.0, max_acceleration_g=0.002, random_outage=BURSTS,
    ),
    sensors.Gnss(
        name="gnss", rate_hz=3.0, phase_s=0.25, position_noise_m=1.0, slow_position_m=2.0, velocity_noise_m_s=0.03,
        slow_velocity_m_s=0.01, vertical_ratio=1.5, antenna_m=(1.0, 0.5, 0.2), random_outage=BURSTS,
    ),
    sensors.RelativeGnss(name="relative", rate_hz=1.0, target="tdrs", position_noise_m=0.1, slow_position_m=0.2),
    sensors.StarTracker(
        name="tracker", rate_hz=4.0, mount=MOUNT, cross_boresight_arcsec=5.0, boresight_arcsec=30.0,
        slow_cross_boresight_arcsec=3.0, misalignment_arcsec=10.0, sun_exclusion_deg=35.0, moon_exclusion_deg=20.0,
        earth_exclusion_deg=25.0, max_rate_deg_s=1.0, random_outage=BURSTS,
    ),
    sensors.WheelTelemetry(
        name="wheels", rate_hz=4.0, dynamics="attitude", speed_entries=(7, 8), torque_entries=(0,), speed_noise_rpm=1.0,
        speed_resolution_rpm=0.5, torque_noise_n_m=0.001,
    ),
    sensors.ThrusterTelemetry(
        name="thrusters", rate_hz=4.0, dynamics="motion", force_entries=(2, 0), newtons_per_input=50.0, force_noise_n=0.1,
        scale_factor_ppm=1e4, random_outage=BURSTS,
    ),
]  # fmt: skip


def full_motion(time_s):
    """Return a motion of which every sensor finds what it measures."""
    rng, n = np.random.default_rng(3), len(time_s)
    targets = {"tdrs": BodyState(100.0 * rng.normal(size=(n, 3)), rng.normal(size=(n, 3)))}
    widths = {"motion.state": 6, "motion.input": 3, "attitude.state": 9, "attitude.input": 2}
    return make_motion(
        time_s, rng, targets=targets, dynamics={name: rng.normal(size=(n, width)) for name, width in widths.items()}
    )


@pytest.mark.parametrize("sensor", ALL, ids=lambda sensor: sensor.name)
def test_samples_do_not_depend_on_how_they_are_divided(sensor):
    key = sensors.make_key(7, sensor.name)
    motion = full_motion(sensors.read_schedule(sensor).time_samples(range(200)))
    whole, last = sensor.measure(motion, key, 0)
    pieces, state = [], None
    for begin, end in [(0, 1), (1, 2), (2, 50), (50, 50), (50, 51), (90, 200)]:  # those from 51 to 90 are left out
        samples, state = sensor.measure(motion.some(np.arange(begin, end)), key, begin, state)
        pieces.append((slice(begin, end), samples))
    assert state.next_sample == last.next_sample == 200
    np.testing.assert_array_equal(state.values, last.values)
    for part, samples in pieces:
        for name in specs(type(whole)):
            np.testing.assert_array_equal(getattr(samples, name), getattr(whole, name)[part], err_msg=name)
    assert whole.valid.any()
    measured = [name for name in specs(type(whole)) if name not in specs(SensorSamples)]
    assert all(np.isfinite(getattr(whole, name)[whole.valid]).all() for name in measured)


def test_samples_hold_at_their_time_and_arrive_later():
    gnss = ALL[2].replace(latency_s=0.3, random_outage=None)
    times = sensors.read_schedule(gnss).time_samples(range(3, 9))
    samples, _ = gnss.measure(full_motion(times), sensors.make_key(1, "gnss"), 3)
    np.testing.assert_allclose(samples.time_s, [1.25, 0.25 + 4 / 3, 0.25 + 5 / 3, 2.25, 0.25 + 7 / 3, 0.25 + 8 / 3])
    np.testing.assert_array_equal(samples.available_s, samples.time_s + 0.3)
    assert samples.valid.all()


def test_samples_of_an_outage_are_not_valid_and_the_errors_go_on():
    quiet = sensors.Gyro(name="gyro", rate_hz=10.0, angle_random_walk_deg_sqrt_h=1.0, bias_instability_deg_h=1.0)
    gyro = quiet.replace(outages=[{"from_s": 1.0, "to_s": 2.0}])
    motion, key = make_motion(sensors.read_schedule(gyro).time_samples(range(40))), sensors.make_key(1, "gyro")
    whole, _ = quiet.measure(motion, key, 0)
    samples, _ = gyro.measure(motion, key, 0)
    out = (motion.time_s >= 1.0) & (motion.time_s < 2.0)
    np.testing.assert_array_equal(samples.valid, ~out)
    assert np.isnan(samples.angular_velocity_rad_s[out]).all()
    np.testing.assert_array_equal(samples.angular_velocity_rad_s[~out], whole.angular_velocity_rad_s[~out])


def test_random_outages_have_their_mean_durations():
    """Exponential durations: each mean is within five standard errors, at two rates of the same outages."""
    for rate_hz in (2.0, 10.0):
        gnss = sensors.Gnss(name="gnss", rate_hz=rate_hz, random_outage={"mean_up_s": 40.0, "mean_down_s": 8.0})
        n = 100_000
        _, valid, _ = gnss.draw(sensors.make_key(1, "gnss"), 0, np.arange(n) / rate_hz, None)
        changes = np.flatnonzero(np.diff(valid.astype(int)))
        spans = np.diff(changes) / rate_hz
        ups = spans[valid[changes[:-1] + 1]]
        downs = spans[~valid[changes[:-1] + 1]]
        step = 1.0 / rate_hz  # a sampled chain: its spans are geometric, and short ones between samples are not seen
        rate_in, rate_out = gnss.error_model.outage[1] / step, (1.0 - gnss.error_model.outage[0]) / step
        assert abs(ups.mean() * rate_in - 1.0) < 5.0 / np.sqrt(len(ups))
        assert abs(downs.mean() * rate_out - 1.0) < 5.0 / np.sqrt(len(downs))
        assert abs((~valid).mean() - 8.0 / 48.0) < 5.0 * (8.0 / 48.0) * np.sqrt(2.0 / len(downs))
        assert 1.0 / rate_in == pytest.approx(40.0, rel=0.04 if rate_hz > 5 else 0.2)


def test_the_flat_of_flicker_is_its_floor():
    times = np.geomspace(30.0, 5000.0, 50)
    total = sum(
        gauss_markov_allan_variance(times, it.start, -0.1 / np.log(it.decay))
        for it in flicker((0,), 2.0, (10.0, 1e4), 0.1)
    )
    assert len(flicker((0,), 2.0, (10.0, 1e4), 0.1)) == 4
    np.testing.assert_allclose(np.sqrt(total), 2.0, rtol=0.06)
    single = flicker((0,), 2.0, (100.0, 100.0), 0.1)
    assert len(single) == 1
    peak = np.sqrt(gauss_markov_allan_variance(np.array([189.26]), single[0].start, 100.0))  # IEEE Std 952, C.1.5
    np.testing.assert_allclose(peak, 2.0, rtol=1e-4)


def test_a_state_that_is_too_late_or_of_another_sensor_is_an_error():
    gyro, key = ALL[0], sensors.make_key(1, "gyro")
    _, state = gyro.measure(full_motion(np.arange(5) / 100.0), key, 0)
    with pytest.raises(ScenarioError, match="before sample 5 does not serve sample 4"):
        gyro.measure(full_motion(np.array([0.04])), key, 4, state)
    with pytest.raises(ScenarioError, match="sensor 'gnss'"):
        ALL[2].measure(full_motion(np.array([0.05])), key, 5, state)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"rate_hz": 0.0}, "rate_hz"),
        ({"rate_hz": 2e5}, "rate_hz"),
        ({"latency_s": -1.0}, "latency_s"),
        ({"outages": [{"from_s": 2.0, "to_s": 1.0}]}, "must be after from_s"),
        ({"bias_correlation_s": [100.0, 10.0]}, "shortest and the longest"),
        ({"bias_correlation_s": [1.0, 1e9]}, "7 decades"),
        ({"preset": "stimm300"}, "no gyro 'stimm300'"),
        ({"angle_random_walk_deg_h": 1.0}, "angle_random_walk_deg_sqrt_h"),
        ({"name": "gyro 1"}, "name"),
    ],
)
def test_wrong_tables_have_one_line(change, words):
    with pytest.raises(ScenarioError, match=words) as raised:
        sensors.Gyro(**{"name": "gyro", "rate_hz": 100.0} | change)
    assert "\n" not in str(raised.value)
