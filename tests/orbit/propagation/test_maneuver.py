"""Impulses and burns: axes, delta-v, mass."""

import math

import numpy as np
import pytest

from rso_lidar.errors import ScenarioError
from rso_lidar.orbit import Burn, Impulse, rotate_to_inertial

R, V = [7e6, 0.0, 0.0], [100.0, 0.0, 7.5e3]  # r x v is along -y


def test_axes():
    assert rotate_to_inertial((1.0, 2.0, 3.0), "inertial", R, V) == (1.0, 2.0, 3.0)
    # rtn: x out, z along r x v = -y, y = z x x = +z
    np.testing.assert_allclose(rotate_to_inertial((1.0, 2.0, 3.0), "rtn", R, V), (1.0, -3.0, 2.0), atol=1e-15)
    # vnc: x along v, y along r x v = -y, z = x x y, outward
    u, w = 100.0 / math.hypot(100, 7500), 7500.0 / math.hypot(100, 7500)
    np.testing.assert_allclose(rotate_to_inertial((1.0, 0.0, 0.0), "vnc", R, V), (u, 0.0, w), atol=1e-15)
    np.testing.assert_allclose(rotate_to_inertial((0.0, 1.0, 0.0), "vnc", R, V), (0.0, -1.0, 0.0), atol=1e-15)
    np.testing.assert_allclose(rotate_to_inertial((0.0, 0.0, 1.0), "vnc", R, V), (w, 0.0, -u), atol=1e-15)


def test_impulse_changes_the_velocity_only():
    impulse = Impulse(at_s=10.0, delta_v_m_s=(0.0, 3.0, 4.0))
    after = impulse.apply(np.array([*R, *V, 9.0]))
    np.testing.assert_allclose(after, [*R, 100.0, -4.0, 7503.0, 9.0], rtol=1e-15, atol=1e-15)
    assert impulse.size_m_s == 5.0


def test_burn_obeys_tsiolkovsky():
    burn = Burn(from_s=5.0, duration_s=100.0, thrust_n=(0.0, 400.0, 300.0), mass_kg=200.0, isp_s=300.0)
    flow = 500.0 / (9.80665 * 300.0)
    assert burn.size_m_s == pytest.approx(9.80665 * 300.0 * math.log(200.0 / (200.0 - 100.0 * flow)), rel=1e-14)
    times = np.linspace(5.0, 105.0, 2001)
    size = [math.hypot(*burn.acceleration(t, R, V)) for t in times.tolist()]
    assert np.trapezoid(size, times) == pytest.approx(burn.size_m_s, rel=1e-7)
    steady = Burn(from_s=0.0, duration_s=10.0, thrust_n=(20.0, 0.0, 0.0), mass_kg=100.0, axes="inertial")
    assert steady.size_m_s == pytest.approx(2.0) and steady.acceleration(9.0, R, V) == (0.2, 0.0, 0.0)


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({}, "exactly one of acceleration_m_s2 and thrust_n"),
        ({"thrust_n": (1.0, 0.0, 0.0)}, "mass_kg: belongs to thrust_n"),
        ({"acceleration_m_s2": (1.0, 0.0, 0.0), "isp_s": 200.0}, "isp_s: belongs to"),
        ({"thrust_n": (1e4, 0.0, 0.0), "mass_kg": 10.0, "isp_s": 200.0}, "all 10 kg are used up"),
    ],
)
def test_what_cannot_burn_is_refused(fields, message):
    with pytest.raises(ScenarioError, match=message) as caught:
        Burn(from_s=0.0, duration_s=100.0, **fields)
    assert "\n" not in str(caught.value)


def test_an_impulse_before_the_start_is_refused():
    with pytest.raises(ScenarioError, match="at_s"):
        Impulse(at_s=-1.0, delta_v_m_s=(1.0, 0.0, 0.0))


def test_ramps_take_their_half_and_must_fit():
    burn = Burn(from_s=0.0, duration_s=10.0, acceleration_m_s2=(0.0, 0.2, 0.0), rise_s=4.0, fall_s=2.0, axes="inertial")
    assert burn.size_m_s == pytest.approx(0.2 * 7.0)
    assert burn.edges_s == (0.0, 4.0, 8.0, 10.0)
    pushed = [burn.acceleration(t, R, V)[1] for t in (0.0, 1.0, 4.0, 8.0, 9.0, 10.0)]
    assert pushed == pytest.approx([0.0, 0.05, 0.2, 0.2, 0.1, 0.0])
    with pytest.raises(ScenarioError, match="longer than the burn of 5 s"):
        Burn(from_s=0.0, duration_s=5.0, acceleration_m_s2=(0.0, 0.2, 0.0), rise_s=4.0, fall_s=2.0)
