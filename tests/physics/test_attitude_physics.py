"""Free rotation of rigid bodies, against closed forms and a numerical integration of Euler's equations."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from rso_lidar.motion.attitude import Spin, Tumble
from rso_lidar.units import DEG

TILT = Rotation.from_euler("ZYX", [0.4, -1.1, 2.0]).as_matrix()


def tensor(moments, axes=TILT):
    product = (axes * moments) @ axes.T
    return tuple(map(tuple, (0.5 * (product + product.T)).tolist()))


def integrated(tumble, time):
    """Return attitude and rates by Euler's equations and quaternion kinematics, DOP853 at a tolerance of 1e-12."""
    inertia = tumble.inertia_tensor_kg_m2
    inverse = np.linalg.inv(inertia)

    def slope(_, state):
        q, w = state[:4], state[4:]
        turn = 0.5 * np.append(q[3] * w + np.cross(q[:3], w), -q[:3] @ w)
        return np.append(turn, inverse @ -np.cross(w, inertia @ w))

    first = np.append(tumble.quaternion_xyzw, np.array(tumble.body_rate_deg_s) * DEG)
    solution = solve_ivp(slope, (0, time[-1]), first, method="DOP853", rtol=1e-12, atol=1e-14, t_eval=time)
    return Rotation.from_quat(solution.y[:4].T), solution.y[4:].T


# The separatrix of (1, 2, 2.5): 2.5 * 0.5 * w_c^2 = 1 * 1 * w_a^2, where the body neither circles its first axis nor its
# third; a millionth to either side, and on it to rounding.
ON = np.sqrt(1.25)
BODIES = {
    "triaxial, circling its greatest axis": ((1, 2, 2.5), (1, 2, 5)),
    "triaxial, circling its least axis": ((1, 2, 2.5), (5, 2, 1)),
    "axes in another order, momentum the other way": ((2.5, 1, 2), (-3, 1, -5)),
    "tensor with products of inertia": (tensor((1, 2, 2.5)), (3, 4, 5)),
    "oblate": ((1, 1, 1.8), (3, 4, 5)),
    "prolate": ((2, 1, 2), (3, 4, 5)),
    "sphere": ((1, 1, 1), (3, 4, 5)),
    "sphere as a tensor, to rounding": (tensor((1, 1, 1)), (3, 4, 5)),
    "nearly a sphere": ((1, 1 + 1e-9, 1 - 1e-9), (3, 4, 5)),
    "nearly oblate": ((1, 1 + 1e-12, 1.8), (3, 4, 5)),
    "flat plate": ((1, 2, 3), (3, 4, 5)),
    "spin about the greatest axis": ((1, 2, 2.5), (0, 0, 5)),
    "spin about the least axis, disturbed": ((1, 2, 2.5), (5, 1e-9, -1e-9)),
    "spin about the middle axis": ((1, 2, 2.5), (0, 5, 0)),
    "within a millionth inside the separatrix": ((1, 2, 2.5), (ON * (1 - 1e-6), 3, 1)),
    "within a millionth outside the separatrix": ((1, 2, 2.5), (ON * (1 + 1e-6), -3, 1)),
    "no rate": ((1, 2, 2.5), (0, 0, 0)),
}


@pytest.mark.parametrize("name", BODIES)
def test_tumble_agrees_with_a_numerical_integration(name):
    inertia, rate = BODIES[name]
    tumble = Tumble(inertia_kg_m2=inertia, body_rate_deg_s=rate, quaternion_xyzw=(0.1, -0.5, 0.1, 0.7**0.5 * 1.02))
    time = np.linspace(0.0, 200.0, 41)
    rotation, rates = tumble.orientation(time)
    expected, expected_rates = integrated(tumble, time)
    # A relative error of 1e-12 a step grows linearly with the turns made, and exponentially near the separatrix.
    growth = 1e3 if "separatrix" in name or "middle" in name else 1.0
    assert (rotation * expected.inv()).magnitude().max() < 2e-10 * growth
    assert np.abs(rates - expected_rates).max() < 1e-11 * growth


@pytest.mark.parametrize("name", BODIES)
def test_tumble_keeps_energy_and_angular_momentum(name):
    inertia, rate = BODIES[name]
    tumble = Tumble(inertia_kg_m2=inertia, body_rate_deg_s=rate)
    rotation, rates = tumble.orientation(np.linspace(0.0, 6000.0, 5001))
    momentum = rates @ tumble.inertia_tensor_kg_m2
    inertial, energy = rotation.apply(momentum), 0.5 * np.sum(rates * momentum, axis=1)
    assert np.ptp(energy) <= 1e-12 * energy[0]  # a few hundred roundings of 2.2e-16
    assert np.linalg.norm(inertial - inertial[0], axis=1).max() <= 1e-12 * np.linalg.norm(inertial[0])


