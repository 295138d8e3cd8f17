"""The glideslope of Hablani, Tapper and Dana-Bashian (2002): the commanded line, and arcs that meet it."""

import math

import numpy as np
import pytest

from rso_lidar import rpo
from rso_lidar.errors import ScenarioError
from rso_lidar.rpo import clohessy_wiltshire
from tests.rpo.plans.test_operation import N

LINE = {
    "relative_to": "station",
    "from_m": (-60.0, -400.0, 30.0),
    "to_m": (0.0, -20.0, 0.0),
    "initial_speed_m_s": 0.8,
    "final_speed_m_s": 0.05,
    "pulses": 10,
}


@pytest.mark.parametrize("speeds", [(0.8, 0.05), (0.1, 0.6), (0.3, 0.3)])
def test_the_commanded_speed_is_linear_in_the_distance_to_go(speeds):
    """d rho / dt = a rho + rho_T' of the paper, integrated apart, is at zero after the stated time, and at its distances."""
    from scipy.integrate import solve_ivp

    part = rpo.Glideslope(**LINE | {"initial_speed_m_s": speeds[0], "final_speed_m_s": speeds[1]})
    length = math.dist(LINE["from_m"], LINE["to_m"])

    def closing(_, rho):
        return -(speeds[1] + (speeds[0] - speeds[1]) * rho / length)

    times = np.linspace(0.0, part.line_s, 9)
    rho = solve_ivp(closing, (0.0, part.line_s), [length], t_eval=times, method="DOP853", rtol=1e-12, atol=1e-12).y[0]
    assert rho[-1] == pytest.approx(0.0, abs=1e-7)
    np.testing.assert_allclose(part.distance_to_go_m(times), rho, rtol=0, atol=1e-6)


def test_the_time_of_flight_is_the_papers():
    """T = ln(rho_T' / rho_0') / a, a = (rho_0' - rho_T') / rho_0 (Hablani et al., eqs. 6 to 9), closing rates negative."""
    length = math.dist(LINE["from_m"], LINE["to_m"])
    a = (-0.8 + 0.05) / length
    assert rpo.Glideslope(**LINE).line_s == pytest.approx(math.log(0.05 / 0.8) / a, rel=1e-12)


def test_arcs_begin_on_the_line_and_fly_freely_to_the_next_place():
    plan = rpo.Glideslope(**LINE).make_plan(N)
    start, end = np.array(LINE["from_m"]), np.array(LINE["to_m"])
    along = (start - end) / np.linalg.norm(start - end)
    assert len(plan.impulses) == 11
    np.testing.assert_allclose(np.diff([one.time_s for one in plan.impulses]), plan.duration_s / 10, rtol=1e-12)
    state = start, np.zeros(3)
    for one, after in zip(plan.impulses[:-1], plan.impulses[1:], strict=True):
        to_go = state[0] - end
        assert np.linalg.norm(to_go - along * (to_go @ along)) < 1e-6
        state = clohessy_wiltshire(state[0], state[1] + one.delta_v_m_s, after.time_s - one.time_s, N)
    np.testing.assert_allclose(state[0], end, rtol=0, atol=1e-6)
    np.testing.assert_allclose(state[1] + plan.impulses[-1].delta_v_m_s, 0.0, rtol=0, atol=1e-9)


def test_many_pulses_follow_the_line():
    """The path bends off the line by a = 2 n v over half an arc, a t^2 / 8: a hundredth for ten times as many pulses."""
    off = []
    for pulses in (10, 100):
        plan = rpo.Glideslope(**LINE | {"pulses": pulses, "from_m": (0.0, -400.0, 0.0)}).make_plan(N)
        position, _ = plan.relative(np.linspace(0.0, plan.duration_s, 4001))
        off.append(np.abs(position[:, 0]).max())
    first_s = plan.duration_s / 10
    assert off[0] == pytest.approx(2.0 * N * 0.7 * first_s**2 / 8.0, rel=0.15)
    assert off[1] == pytest.approx(0.01 * off[0], rel=0.2)


def test_without_a_stop_it_arrives_near_the_commanded_speed():
    plan = rpo.Glideslope(**LINE | {"pulses": 200, "stop": False}).make_plan(N)
    assert len(plan.impulses) == 200
    assert np.linalg.norm(plan.relative(np.array([plan.duration_s]))[1]) == pytest.approx(0.05, rel=0.05)


@pytest.mark.parametrize(
    "changes", [{"to_m": LINE["from_m"]}, {"pulses": 0}, {"final_speed_m_s": 0.0}, {"pulses": 2000}]
)
def test_bad_lines_are_refused(changes):
    with pytest.raises(ScenarioError, match=f"{next(iter(changes))}: "):
        rpo.Glideslope(**LINE | changes)
