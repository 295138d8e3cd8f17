import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from rso_lidar.errors import ScenarioError
from rso_lidar.motion import (
    FirstOrder,
    FixedPoint,
    Ideal,
    Mount,
    PointingErrors,
    Ptu,
    ScanPoint,
    SecondOrder,
    make_ptu_link,
    sense,
    start,
    step,
)
from rso_lidar.motion.gimbal.demand import DemandCurve, find_pan_tilt
from rso_lidar.records import Command
from rso_lidar.units import DEG

SECOND = SecondOrder(natural_hz=4.0, damping=0.7, max_rate_deg_s=30.0, max_acceleration_deg_s2=200.0)
HOME = FixedPoint().demand


def jump(time_s):
    """Return a demand of 0 that steps to 0.3 rad of pan and -0.1 rad of tilt at 0.1 s."""
    return np.where(np.asarray(time_s)[:, None] >= 0.1 - 1e-9, [0.3, -0.1], [0.0, 0.0])


def ramp(time_s):
    return np.multiply.outer(time_s, [0.2, -0.1])


# ------------------------------------------------------------------------------------------------------- geometry


@pytest.mark.parametrize(
    ("pan_deg", "tilt_deg", "boresight"),
    [(0, 0, (1, 0, 0)), (90, 0, (0, 1, 0)), (0, 90, (0, 0, 1)), (-90, 0, (0, -1, 0)), (180, 0, (-1, 0, 0))],
)
def test_pan_turns_left_and_tilt_looks_up(pan_deg, tilt_deg, boresight):
    link = make_ptu_link(Mount(), pan_deg * DEG, tilt_deg * DEG)
    np.testing.assert_allclose(link.pose.apply([1, 0, 0]), boresight, atol=1e-15)


def test_tilt_comes_after_pan():
    link = make_ptu_link(Mount(), 90 * DEG, 90 * DEG)
    np.testing.assert_allclose(link.pose.apply(np.eye(3)), [(0, 0, 1), (-1, 0, 0), (0, -1, 0)], atol=1e-15)


def test_pan_and_tilt_of_the_boresight_are_those_put_in():
    rng = np.random.default_rng(5)
    pan, tilt = rng.uniform(-np.pi, np.pi, 100), rng.uniform(-1.5, 1.5, 100)
    link = make_ptu_link(Mount(), pan, tilt)
    np.testing.assert_allclose(find_pan_tilt(link.pose.apply([1, 0, 0])), (pan, tilt), atol=1e-12)


def test_link_rates_are_those_of_its_angles():
    rng = np.random.default_rng(6)
    pan, tilt, pan_rate, tilt_rate = rng.uniform(-1, 1, (4, 50))
    mount, h = Mount(position_m=(0, 0, 0.5), euler_zyx_deg=(20, -30, 40)), 1e-5
    link = make_ptu_link(mount, pan, tilt, pan_rate, tilt_rate)
    before, after = (make_ptu_link(mount, pan + s * pan_rate, tilt + s * tilt_rate).pose.rotation for s in (-h, h))
    # central difference: h^2 / 6 and eps / h
    np.testing.assert_allclose(link.angular_velocity_rad_s, (before.inv() * after).as_rotvec() / (2 * h), atol=1e-9)
    assert not link.velocity_m_s.any()
    np.testing.assert_allclose(link.pose.translation, np.broadcast_to([0, 0, 0.5], (50, 3)))


def test_mount_is_parent_from_child():
    mount = Mount(position_m=(1, 2, 3), euler_zyx_deg=(90, 0, 0))
    np.testing.assert_allclose(mount.link.pose.apply([1, 0, 0]), [1, 3, 3], atol=1e-15)
    assert mount.link.single
    half = np.sqrt(0.5)
    same = Mount(quaternion_xyzw=(0, 0, half, half)).rotation
    assert (same * mount.rotation.inv()).magnitude() < 1e-15
    assert Mount().rotation.approx_equal(Rotation.identity())
    with pytest.raises(ScenarioError, match="give one"):
        Mount(quaternion_xyzw=(0, 0, 0, 1), euler_zyx_deg=(0, 0, 0))


# ------------------------------------------------------------------------------------------------------- the walk


