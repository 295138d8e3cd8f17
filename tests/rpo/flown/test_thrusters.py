"""Thrusters: statistics of Gates' errors, burns that give their impulse, mass by Tsiolkovsky."""

import math

import numpy as np
import pytest

from rso_lidar import units
from rso_lidar.orbit import Impulse
from rso_lidar.rpo import NavigationErrors, Thrusters
from rso_lidar.rpo.flown.thrusters import IMPULSES, NAVIGATION, make_generator

WANTED = np.array([0.3, -0.4, 1.2])  # 1.3 m/s
N = 4000


def test_errors_have_the_covariance_of_gates():
    """Along the burn s1^2 + s2^2 v^2, across it s3^2 + s4^2 v^2 on each axis (Gates 1963), small angles."""
    gates = Thrusters(
        magnitude_sigma_fraction=0.01,
        magnitude_sigma_m_s=0.005,
        pointing_sigma_deg=0.5,
        pointing_sigma_m_s=0.004,
    )
    done = np.array([gates.disturb(WANTED, make_generator(7, IMPULSES, k)) for k in range(N)])
    along = WANTED / 1.3
    error = done - WANTED
    down = error @ along
    across = error - down[:, None] * along
    s_along = math.hypot(0.005, 0.013)
    s_across = math.hypot(0.004, 0.5 * units.DEG * 1.3)
    # a sample variance of n draws is off by sqrt(2 / n); 5 sigma
    assert np.var(down) == pytest.approx(s_along**2, rel=5.0 * math.sqrt(2.0 / N))
    assert np.mean(np.sum(across**2, axis=1)) == pytest.approx(2.0 * s_across**2, rel=5.0 / math.sqrt(N))
    assert abs(down.mean()) < 5.0 * s_along / math.sqrt(N) + 1.3 * (0.5 * units.DEG) ** 2  # the cosine of the angle


def test_a_fixed_error_of_pointing_is_across_the_burn_alone():
    """Its variance along each of the two axes is that of the setting; a sample variance of 2 N draws is off by √(1/N)."""
    error = np.array(
        [Thrusters(pointing_sigma_m_s=0.004).disturb(WANTED, make_generator(7, IMPULSES, k)) - WANTED for k in range(N)]
    )
    np.testing.assert_allclose(error @ WANTED, 0.0, atol=1e-15)
    assert np.mean(np.sum(error**2, axis=1)) == pytest.approx(2.0 * 0.004**2, rel=5.0 / math.sqrt(N))


def test_constant_errors_scale_and_turn():
    bad = Thrusters(magnitude_error_fraction=0.02, misalignment_deg=(0.0, 0.0, 90.0))
    done = bad.disturb(np.array([1.0, 0.0, 0.0]), make_generator(0, IMPULSES, 0))
    np.testing.assert_allclose(done, [0.0, 1.02, 0.0], rtol=0, atol=1e-15)


@pytest.mark.parametrize(
    "thrusters",
    [
        Thrusters(acceleration_m_s2=0.02, rise_s=1.0, fall_s=3.0),
        Thrusters(thrust_n=5.0, mass_kg=200.0),
        Thrusters(thrust_n=5.0, mass_kg=200.0, isp_s=220.0, rise_s=0.5, fall_s=0.5),
    ],
)
@pytest.mark.parametrize("size", [1.0, 1e-3])  # long burns, and pulses shorter than rise and fall
def test_a_burn_integrates_to_its_change_of_velocity(thrusters, size):
    burn = thrusters.make_maneuver(10.0, WANTED / 1.3 * size, 200.0)
    assert burn.size_m_s == pytest.approx(size, rel=1e-12)
    assert burn.duration_s == pytest.approx(thrusters.find_duration_s(size, 200.0), rel=1e-12)
    times = np.linspace(burn.from_s, burn.until_s, 4001)
    pushed = [burn.acceleration(t, [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]) for t in times.tolist()]
    np.testing.assert_allclose(np.trapezoid(pushed, times, axis=0), WANTED / 1.3 * size, rtol=1e-5)
    peak = np.linalg.norm(pushed, axis=1).max()
    assert peak <= (thrusters.acceleration_m_s2 or 5.0 / (200.0 - 0.1)) * (1.0 + 1e-9)


def test_mass_decreases_by_tsiolkovsky():
    isp = Thrusters(thrust_n=5.0, mass_kg=200.0, isp_s=220.0)
    assert isp.spend(200.0, 10.0) == pytest.approx(200.0 * math.exp(-10.0 / (220.0 * 9.80665)))
    assert Thrusters(thrust_n=5.0, mass_kg=200.0).spend(200.0, 10.0) == 200.0


def test_without_thrust_it_is_an_impulse_and_nothing_is_none():
    exact = Thrusters()
    impulse = exact.make_maneuver(0.0, WANTED, math.nan)
    assert isinstance(impulse, Impulse) and impulse.axes == "chief_rtn"
    assert impulse.size_m_s == pytest.approx(1.3)
    assert exact.make_maneuver(0.0, 1e-12 * WANTED, math.nan) is None


def test_navigation_errors_have_their_deviations():
    errors = NavigationErrors(position_sigma_m=2.0, velocity_sigma_m_s=0.01)
    known = [errors.disturb((np.zeros(3), np.ones(3)), make_generator(1, NAVIGATION, k)) for k in range(N)]
    position, velocity = (np.array(rows) for rows in zip(*known, strict=True))
    assert np.std(position) == pytest.approx(2.0, rel=5.0 / math.sqrt(2 * 3 * N))
    assert np.std(velocity) == pytest.approx(0.01, rel=5.0 / math.sqrt(2 * 3 * N))
    assert np.mean(velocity) == pytest.approx(1.0, abs=0.001)
