"""Attitude and pointing against closed forms and a numerical integration of Euler's equations."""

import datetime
import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from rso_lidar import motion, orbit, rpo
from rso_lidar.motion import Spin, Tumble
from rso_lidar.motion.attitudes.look_at import aim_axes
from rso_lidar.units import DEG, EARTH_GM_M3_S2

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


# A relative error of 1e-12 a step grows linearly with the turns made, and exponentially near the separatrix.
UNSTABLE = [name for name in BODIES if "separatrix" in name or "middle" in name]
STABLE = [name for name in BODIES if name not in UNSTABLE]


@pytest.mark.parametrize(
    ("kind", "names", "growth"),
    [("bodies of any inertia", STABLE, 1.0), ("bodies about to flip over", UNSTABLE, 1e3)],
)
def test_tumble_agrees_with_a_numerical_integration(validation, kind, names, growth):
    time = np.linspace(0.0, 200.0, 41)
    off_rad, off_rad_s = [], []
    for name in names:
        inertia, rate = BODIES[name]
        tumble = Tumble(inertia_kg_m2=inertia, body_rate_deg_s=rate, quaternion_xyzw=(0.1, -0.5, 0.1, 0.7**0.5 * 1.02))
        rotation, rates = tumble.orientation(time)
        expected, expected_rates = integrated(tumble, time)
        off_rad.append((rotation * expected.inv()).magnitude().max())
        off_rad_s.append(np.abs(rates - expected_rates).max())
        assert off_rad[-1] < 2e-10 * growth, name
        assert off_rad_s[-1] < 1e-11 * growth, name
    for what, off, tolerance, unit in [("attitude", off_rad, 2e-10, "rad"), ("body rate", off_rad_s, 1e-11, "rad/s")]:
        validation(
            case=f"tumble of {len(names)} {kind} for 200 s: worst {what}",
            source="numerical integration of Euler's equations, DOP853",
            expected=0.0,
            got=max(off),
            tolerance=tolerance * growth,
            unit=unit,
        )


def test_tumble_keeps_energy_and_angular_momentum(validation):
    energy_change, momentum_change = [], []
    for name, (inertia, rate) in BODIES.items():
        tumble = Tumble(inertia_kg_m2=inertia, body_rate_deg_s=rate)
        rotation, rates = tumble.orientation(np.linspace(0.0, 6000.0, 5001))
        momentum = rates @ tumble.inertia_tensor_kg_m2
        inertial, energy = rotation.apply(momentum), 0.5 * np.sum(rates * momentum, axis=1)
        moved, size = np.linalg.norm(inertial - inertial[0], axis=1).max(), np.linalg.norm(inertial[0])
        assert np.ptp(energy) <= 1e-12 * energy[0], name  # a few hundred roundings of 2.2e-16
        assert moved <= 1e-12 * size, name
        if any(rate):
            energy_change.append(np.ptp(energy) / energy[0])
            momentum_change.append(moved / size)
    for what, change in [("energy", energy_change), ("angular momentum in inertial axes", momentum_change)]:
        validation(
            case=f"tumble of {len(change)} bodies for 6000 s: greatest relative change of {what}",
            source="conservation",
            expected=0.0,
            got=max(change),
            tolerance=1e-12,
            unit="1",
        )


def test_rates_are_those_of_the_attitude(validation):
    tumble = Tumble(inertia_kg_m2=(1, 2, 2.5), body_rate_deg_s=(3, 4, 5))
    time, h = np.linspace(0.0, 500.0, 51), 1e-3
    _, rates = tumble.orientation(time)
    before, after = tumble.orientation(time - h)[0], tumble.orientation(time + h)[0]
    # central difference: h^2 |w''| / 6 ~ 1e-6 * 1e-3 / 6, and rounding 1e-13 / h
    validation(
        case="tumble: body rate against the turn of the attitude, worst component",
        source="central difference over 2 ms",
        expected=0.0,
        got=np.abs((before.inv() * after).as_rotvec() / (2 * h) - rates).max(),
        tolerance=2e-9,
        unit="rad/s",
    )