def test_starts_at_rest_on_its_demand_within_its_travel():
    ptu = Ptu(response=SECOND.replace(tilt_limits_deg=(-5, 5)))
    head = start(ptu, FixedPoint(pan_deg=20, tilt_deg=-30).demand)
    assert head.angle_rad == pytest.approx((20 * DEG, -5 * DEG))
    assert head.rate_rad_s == (0.0, 0.0)
    assert head.demand_rad == pytest.approx((20 * DEG, -30 * DEG))


@pytest.mark.parametrize("response", [SECOND, FirstOrder(time_constant_s=0.3), Ideal()])
@pytest.mark.parametrize("latency_s", [0.0, 0.0123])
def test_a_state_has_the_same_bits_however_many_steps_led_there(response, latency_s):
    ptu = Ptu(response=response, errors=PointingErrors(command_latency_s=latency_s))
    demand = ScanPoint(pattern="spiral", radius_deg=5, step_deg=1, rate_deg_s=8).demand
    once = step(ptu, start(ptu, demand), demand, 2.50037)
    head = start(ptu, demand)
    for until in (0.0, 0.0004, 0.0007, 0.3, 0.30000000000000004, 1.0001, 1.9999, 2.5, 2.5003, 2.50037):
        head = step(ptu, head, demand, until)
    assert head.angle_rad == once.angle_rad
    assert head.rate_rad_s == once.rate_rad_s
    assert head.demand_rad == once.demand_rad


def test_no_tick_is_lost_where_one_block_of_them_ends():
    """Some 20,000 ticks are worked out at a time: 41.3 s at once are the same bits as second by second."""
    ptu = Ptu(response=SecondOrder(natural_hz=1.3, damping=0.1))
    demand = ScanPoint(pattern="raster", half_width_deg=4, half_height_deg=2, step_deg=1, rate_deg_s=3).demand
    once = step(ptu, start(ptu, demand), demand, 41.3)
    head = start(ptu, demand)
    for until in [*range(1, 42), 41.3]:
        head = step(ptu, head, demand, float(until))
    assert (head.angle_rad, head.rate_rad_s) == (once.angle_rad, once.rate_rad_s)


def test_flashes_of_thirds_of_a_second_meet_the_grid():
    ptu = Ptu(response=SECOND)
    head = start(ptu, jump)
    for k in range(1, 10):
        head = step(ptu, head, jump, k * 0.1)  # 0.1 * 3 is not 0.3
        assert head.tick == 100 * k


def test_between_ticks_the_drive_is_carried_on_from_the_tick_before():
    ptu = Ptu(response=SecondOrder(natural_hz=4.0, damping=0.7))
    times = 0.2 + np.linspace(0.0, 1e-3, 5)
    states = [step(ptu, start(ptu, jump), jump, t) for t in times]
    pan, rate = (np.array([getattr(s, name)[0] for s in states]) for name in ("angle_rad", "rate_rad_s"))
    # the mean of the rates over a quarter of a millisecond: the trapezium errs by h^2 x''' / 12 < 5e-9 * 5000
    np.testing.assert_allclose(np.diff(pan) / np.diff(times), (rate[1:] + rate[:-1]) / 2, atol=3e-5)
    assert np.all(np.diff(pan) > 0)


def test_ideal_stands_on_its_demand_at_any_instant():
    ptu = Ptu()
    for until in (0.0, 0.0123456, 1.7):
        head = step(ptu, start(ptu, ramp), ramp, until)
        np.testing.assert_allclose(head.angle_rad, (0.2 * until, -0.1 * until), atol=1e-15)
        np.testing.assert_allclose(head.rate_rad_s, (0.2, -0.1), rtol=1e-9)
    held = Ptu(response=Ideal(pan_limits_deg=(-1, 1)))
    head = step(held, start(held, ramp), ramp, 2.0)
    assert head.angle_rad == pytest.approx((1 * DEG, -0.2))
    assert head.rate_rad_s == pytest.approx((0.0, -0.1))


@pytest.mark.parametrize("response", [SecondOrder(natural_hz=4, damping=0.7), FirstOrder(time_constant_s=0.1), Ideal()])
def test_latency_delays_everything_by_as_much(response):
    prompt = Ptu(response=response)
    late = Ptu(response=response, errors=PointingErrors(command_latency_s=0.0502))  # 50 ticks
    for until in (0.1, 0.15, 0.2, 0.5):
        expected = step(prompt, start(prompt, jump), jump, until - 0.05)
        head = step(late, start(late, jump), jump, until)
        assert head.angle_rad == pytest.approx(expected.angle_rad, abs=1e-15)
    assert step(late, start(late, jump), jump, 0.12).demand_rad == (0.3, -0.1)  # asked for, not yet obeyed


