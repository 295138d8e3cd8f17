"""What is asked of a chief, and how often: chains of relative motions and many slews cost what they must."""

import datetime
import threading
import warnings

import numpy as np

import rso_lidar as rl
from rso_lidar import motion
from rso_lidar.errors import has_warnings_enabled, suppress_warnings
from rso_lidar.motion import Chief, truth

START = datetime.datetime(2026, 5, 7, tzinfo=datetime.UTC)
CHIEF = rl.Kepler(
    epoch_utc=START,
    semi_major_axis_km=7000.0,
    eccentricity=0.001,
    inclination_deg=51.6,
    raan_deg=10.0,
    argument_of_perigee_deg=0.0,
    true_anomaly_deg=0.0,
)


def counted(monkeypatch, bodies):
    """Return the truth of bodies at three epochs, and how often a truth was worked out for it."""
    calls = []
    whole = truth

    def counting(*given, **more):
        calls.append(given)
        return whole(*given, **more)

    monkeypatch.setitem(whole.__globals__, "truth", counting)
    made = counting(bodies, rl.orbit.Epochs(START, np.array([0.0, 10.0, 20.0])))
    return made, len(calls)


def chain(depth):
    """Return a chief, and bodies each of which moves about the one before."""
    bodies = [motion.Body(name="b0", motion=CHIEF)]
    for k in range(depth):
        hill = rl.Hill(
            relative_to=f"b{k}", position_m=(0.0, -50.0, 5.0), velocity_m_s=(0.0, 0.0, 0.0), curvilinear=True
        )
        bodies.append(motion.Body(name=f"b{k + 1}", motion=hill))
    return bodies


def test_a_chain_of_chiefs_does_not_cost_more_with_every_link(monkeypatch):
    calls = [counted(monkeypatch, chain(depth))[1] for depth in (2, 4, 8)]
    assert calls[2] <= 2 * calls[1] <= 4 * calls[0]


def test_slewing_bodies_do_not_plan_one_another(monkeypatch):
    def slewing(n):
        turn = rl.motion.Slew(
            first=rl.Rtn(), then=rl.LookAt(at="b0"), at_s=5.0, max_rate_deg_s=2.0, max_acceleration_deg_s2=1.0
        )
        bodies = chain(n)
        return [bodies[0], *(body.replace(attitude=turn) for body in bodies[1:])]

    calls = [counted(monkeypatch, slewing(n))[1] for n in (1, 2, 4)]
    assert calls[2] <= 6 * calls[0]


def test_a_chief_answers_what_the_tree_says():
    bodies = chain(3)
    times = rl.orbit.Epochs(START, np.linspace(0.0, 3000.0, 7))
    course = motion.truth(bodies, times)
    asked = Chief(bodies, "b2").states(times)
    np.testing.assert_array_equal(asked.position_m, course.states["b2"].position_m)
    np.testing.assert_array_equal(asked.velocity_m_s, course.states["b2"].velocity_m_s)


def test_keeping_still_is_each_threads_own():
    """A thread that works something out on the side silences itself and no other, and leaves no filter behind."""
    before = list(warnings.filters)
    inside, seen = threading.Barrier(2), []

    def still():
        with suppress_warnings():
            inside.wait()
            inside.wait()

    other = threading.Thread(target=still)
    other.start()
    inside.wait()
    seen.append(has_warnings_enabled())
    inside.wait()
    other.join()
    assert seen == [True]
    assert has_warnings_enabled()
    assert warnings.filters == before