def test_a_symmetric_top_precesses_as_landau_and_lifshitz_say(validation):
    """Mechanics, section 33: the axis circles the momentum at L / I_transverse, at a constant angle from it."""
    transverse, axial, rate = 3.0, 4.5, np.array([2.0, 0.0, 5.0]) * DEG
    tumble = Tumble(inertia_kg_m2=(transverse, transverse, axial), body_rate_deg_s=(2, 0, 5))
    time = np.linspace(0.0, 1000.0, 501)
    rotation, rates = tumble.orientation(time)
    momentum = np.array([transverse, transverse, axial]) * rate  # body axes are inertial at t = 0
    size = np.linalg.norm(momentum)
    turned = Rotation.from_rotvec(np.multiply.outer(size / transverse * time, momentum / size))
    axis = rotation.apply([0, 0, 1])
    np.testing.assert_allclose(axis, turned.apply([0, 0, 1]), rtol=0, atol=1e-12)
    pole = momentum / size
    first = axis[0] - pole * (axis[0] @ pole)
    angle = np.unwrap(np.arctan2(axis @ np.cross(pole, first), axis @ first))
    validation(
        case="symmetric top: precession of its axis about the angular momentum, over 1000 s",
        source="Landau and Lifshitz, Mechanics, section 33",
        expected=size / transverse / DEG,
        got=angle[-1] / time[-1] / DEG,
        tolerance=1e-12 / np.linalg.norm(first) / time[-1] / DEG,
        unit="deg/s",
    )
    # Euler: in the body the rate circles the axis at (I_axial - I_transverse) / I_transverse * w_axial
    phase = (axial - transverse) / transverse * rate[2] * time
    expected = np.stack([rate[0] * np.cos(phase), rate[0] * np.sin(phase), np.full_like(time, rate[2])], axis=-1)
    np.testing.assert_allclose(rates, expected, rtol=0, atol=1e-13)
    angle = np.unwrap(np.arctan2(rates[:, 1], rates[:, 0]))
    validation(
        case="symmetric top: circling of its rate about the axis, in the body, over 1000 s",
        source="Euler: (I_axial / I_transverse - 1) times the axial rate",
        expected=(axial / transverse - 1) * 5.0,
        got=angle[-1] / time[-1] / DEG,
        tolerance=1e-13 / rate[0] / time[-1] / DEG,
        unit="deg/s",
    )


def test_a_body_spun_about_its_middle_axis_flips_again_and_again(validation):
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
    between = np.diff(flips)
    validation(
        case="body spun about its middle axis: time between flips, worst",
        source="Landau and Lifshitz, Mechanics, section 37",
        expected=expected,
        got=between[np.argmax(np.abs(between - expected))],
        tolerance=0.1,  # a flip is seen to one step of 0.05 s
        unit="s",
    )
    # the middle axis keeps to one side in space: the momentum does not flip, the body does
    assert rotation.apply([0, 1, 0])[:, 1].min() == pytest.approx(-1.0, abs=1e-6)