def test_a_second_order_drive_lags_a_ramp_as_theory_says():
    ptu = Ptu(response=SecondOrder(natural_hz=2.0, damping=0.6))
    head = step(ptu, start(ptu, ramp), ramp, 10.0)
    # steady-state lag 2 zeta / w (Ogata section 5-8), and half a tick for the demand held from tick to tick
    lag = 2 * 0.6 / (2 * np.pi * 2.0) + 0.5e-3
    np.testing.assert_allclose(np.array(head.demand_rad) - head.angle_rad, np.array([0.2, -0.1]) * lag, rtol=1e-6)


def test_a_track_that_goes_round_is_followed_round():
    def around(time):
        return np.stack([np.cos(0.3 * time), np.sin(0.3 * time), 0.2 + 0 * time], axis=-1)

    ptu = Ptu(response=SecondOrder(natural_hz=4, damping=0.7))
    demand = DemandCurve(around, 60.0)
    head = step(ptu, start(ptu, demand), demand, 60.0)
    assert head.angle_rad[0] == pytest.approx(18.0, abs=0.03)
    # held from tick to tick, a ramp is a saw; its first integral, w^2 * rate * tick^2 / 8, is the ripple of the rate
    assert head.rate_rad_s == pytest.approx((0.3, 0.0), abs=(2 * np.pi * 4) ** 2 * 0.3 * 1e-6 / 8)


# --------------------------------------------------------------------------------------------------- under command


def test_a_command_holds_until_the_next_and_none_keeps_the_demand():
    ptu = Ptu()
    head = step(ptu, start(ptu, ramp), ramp, 1.0)
    head = step(ptu, head, ramp, 2.0, Command(pan_rad=0.7))
    assert head.angle_rad == pytest.approx((0.7, -0.2))
    assert head.demand_rad == pytest.approx((0.7, -0.2))
    assert head.rate_rad_s == pytest.approx((0.0, -0.1))
    head = step(ptu, head, ramp, 3.0, Command(tilt_rad=0.4))
    assert head.angle_rad == pytest.approx((0.6, 0.4))
    head = step(ptu, head, ramp, 4.0)
    assert head.angle_rad == pytest.approx((0.8, -0.4))


def test_a_command_moves_a_drive_as_a_step_of_the_demand_would():
    ptu = Ptu(response=SECOND)
    head = step(ptu, start(ptu, HOME), HOME, 0.1)
    head = step(ptu, head, HOME, 0.25, Command(0.3, -0.1))
    head = step(ptu, head, HOME, 0.4, Command(0.3, -0.1))
    expected = step(ptu, start(ptu, jump), jump, 0.4)
    assert head.angle_rad == expected.angle_rad
    assert head.rate_rad_s == expected.rate_rad_s


def test_a_command_given_between_ticks_acts_from_the_next():
    ptu = Ptu(response=SECOND)
    head = step(ptu, start(ptu, HOME), HOME, 0.0993)
    head = step(ptu, head, HOME, 0.4, Command(0.3, -0.1))
    assert head.angle_rad == step(ptu, start(ptu, jump), jump, 0.4).angle_rad


def test_late_commands_queue_up_in_order():
    prompt = Ptu(response=SECOND)
    late = Ptu(response=SECOND, errors=PointingErrors(command_latency_s=0.25))  # longer than two flashes
    commands = [None, Command(0.1, 0.0), Command(0.2, 0.1), Command(None, 0.2), Command(-0.1), None, None, None]
    a, b, course_a, course_b = start(prompt, HOME), start(late, HOME), [], []
    for k in range(60):
        command = commands[k] if k < len(commands) else None
        a = step(prompt, a, HOME, (k + 1) * 0.1, command)
        b = step(late, b, HOME, (k + 1) * 0.1, command)
        course_a.append(a.angle_rad)
        course_b.append(step(late, b, HOME, (k + 1) * 0.1 + 0.05).angle_rad)  # 0.25 s after the flash before last
        assert len(b.commands) <= 5
    np.testing.assert_allclose(course_b[2:], course_a[:-2], atol=1e-12)
    assert np.ptp(course_a) > 0.1


