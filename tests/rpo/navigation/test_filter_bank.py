"""The filter of relative states: consistency, limits of sensors, exact sensors, and its bits."""

import datetime

import numpy as np
import pytest
from scipy.stats import chi2

from rso_lidar.orbit import Epochs, sun_position_m
from rso_lidar.rpo import FilterBank, NavigationCamera, NavigationLidar, RelativeFilter, find_clear_views
from rso_lidar.rpo.navigation.filter_bank import find_axes_across
from rso_lidar.study.dispersions.dispersed_paths import find_nees

LIDAR = NavigationLidar(bearing_sigma_deg=0.02, range_sigma_m=0.1)
CAMERA = NavigationCamera(bearing_sigma_deg=0.01)
STEP_S = 60.0
PART = RelativeFilter(
    every_s=STEP_S, sensors=(LIDAR,), position_sigma_m=(30, 60, 30), velocity_sigma_m_s=(0.05, 0.05, 0.05),
    acceleration_m_s2_sqrt_hz=1e-4,
)  # fmt: skip
START = np.diag(PART.start_sigma**2)
FORWARD = np.kron([[1.0, STEP_S], [0.0, 1.0]], np.eye(3))  # free motion: a filter need not know which
REFERENCE_M = np.array([[50.0], [-2000.0], [30.0]])


def fly(sensor, steps, n_runs, seed=1):
    """Return the filters and true deviations of runs with process noise, after some steps."""
    rng = np.random.default_rng(seed)
    true = np.zeros((6, n_runs))
    bank = FilterBank(PART.start_sigma[:, None] * rng.standard_normal((6, n_runs)), START, has_thrust=False)
    noise = PART.find_noise(STEP_S)
    root = np.linalg.cholesky(noise)
    for _ in range(steps):
        true = FORWARD @ true + root @ rng.standard_normal((6, n_runs))
        bank.predict(FORWARD @ bank.orbit, FORWARD, noise)
        numbers = rng.standard_normal((3, n_runs))
        if sensor is not None:
            bank.observe(sensor, REFERENCE_M, REFERENCE_M + true[:3], numbers)
    return bank, true


@pytest.mark.parametrize("sensor", [LIDAR, CAMERA, None])
def test_errors_are_as_large_as_the_filter_says(sensor):
    """The sum of NEES of 400 runs is chi-square; within 99.9 %."""
    bank, true = fly(sensor, 12, 400)
    nees = find_nees(bank.orbit - true, bank.covariance.transpose(2, 0, 1))
    low, high = chi2.ppf([0.0005, 0.9995], 6 * 400)
    assert low < nees.sum() < high


def test_without_measurement_the_covariance_is_the_propagated_one():
    far = LIDAR.replace(most_range_m=100.0)
    bank, _ = fly(far, 5, 3)
    wanted = START
    for _ in range(5):
        wanted = FORWARD @ wanted @ FORWARD.T + PART.find_noise(STEP_S)
    np.testing.assert_allclose(bank.covariance[:, :, 1], wanted, rtol=1e-12, atol=1e-15)


def test_sensors_without_noise_lead_to_the_truth():
    exact = NavigationLidar(bearing_sigma_deg=1e-6, range_sigma_m=1e-4)
    bank = FilterBank(PART.start_sigma[:, None] * np.ones((6, 1)), START, has_thrust=False)
    still, none = np.zeros((6, 1)), np.zeros((6, 6))
    for _ in range(4):
        bank.predict(FORWARD @ bank.orbit, FORWARD, none)
        bank.observe(exact, REFERENCE_M, REFERENCE_M + still[:3], np.zeros((3, 1)))
    assert np.abs(bank.orbit[:3]).max() < 1e-3
    assert np.abs(bank.orbit[3:]).max() < 1e-5
    assert np.linalg.eigvalsh(bank.covariance[:, :, 0]).min() > 0.0


def test_one_range_and_direction_give_the_position_of_least_squares():
    """With a wide start, the estimate is the measured point, and its covariance that of the sensor."""
    bank = FilterBank(np.full((6, 1), 20.0), np.diag([1e4] * 3 + [1.0] * 3), has_thrust=False)
    numbers = np.array([[1.0], [-2.0], [0.5]])
    bank.observe(LIDAR, REFERENCE_M, REFERENCE_M, numbers)
    size = np.linalg.norm(REFERENCE_M)
    along = REFERENCE_M / size
    first, second = find_axes_across(along)
    angle = np.deg2rad(0.02)
    direction = along + angle * (1.0 * first - 2.0 * second)
    measured = (size + 0.05) * direction / np.linalg.norm(direction)
    np.testing.assert_allclose(REFERENCE_M + bank.orbit[:3], measured, atol=5e-3)
    spread = bank.covariance[:3, :3, 0]
    assert (along.T @ spread @ along).item() == pytest.approx(0.01, rel=1e-3)
    assert (first.T @ spread @ first).item() == pytest.approx((angle * size) ** 2, rel=1e-3)