def test_rates_are_those_of_the_attitude():
    tumble = Tumble(inertia_kg_m2=(1, 2, 2.5), body_rate_deg_s=(3, 4, 5))
    time, h = np.linspace(0.0, 500.0, 51), 1e-3
    _, rates = tumble.orientation(time)
    before, after = tumble.orientation(time - h)[0], tumble.orientation(time + h)[0]
    # central difference: h^2 |w''| / 6 ~ 1e-6 * 1e-3 / 6, and rounding 1e-13 / h
    np.testing.assert_allclose((before.inv() * after).as_rotvec() / (2 * h), rates, atol=2e-9)


def test_a_symmetric_top_precesses_as_landau_and_lifshitz_say():
    """Mechanics, section 33: the axis circles the momentum at L / I_transverse, at a constant angle from it."""
    transverse, axial, rate = 3.0, 4.5, np.array([2.0, 0.0, 5.0]) * DEG
    tumble = Tumble(inertia_kg_m2=(transverse, transverse, axial), body_rate_deg_s=(2, 0, 5))
    time = np.linspace(0.0, 1000.0, 501)
    rotation, rates = tumble.orientation(time)
    momentum = np.array([transverse, transverse, axial]) * rate  # body axes are inertial at t = 0
    size = np.linalg.norm(momentum)
    turned = Rotation.from_rotvec(np.multiply.outer(size / transverse * time, momentum / size))
    np.testing.assert_allclose(rotation.apply([0, 0, 1]), turned.apply([0, 0, 1]), atol=1e-12)
    # Euler: in the body the rate circles the axis at (I_axial - I_transverse) / I_transverse * w_axial
    phase = (axial - transverse) / transverse * rate[2] * time
    expected = np.stack([rate[0] * np.cos(phase), rate[0] * np.sin(phase), np.full_like(time, rate[2])], axis=-1)
    np.testing.assert_allclose(rates, expected, atol=1e-13)


def test_a_body_spun_about_its_middle_axis_flips_again_and_again():
    """Dzhanibekov: the time between flips is 2 K / lambda, with K ~ ln(4 / sqrt(1 - m)) (Landau & Lifshitz, section 37)."""
    i1, i2, i3, nudge = 1.0, 2.0, 2.5, 1e-6
    w1, w2, _ = np.array([nudge, 5.0, 0.0]) * DEG
    rotation, rates = Tumble(inertia_kg_m2=(i1, i2, i3), body_rate_deg_s=(nudge, 5, 0)).orientation(
        np.arange(0.0, 6000.0, 0.05)
    )
    along = rates[:, 1]
    assert along.min() == pytest.approx(-w2, rel=1e-9)  # a full flip
    flips = np.flatnonzero(np.diff(np.sign(along))) * 0.05
    energy2, momentum2 = i1 * w1**2 + i2 * w2**2, (i1 * w1) ** 2 + (i2 * w2) ** 2
    # L^2 < 2 E I2: it circles its least axis, so the formulae hold with the first and third moments exchanged
    slowness = np.sqrt((i2 - i1) * (i3 * energy2 - momentum2) / (i1 * i2 * i3))
    m1 = (i3 - i1) * i1 * w1**2 / (i3 * energy2 - momentum2)  # 1 - m, with the difference worked out by hand
    expected = 2.0 * np.log(4.0 / np.sqrt(m1)) / slowness
    assert len(flips) > 5
    np.testing.assert_allclose(np.diff(flips), expected, atol=0.1)  # a flip is seen to one step of 0.05 s
    # the middle axis keeps to one side in space: the momentum does not flip, the body does
    assert rotation.apply([0, 1, 0])[:, 1].min() == pytest.approx(-1.0, abs=1e-6)


def test_spin_is_a_tumble_about_a_principal_axis():
    time = np.linspace(0.0, 5000.0, 101)
    spin = Spin(axis=(0, 1, 0), rate_deg_s=-3.0, quaternion_xyzw=(0.6, 0, 0, 0.8)).orientation(time)
    tumble = Tumble(inertia_kg_m2=(3, 4, 5), body_rate_deg_s=(0, -3, 0), quaternion_xyzw=(0.6, 0, 0, 0.8)).orientation(
        time
    )
    assert (spin[0] * tumble[0].inv()).magnitude().max() < 1e-12
    np.testing.assert_allclose(spin[1], tumble[1], atol=1e-15)