def test_a_command_beyond_the_travel_is_held_to_it():
    ptu = Ptu(response=SECOND.replace(pan_limits_deg=(-10, 10)))
    head = start(ptu, HOME)
    head = step(ptu, head, HOME, 5.0, Command(pan_rad=1.0))
    assert head.angle_rad[0] == pytest.approx(10 * DEG, rel=1e-9)
    assert head.demand_rad[0] == 1.0


@pytest.mark.parametrize("angle", [float("nan"), float("inf")])
def test_a_command_that_is_no_angle_is_refused(angle):
    ptu = Ptu()
    with pytest.raises(ScenarioError, match="tilt_rad"):
        step(ptu, start(ptu, HOME), HOME, 1.0, Command(0.0, angle))


def test_time_runs_forward():
    ptu = Ptu()
    head = step(ptu, start(ptu, HOME), HOME, 1.0)
    with pytest.raises(ValueError, match="cannot step back"):
        step(ptu, head, HOME, 0.9)


# ------------------------------------------------------------------------------------------------------- what it says


def test_a_perfect_unit_says_what_it_does():
    ptu = Ptu()
    pointing = sense(ptu, step(ptu, start(ptu, ramp), ramp, 1.0), np.random.default_rng(0))
    assert np.array_equal(pointing.actual_rad, pointing.measured_rad)
    assert np.array_equal(pointing.actual_rad, pointing.demand_rad)
    np.testing.assert_allclose(pointing.rate_rad_s, (0.2, -0.1), rtol=1e-9)


def test_errors_fall_where_they_belong():
    errors = PointingErrors(misalignment_deg=(0.5, -0.2), jitter_deg=0.01, encoder_noise_deg=0.03)
    ptu = Ptu(point=FixedPoint(pan_deg=10), errors=errors)
    head, rng = start(ptu, ptu.point.demand), np.random.default_rng(8)
    said = [sense(ptu, head, rng) for _ in range(4000)]
    actual, measured = (np.array([getattr(p, name) for p in said]) / DEG for name in ("actual_rad", "measured_rad"))
    # five standard errors of a mean and of a standard deviation over 4000 draws
    np.testing.assert_allclose(actual.mean(axis=0), (10.5, -0.2), atol=5 * 0.01 / 4000**0.5)
    np.testing.assert_allclose(measured.mean(axis=0), (10.0, 0.0), atol=5 * 0.03 / 4000**0.5)
    np.testing.assert_allclose(actual.std(axis=0), 0.01, rtol=5 / 8000**0.5)
    np.testing.assert_allclose(measured.std(axis=0), 0.03, rtol=5 / 8000**0.5)
    both = np.corrcoef(np.concatenate([actual.T, measured.T])) - np.eye(4)
    assert np.abs(both).max() < 5 / 4000**0.5  # axes, jitter and noise are independent


def test_encoders_report_whole_steps():
    ptu = Ptu(point=FixedPoint(pan_deg=10.07, tilt_deg=-3.22), errors=PointingErrors(encoder_resolution_deg=0.1))
    pointing = sense(ptu, start(ptu, ptu.point.demand), np.random.default_rng(0))
    np.testing.assert_allclose(pointing.measured_rad / DEG, (10.1, -3.2), rtol=1e-12)
    np.testing.assert_allclose(pointing.actual_rad / DEG, (10.07, -3.22), rtol=1e-12)


@pytest.mark.parametrize("errors", [PointingErrors(), PointingErrors(jitter_deg=1, encoder_noise_deg=1)])
def test_sense_always_draws_as_much(errors):
    ptu, rng, other = Ptu(errors=errors), np.random.default_rng(3), np.random.default_rng(3)
    sense(ptu, start(ptu, HOME), rng)
    other.standard_normal(4)
    assert rng.random() == other.random()


def test_a_ptu_is_what_its_table_says():
    ptu = Ptu(
        mount={"position_m": [0, 0, 0.5]},
        response={"type": "second_order", "natural_hz": 4.0, "damping": 0.7, "max_rate_deg_s": 30},
    )
    assert ptu.response == SecondOrder(natural_hz=4.0, damping=0.7, max_rate_deg_s=30.0)
    with pytest.raises(
        ScenarioError, match=r"response: unknown key 'natural_freq_hz'; did you mean 'natural_hz'|natural"
    ):
        Ptu(response={"type": "second_order", "natural_freq_hz": 4.0, "natural_hz": 4.0, "damping": 0.7})