def test_a_camera_measures_no_range():
    bank, _ = fly(CAMERA, 1, 1)
    along = REFERENCE_M / np.linalg.norm(REFERENCE_M)
    spread = (along.T @ bank.covariance[:3, :3, 0] @ along).item()
    before = (FORWARD @ START @ FORWARD.T + PART.find_noise(STEP_S))[:3, :3]
    assert spread == pytest.approx((along.T @ before @ along).item(), rel=0.02)


def test_out_of_range_and_field_nothing_is_measured():
    near, narrow = LIDAR.replace(least_range_m=5000.0), LIDAR.replace(fov_deg=1.0)
    for sensor, aside_m, sees in ((near, 0.0, False), (narrow, 0.0, True), (narrow, 30.0, False)):
        bank = FilterBank(np.zeros((6, 1)), START, has_thrust=False)
        true = REFERENCE_M + np.array([[aside_m], [0.0], [0.0]])  # 30 m at 2 km are 0.86 degrees
        (update, *_) = bank.observe(sensor, REFERENCE_M, true, np.zeros((3, 1)))
        assert bool(np.any(update.gain)) == sees
        assert np.array_equal(bank.covariance[:, :, 0], START) != sees


def test_a_run_has_the_same_bits_alone_and_among_others():
    rng = np.random.default_rng(2)
    first, numbers = PART.start_sigma[:, None] * rng.standard_normal((6, 50)), rng.standard_normal((3, 50))
    made = []
    for chosen in (slice(None), slice(17, 18)):
        bank = FilterBank(first[:, chosen], START, has_thrust=True)
        bank.begin_leg()
        bank.predict(bank.orbit, FORWARD, PART.find_noise(STEP_S), np.full((6, 4), 0.1))
        bank.add_burn(0.01 * numbers[:, chosen], np.full((3, 3, 1), 1e-6))
        bank.observe(LIDAR, REFERENCE_M, REFERENCE_M + first[:3, chosen], numbers[:, chosen])
        made.append((bank.state, bank.covariance))
    assert made[0][0][:, 17].tobytes() == made[1][0][:, 0].tobytes()
    assert made[0][1][:, :, 17].tobytes() == made[1][1][:, :, 0].tobytes()


def test_process_noise_is_that_of_white_acceleration():
    """Halves of a step add up to the whole one."""
    half = np.kron([[1.0, 30.0], [0.0, 1.0]], np.eye(3))
    twice = half @ PART.find_noise(30.0) @ half.T + PART.find_noise(30.0)
    np.testing.assert_allclose(twice, PART.find_noise(60.0), rtol=1e-12)


@pytest.mark.parametrize(("angle_deg", "is_clear"), [(20.0, False), (40.0, True), (160.0, True)])
def test_the_sun_blinds_a_camera_that_looks_towards_it(angle_deg, is_clear):
    """A target on the Sun's side of the Earth, seen at an angle from the Sun; the camera's limit is 30 degrees."""
    epochs = Epochs(datetime.datetime(2024, 9, 17, 12, tzinfo=datetime.UTC), np.zeros(1))
    sun = sun_position_m(epochs)[0]
    ahead = sun / np.linalg.norm(sun)
    across = np.cross(ahead, [0.0, 0.0, 1.0])
    across /= np.linalg.norm(across)
    target_m = 4.2e7 * ahead
    sight = np.cos(np.radians(angle_deg)) * ahead + np.sin(np.radians(angle_deg)) * across
    camera = NavigationCamera(bearing_sigma_deg=0.01, sun_exclusion_deg=30.0)
    seen = find_clear_views((camera,), epochs, target_m[None], (target_m - 1000.0 * sight)[None])
    assert seen.tolist() == [[is_clear]]
    dark = find_clear_views((camera,), epochs, -target_m[None], (-target_m - 1000.0 * across)[None])
    assert dark.tolist() == [[False]]  # in the Earth's shadow
