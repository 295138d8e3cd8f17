"""Gyros and accelerometers: the oracle, axes, signs, lever arm, limit and resolution."""

import numpy as np
import pytest

from rso_lidar import sensors, units
from rso_lidar.errors import ScenarioError
from rso_lidar.kernels import packed
from rso_lidar.sensors.inertial import add_lever_arm, measure_triad
from tests.reference.sensors import inertial as reference
from tests.sensors.motion_for_tests import make_motion

KEY = sensors.make_key(7, "imu")


@pytest.mark.parametrize(("limit", "resolution"), [(np.inf, 0.0), (1.2, 0.0), (1.2, 0.01)])
def test_a_triad_measures_what_the_oracle_says(limit, resolution):
    rng = np.random.default_rng(2)
    truth, errors = rng.normal(size=(50, 3)), 0.1 * rng.normal(size=(50, 3))
    distortion = 0.05 * rng.normal(size=9)
    matrix = packed(np.linalg.qr(rng.normal(size=(3, 3)))[0])
    valid = rng.random(50) > 0.2
    expected, expected_valid = reference.measure_triad(truth, matrix, distortion, limit, resolution, errors, valid)
    values = errors.copy()
    measure_triad(packed(truth), matrix, packed(distortion), limit, resolution, values, valid)
    np.testing.assert_allclose(values, expected, rtol=1e-13, atol=1e-14)
    np.testing.assert_array_equal(valid, expected_valid)
    assert 0 < valid.sum() < 50


def test_a_lever_arm_is_what_the_oracle_says():
    rng = np.random.default_rng(2)
    rate, change, force = (rng.normal(size=(20, 3)) for _ in range(3))
    arm = np.array([0.3, -0.5, 0.7])
    expected = reference.add_lever_arm(arm, rate, change, force)
    add_lever_arm(packed(arm), packed(rate), packed(change), force)
    np.testing.assert_allclose(force, expected, rtol=1e-13, atol=1e-14)


def test_an_accelerometer_away_from_the_axis_feels_the_centripetal_acceleration():
    motion = make_motion([0.0], angular_velocity_rad_s=[[0.0, 0.0, 0.5]], angular_acceleration_rad_s2=[[0.0, 0.0, 0.1]])
    part = sensors.Accelerometer(name="imu", rate_hz=1.0, mount={"position_m": (2.0, 0.0, 0.0)})
    samples, _ = part.measure(motion, KEY, 0)
    np.testing.assert_allclose(samples.specific_force_m_s2, [[-0.5, 0.2, 0.0]], atol=1e-15)  # -w2 r, and a r
    still = make_motion([0.0], angular_velocity_rad_s=[[0.0, 0.0, 0.5]])
    with pytest.raises(ScenarioError, match="needs the angular acceleration"):
        part.measure(still, KEY, 0)


def test_rates_are_in_sensor_axes():
    mount = {"euler_zyx_deg": (90.0, 0.0, 0.0)}  # sensor x along body y
    motion = make_motion([0.0], angular_velocity_rad_s=[[0.1, 0.2, 0.3]])
    samples, _ = sensors.Gyro(name="imu", rate_hz=1.0, mount=mount).measure(motion, KEY, 0)
    np.testing.assert_allclose(samples.angular_velocity_rad_s, [[0.2, -0.1, 0.3]], atol=1e-15)


def test_a_saturated_axis_is_at_its_limit_and_not_valid():
    motion = make_motion([0.0, 1.0], angular_velocity_rad_s=[[0.1, -5.0, 0.0], [0.1, 0.2, 0.0]])
    gyro = sensors.Gyro(name="imu", rate_hz=1.0, max_rate_deg_s=100.0)
    samples, _ = gyro.measure(motion, KEY, 0)
    assert samples.valid.tolist() == [False, True]
    np.testing.assert_allclose(samples.angular_velocity_rad_s[0], [0.1, -100.0 * units.DEG, 0.0])


def test_a_rate_at_the_limit_is_measured_and_one_beyond_is_not():
    valid, values = np.array([True, True]), np.zeros((2, 3))
    truth = np.array([[0.1, -2.0, 0.3], [0.1, np.nextafter(-2.0, -3.0), 0.3]])
    measure_triad(truth, np.eye(3), np.zeros(9), 2.0, 0.0, values, valid)
    assert valid.tolist() == [True, False] and values[:, 1].tolist() == [-2.0, -2.0]


def test_rates_are_rounded_to_the_resolution():
    step = 3600.0 * units.DEG_H
    motion = make_motion([0.0], angular_velocity_rad_s=[[0.4 * step, 0.6 * step, -7.6 * step]])
    samples, _ = sensors.Gyro(name="imu", rate_hz=1.0, resolution_deg_h=3600.0).measure(motion, KEY, 0)
    np.testing.assert_allclose(samples.angular_velocity_rad_s, [[0.0, step, -8.0 * step]], atol=1e-15)


def test_constant_errors_have_their_sigma_over_seeds_and_are_constant_in_a_run():
    """Turn-on bias, scale factor and misalignment, each alone, from 400 seeds of three axes: within five standard errors."""
    rate = 0.1
    truth = make_motion([0.0, 1.0, 2.0], angular_velocity_rad_s=[[rate, 0.0, 0.0]] * 3)
    bias = sensors.Gyro(name="imu", rate_hz=1.0, turn_on_bias_deg_h=10.0)
    bent = sensors.Gyro(name="imu", rate_hz=1.0, scale_factor_ppm=500.0, misalignment_mrad=2.0)
    found = {part: [] for part in (bias, bent)}
    for part, values in found.items():
        for seed in range(400):
            samples, _ = part.measure(truth, sensors.make_key(seed, "imu"), 0)
            assert (samples.angular_velocity_rad_s == samples.angular_velocity_rad_s[0]).all()
            values.append(samples.angular_velocity_rad_s[0] - [rate, 0.0, 0.0])
    for values, sigma in [
        (np.ravel(found[bias]), 10.0 * units.DEG_H),
        (np.array(found[bent])[:, 0], 500e-6 * rate),
        (np.array(found[bent])[:, 1:].ravel(), 2e-3 * rate),
    ]:
        assert abs(np.mean(values)) < 5.0 * sigma / np.sqrt(values.size)
        assert abs(np.std(values) / sigma - 1.0) < 5.0 / np.sqrt(2.0 * values.size)