def test_spin_fixed_in_rtn_axes_is_that_of_the_paper():
    # Kucharski et al. 2014 (IEEE TGRS 52, 7651): Envisat's axis is 61.86 deg from nadir, 90.69 deg from along-track, and
    # on the side against the orbit normal
    start = datetime.datetime(2013, 9, 25, tzinfo=datetime.UTC)
    orbit_ = orbit.Kepler(
        epoch_utc=start, semi_major_axis_km=7144.0, eccentricity=0.0001, inclination_deg=98.4, raan_deg=2.0,
        argument_of_perigee_deg=80.0, true_anomaly_deg=280.0,
    )  # fmt: skip
    epochs = orbit.Epochs(start, np.linspace(0.0, 6000.0, 601))
    body = motion.Body(name="envisat", motion=orbit_, attitude=Spin(preset="envisat_2013"))
    truth = motion.truth([body], epochs)
    state = truth.states["envisat"]
    radial, velocity = (v / np.linalg.norm(v, axis=1)[:, None] for v in (state.position_m, state.velocity_m_s))
    axis = truth.pose("inertial", "envisat").rotation.apply([0.0, 0.0, 1.0])
    np.testing.assert_allclose(np.degrees(np.arccos(np.sum(axis * -radial, axis=1))), 61.86, atol=0.01)
    # along-track is across the radius, which the velocity is within 2 e = 0.01 deg
    np.testing.assert_allclose(np.degrees(np.arccos(np.sum(axis * velocity, axis=1))), 90.69, atol=0.02)
    assert np.all(np.sum(axis * np.cross(radial, velocity), axis=1) < -0.8)
    # the inertial period is 134.74 s: the rate about the axis that the truth states, without the orbit's turn of the axis
    rate = np.array(truth.rates("inertial", "envisat")[1])
    np.testing.assert_allclose(math.tau / rate[:, 2], 134.74, atol=0.005)  # digits of the paper
    turning = truth.pose("inertial", "envisat").rotation.apply(rate)
    normal = np.cross(radial, velocity)
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    mean_motion = math.sqrt(EARTH_GM_M3_S2 / 7144e3**3)
    across = np.sum(turning * normal, axis=1) - rate[:, 2] * np.sum(axis * normal, axis=1)
    np.testing.assert_allclose(across, mean_motion * (1.0 - 0.881716**2), rtol=2e-3)  # e = 1e-4, twice over
    # the orbit goes round against the spin, which is therefore faster in orbital axes
    after = Rotation.from_matrix(truth.pose("envisat.rtn", "envisat").rotation.as_matrix())
    turn = (after[1:] * after[:-1].inv()).magnitude() / 10.0
    np.testing.assert_allclose(turn, math.tau / 134.74 + mean_motion * 0.881716, rtol=1e-5)


def test_spin_is_a_tumble_about_a_principal_axis(validation):
    time = np.linspace(0.0, 5000.0, 101)
    spin = Spin(axis=(0, 1, 0), rate_deg_s=-3.0, quaternion_xyzw=(0.6, 0, 0, 0.8)).orientation(time)
    tumble = Tumble(inertia_kg_m2=(3, 4, 5), body_rate_deg_s=(0, -3, 0), quaternion_xyzw=(0.6, 0, 0, 0.8)).orientation(
        time
    )
    validation(
        case="spin for 5000 s: attitude, at worst",
        source="tumble about a principal axis",
        expected=0.0,
        got=(spin[0] * tumble[0].inv()).magnitude().max(),
        tolerance=1e-12,
        unit="rad",
    )
    np.testing.assert_allclose(spin[1], tumble[1], atol=1e-15)


def test_spin_turns_by_rate_times_time(validation):
    """0.5 deg/s for the 2700 s of the hop is three turns and three quarters: body +x comes to stand where -y was."""
    rotation, _ = Spin(axis=(0, 0, 2), rate_deg_s=0.5).orientation(2700.0)
    x, y, _ = rotation.apply([1, 0, 0])
    validation(
        case="spin of 0.5 deg/s for 2700 s: angle turned, less whole turns",
        source="1350 deg = 3.75 turns",
        expected=270.0,
        got=math.atan2(y, x) / DEG % 360.0,
        tolerance=1e-12,  # a few roundings of 23.6 rad, 2e-13 deg each
        unit="deg",
    )


# ------------------------------------------------------------------------------------------------------- looking at


def test_rate_of_looking_at_a_target_that_passes(validation):
    """A target on a straight line, 1500 m off at the closest and 25 m/s fast, as in examples/tle_flyby.toml."""
    beside, speed, time = 1500.0, 25.0, np.linspace(-120.0, 120.0, 241)
    line = np.stack([np.full_like(time, beside), speed * time, 0 * time], axis=-1)
    _, rates = aim_axes(line, np.broadcast_to([0, speed, 0], line.shape), np.array([0, 0, 1.0]))
    expected = speed * beside / (beside**2 + (speed * time) ** 2)  # the derivative of atan(v t / b)
    assert not rates[:, :2].any()
    worst = np.argmax(np.abs(rates[:, 2] - expected))
    for what, k in [("at the closest", 120), ("at worst in 4 minutes", worst)]:
        validation(
            case=f"look_at a target that passes at 1500 m with 25 m/s: body rate {what}",
            source="v b / (b^2 + v^2 t^2)",
            expected=expected[k] / DEG,
            got=rates[k, 2] / DEG,
            tolerance=1e-14,  # a few roundings of 1 deg/s
            unit="deg/s",
        )


