"""Deadlines on a clock that the test turns by hand."""

import pytest

import rso_lidar as rl

NS = 1_000_000_000


class Clock:
    def __init__(self):
        self.now_s = 100.0

    def __call__(self):
        return self.now_s


def replies(policy, factor=2.0, ready_s=()):
    """Return the deadlines and when replies are due that are ready so long after the clock began, one a second."""
    clock = Clock()
    deadlines = rl.loop.Deadlines(factor, policy, clock)
    due = []
    for k, after_s in enumerate(ready_s):
        clock.now_s = 100.0 + after_s
        due.append(deadlines.time_reply(k * NS, clock.now_s - 0.1) - 100.0)
    return deadlines, due, clock


def test_replies_wait_for_their_time():
    deadlines, due, _ = replies("slip", ready_s=(0.0, 0.2, 0.7, 1.1))
    assert due == pytest.approx([0.0, 0.5, 1.0, 1.5])
    assert deadlines.overruns == 0
    assert deadlines.report()[0] == "real time   2 asked for, 2 achieved; a step takes 20.0% of its time"


def test_slip_moves_the_deadlines_after_it():
    deadlines, due, _ = replies("slip", ready_s=(0.0, 0.2, 1.3, 1.4))
    assert due == pytest.approx([0.0, 0.5, 1.3, 1.8])
    assert deadlines.overruns == 1
    assert deadlines.report()[1] == (
        "overruns    1 of 3 deadlines missed (33.33%), by 300 ms (median) and 300 ms (worst); at 1 of them the request came "
        "after the deadline"
    )
    assert deadlines.report()[0].startswith("real time   2 asked for, 1.667 achieved")


def test_skip_keeps_the_deadlines_and_names_the_flashes_that_are_late():
    deadlines, due, clock = replies("skip", ready_s=(0.0, 0.2, 1.8))
    assert due == pytest.approx([0.0, 0.5, 1.8])
    assert deadlines.has_passed(3 * NS)
    assert not deadlines.has_passed(4 * NS)
    deadlines.time_reply(3 * NS, clock.now_s, skipped=True)
    assert deadlines.report()[-1] == "skipped     1 flashes were left out"
    slip, _, _ = replies("slip", ready_s=(0.0, 0.2, 1.8))
    assert not slip.has_passed(3 * NS)


def test_fail_ends_the_run():
    with pytest.raises(rl.RunError, match="the step to 2 s was ready 300 ms after its deadline"):
        replies("fail", ready_s=(0.0, 0.2, 1.3))


def test_the_clock_begins_anew():
    deadlines, _, clock = replies("fail", ready_s=(0.0, 0.2))
    clock.now_s += 1e3
    deadlines.begin()
    assert deadlines.time_reply(0, clock.now_s) == clock.now_s


@pytest.mark.parametrize("factor", [0.0, -1.0, float("nan"), float("inf")])
def test_a_factor_that_is_none(factor):
    with pytest.raises(rl.ScenarioError, match="is no factor of real time"):
        rl.loop.Deadlines(factor)
