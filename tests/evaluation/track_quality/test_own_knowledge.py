"""The follower's own burns by its plan: with them a filter keeps its NIS, without them it does not."""

import datetime

import numpy as np
import pytest

import rso_lidar as rl
from rso_lidar.evaluation.track_quality.own_knowledge import list_known_burns
from rso_lidar.rpo import Plan
from rso_lidar.track import filter_positions

START = datetime.datetime(2024, 9, 17, 12, tzinfo=datetime.UTC)
LOW = rl.Kepler(
    epoch_utc=START,
    semi_major_axis_km=6928.137,
    eccentricity=0.0,
    inclination_deg=97.6,
    raan_deg=35.0,
    argument_of_perigee_deg=0.0,
    true_anomaly_deg=0.0,
)
HOPS = rl.rpo.Waypoints(
    relative_to="stage",
    positions_m=((0.0, -500.0, 0.0), (-100.0, -300.0, 20.0), (0.0, -100.0, 0.0)),
    times_s=(0.0, 400.0, 801.0),
    stop=True,
    hold_s=60.0,
)
STRAIGHT = rl.rpo.RBarApproach(relative_to="stage", from_m=-400.0, to_m=-100.0, speed_m_s=0.5)
NOISE_M = 0.05


def scenario(motion):
    return rl.Scenario(
        version=1,
        name="burns",
        time=rl.Time(start_utc=START, duration_s=900.0, frame_rate_hz=0.5),
        target=[rl.Target(name="stage", model="rocket_body", motion=LOW)],
        follower=rl.Follower(motion=motion),
        lidar=rl.Lidar(preset="gsfl_1064"),
    )


@pytest.mark.parametrize("motion", [HOPS, STRAIGHT])
def test_with_its_burns_the_filter_believes_what_it_sees(motion):
    flown, time_s = scenario(motion), np.arange(0.0, 900.0, 2.0)
    plan = motion.plan(START, LOW)
    assert isinstance(plan, Plan)
    apart, _ = plan.relative(time_s)
    seen = -apart + np.random.default_rng(3).normal(0.0, NOISE_M, apart.shape)  # of the target, from the follower
    spread = np.broadcast_to(np.eye(3) * NOISE_M**2, (time_s.size, 3, 3))
    burns = list_known_burns(flown, time_s)
    given = {"mean_motion_rad_s": plan.mean_motion_rad_s, "acceleration_m_s2_sqrt_hz": 1e-5}
    told = filter_positions(
        time_s, seen, spread, kicks=[(burn.time_s, -burn.delta_v_m_s) for burn, _ in burns], **given
    )
    # A mean of 449 NIS of three degrees of freedom spreads by sqrt(6 / 449), times 4.
    assert told.nis_mean == pytest.approx(3.0, abs=4.0 * np.sqrt(6.0 / 449))
    assert filter_positions(time_s, seen, spread, **given).nis_mean > 20.0
    assert np.abs(told.position_m - -apart)[50:].max() < 4.0 * NOISE_M


def test_each_burn_once_with_an_instant_beside_it():
    time_s = np.arange(10.0, 900.0, 2.0)
    burns = list_known_burns(scenario(HOPS), time_s)
    plan = HOPS.plan(START, LOW)
    impulses = [one for one in plan.impulses if one.time_s > 10.0]
    assert len(impulses) == 3  # the stop, the next departure and the last stop; the first was before
    found = [(burn, k) for burn, k in burns if any(np.isclose(burn.time_s, one.time_s, atol=1e-9) for one in impulses)]
    assert len(found) >= 3
    assert all(abs(time_s[k] - burn.time_s) <= 2.0 for burn, k in burns)
    total = np.sum([burn.delta_v_m_s for burn, _ in burns if burn.time_s < 801.5], axis=0)
    held = plan.control_m_s2(np.arange(10.5, 801.5)).sum(axis=0)  # an impulse a second
    np.testing.assert_allclose(total, np.sum([one.delta_v_m_s for one in impulses], axis=0) + held, atol=2e-3)


def test_who_flies_no_plan_has_none():
    drift = rl.Hill(relative_to="stage", position_m=(0.0, -500.0, 0.0), velocity_m_s=(0.0, 0.0, 0.0))
    assert list_known_burns(scenario(drift), np.arange(5.0)) == []
    assert list_known_burns(scenario(HOPS), np.zeros(1)) == []


def test_code_that_is_not_trusted_is_not_needed_to_know_that_there_are_no_burns():
    motion = {"type": "state_space", "relative_to": "stage", "axes": "rtn", "dynamics": "absent.py:pull"}
    about = scenario(STRAIGHT)
    follower = {"name": "follower", "motion": motion | {"initial_state": [0.0, -100.0, 0.0, 0.0, 0.0, 0.0]}}
    assert list_known_burns(about.replace(follower=follower), np.arange(3.0)) == []