def test_looking_along_the_track_turns_once_a_revolution(validation):
    """On the V-bar, at rest in rtn axes, whoever looks at his chief turns with the orbit: n about the orbit's normal."""
    epoch = datetime.datetime(2024, 9, 17, 12, tzinfo=datetime.UTC)
    radius = 42164e3
    n = math.sqrt(EARTH_GM_M3_S2 / radius**3)
    speed = n * radius * math.sqrt(0.5)
    chief = orbit.State(epoch_utc=epoch, position_m=(radius, 0, 0), velocity_m_s=(0, speed, speed))
    behind = rpo.Hill(relative_to="chief", position_m=(0, -300, 0), velocity_m_s=(0, 0, 0))
    bodies = [
        motion.Body(name="chief", motion=chief),
        motion.Body(name="follower", motion=behind, attitude=motion.LookAt(at="chief")),
    ]
    course = motion.truth(bodies, orbit.Epochs(epoch, np.linspace(0.0, math.tau / n, 145)))
    rates = course.poses.link("inertial", "follower").angular_velocity_rad_s
    off = np.linalg.norm(rates - [0, 0, n], axis=1)
    worst = rates[np.argmax(off)]
    # some hundreds of roundings; through inertial coordinates, 7 nm coarse at GEO, 300 m would leave 2e-11
    np.testing.assert_allclose(worst, [0, 0, n], rtol=0, atol=1e-13 * n)
    validation(
        case="look_at the chief from 300 m behind in GEO: body rate about the orbit normal, worst of a day",
        source="mean motion",
        expected=n / DEG * 3600,
        got=worst[2] / DEG * 3600,
        tolerance=1e-13 * n / DEG * 3600,
        unit="deg/h",
    )


# ---------------------------------------------------------------------------------------------------- pan-tilt unit


def jump(time_s):
    """Return a demand of 0 that steps to 10 deg of pan at 0.1 s, a whole tick."""
    return np.where(np.asarray(time_s)[:, None] >= 0.1 - 1e-9, [10 * DEG, 0.0], [0.0, 0.0])


@pytest.mark.parametrize("damping", [0.3, 0.5, 0.7])
def test_pan_overshoots_as_its_damping_says(validation, damping):
    """Ogata, Modern Control Engineering, 5th ed. section 5-3: exp(-pi zeta / sqrt(1 - zeta^2)), at pi / w_d."""
    ptu = motion.Ptu(response=motion.SecondOrder(natural_hz=4.0, damping=damping))
    damped = math.sqrt(1 - damping**2)
    peak_s = 0.1 + math.pi / (2 * math.pi * 4.0 * damped)
    head = motion.step(ptu, motion.start(ptu, jump), jump, peak_s)
    validation(
        case=f"PTU of 4 Hz and damping {damping:g}: overshoot of a step of pan",
        source="Ogata, section 5-3",
        expected=100 * math.exp(-math.pi * damping / damped),
        got=100 * (head.angle_rad[0] / (10 * DEG) - 1),
        tolerance=1e-9,  # some 300 ticks, each rounded to 1e-16 of the step: 3e-12 %
        unit="%",
    )
    assert abs(head.rate_rad_s[0]) < 1e-10  # the peak


def test_pan_lags_a_ramp_by_two_dampings_over_the_natural_rate(validation):
    def ramp(time_s):
        return np.multiply.outer(time_s, [10 * DEG, 0.0])

    ptu = motion.Ptu(response=motion.SecondOrder(natural_hz=4.0, damping=0.7))
    head = motion.step(ptu, motion.start(ptu, ramp), ramp, 10.0)
    # and half a tick of 1 ms, for which a demand is held
    expected = 10.0 * (2 * 0.7 / (2 * math.pi * 4.0) + 0.5e-3)
    validation(
        case="PTU of 4 Hz and damping 0.7: lag behind a pan of 10 deg/s",
        source="Ogata, section 5-8: 2 zeta / w, and half a tick",
        expected=expected,
        got=(head.demand_rad[0] - head.angle_rad[0]) / DEG,
        tolerance=1e-6 * expected,  # a thousandth of the half tick would be 9e-6
        unit="deg",
    )
