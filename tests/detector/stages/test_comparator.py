"""The comparator: the first crossing latches, hysteresis holds it at arming, and no result moves with the step of time."""

import itertools
import math

import numpy as np
import pytest

from rso_lidar.detector import Gsfl, make_plate, run_trial
from rso_lidar.detector.bench.calibration import make_reference_pulse
from rso_lidar.detector.stages.comparator import NEVER, Bridge, find_crossings_between, mark_watched
from tests.reference.detector.comparator import first_crossing

TAU = 1.0243e-9


def crossing(amplitude, threshold=10.0, first=0, last=None, **settings):
    amplitude = np.atleast_2d(np.asarray(amplitude, dtype=np.float32))
    rows = len(amplitude)
    last = amplitude.shape[1] if last is None else last
    fill = np.full(rows, threshold), np.full(rows, first), np.full(rows, last)
    return first_crossing(amplitude, *fill, **settings).tolist()


def test_the_first_crossing_latches():
    assert crossing([[0, 5, 12, 3, 20, 0], [0, 9, 9.99, 9, 9, 9], [10, 0, 0, 0, 0, 0]]) == [2, NEVER, 0]


def test_only_watched_steps_latch():
    trace = [0, 12, 0, 0, 12, 0]
    assert crossing(trace, first=2) == [4]
    assert crossing(trace, first=2, last=4) == [NEVER]
    assert crossing(trace, first=3, last=2) == [NEVER]
    assert mark_watched(4, np.array([1]), np.array([3])).tolist() == [[False, True, True, False]]


@pytest.mark.parametrize(
    ("trace", "hysteresis", "expected"),
    [
        ([12, 12, 12, 12, 12], 3.0, NEVER),  # above when armed: not ready
        ([12, 8, 12, 12, 12], 3.0, NEVER),  # has fallen below the threshold, not by the hysteresis
        ([12, 6.9, 12, 12, 12], 3.0, 2),  # ready again
        ([12, 8, 12, 12, 12], 0.0, 2),  # without hysteresis at once
        ([0, 12, 12, 12, 12], 3.0, 1),
    ],
)
def test_a_signal_above_at_arming_fires_only_after_it_was_below(trace, hysteresis, expected):
    arming = np.array([True])
    assert crossing(trace, hysteresis=hysteresis, arming=arming) == [expected]
    # A row that was watched before has been ready all along: what is above at its first step latches there.
    at_once = NEVER if max(trace) < 10.0 else int(np.argmax(np.array(trace) >= 10.0))
    assert crossing(trace, hysteresis=hysteresis, arming=np.array([False])) == [at_once]


def test_what_happened_before_arming_does_not_count():
    """Low before the comparator is watched, above when it is: not ready."""
    assert crossing([0, 0, 12, 12, 12], first=2, hysteresis=3.0, arming=np.array([True])) == [NEVER]
    assert crossing([0, 0, 12, 12, 12], first=2, hysteresis=3.0) == [2]


def correlation(a, b):
    x = np.abs(np.subtract.outer(a, b))
    return (1.0 + x) * np.exp(-x)


@pytest.mark.parametrize("step_ns", [2.38 / 2, 2.38 / 6])
def test_bridged_noise_is_the_same_noise(step_ns):
    """Estimate and rest together have the covariance of the process itself, with the steps and among the points."""
    bridge = Bridge(TAU, step_ns * 1e-9)
    n_points = len(bridge.root)
    known = np.arange(-1.0, 3.0) * step_ns * 1e-9 / TAU
    between = np.arange(1, n_points + 1) / (n_points + 1.0) * step_ns * 1e-9 / TAU
    steps = correlation(known, known)
    among = bridge.weights @ steps @ bridge.weights.T + bridge.root @ bridge.root.T
    assert np.abs(among - correlation(between, between)).max() < 1e-9
    assert np.diagonal(among) == pytest.approx(1.0, abs=1e-9)
    assert np.abs(bridge.weights @ steps - correlation(between, known)).max() < 1e-9
    assert bridge.sigma**2 == pytest.approx(max(np.diagonal(bridge.root @ bridge.root.T)), rel=1e-9)


def test_heights_between_steps_are_those_of_the_process():
    """Steps and points drawn together, against points drawn from the steps: shares above a level agree, 4 sigma."""
    bridge, n = Bridge(TAU, 1.19e-9), 40_000
    at = np.concatenate([np.arange(-1.0, 3.0), np.arange(1, 16) / 16.0]) * 1.19e-9 / TAU
    rng = np.random.default_rng(3)
    drawn = rng.standard_normal((n, 19)) @ np.linalg.cholesky(correlation(at, at)).T
    truth = drawn[:, 4:].max(axis=1)
    steps, zero = drawn[:, :4], np.zeros((n, 4))
    found = bridge.path(steps, zero, np.arange(n), np.ones(n, int), np.ones(n), rng).max(axis=1)
    below = steps[:, 1:3].max(axis=1) < 1.5
    for level in (0.5, 1.5, 2.5):
        for rows in (slice(None), below):
            a, b = (truth[rows] > level).mean(), (found[rows] > level).mean()
            p = 0.5 * (a + b)
            assert abs(a - b) < 4.0 * math.sqrt(2.0 * p * (1.0 - p) / len(truth[rows])) + 1e-12
    assert (found[below] > 1.5).mean() > 0.01  # what the steps alone would miss


def test_the_mean_between_steps_is_a_quintic():
    """Without noise: x(1 − x), and with it x(1 − x)(x + 1)(x − 2) of fourth order, are highest halfway of steps 0 and 1."""
    x = np.arange(-2.0, 4.0)
    mean = (7.0 + x * (1.0 - x) - 0.5 * x * (1.0 - x) * (x + 1.0) * (x - 2.0))[None]
    found = Bridge(TAU, 1e-9).path(mean, mean, np.zeros(1, int), np.full(1, 2), np.zeros(1), np.random.default_rng(0))
    assert found.max(axis=1) == pytest.approx([7.0 + 0.25 + 0.5 * 0.25 * 2.25], abs=1e-9)


def test_crossed_between_reports_the_first_step_of_each_row():
    x = np.arange(-1.0, 3.0)
    hump = 7.0 + x * (1.0 - x)
    trace = np.concatenate([hump, np.zeros(4), hump])[None]
    traces = np.concatenate([trace, trace - 5.0, trace])
    watched = np.ones(traces.shape, bool)
    watched[2, :4] = False
    sigma = np.full(traces.shape, 1e-6)  # no noise to speak of; what is looked at is near the threshold all the same
    bridge = Bridge(TAU, 1e-9)
    bridge.reach = 1e6
    found = find_crossings_between(traces, traces, np.full(3, 7.1), watched, sigma, bridge, np.random.default_rng(0))
    # 7 + x (1 − x) passes 7.1 at x = 0.113; the quintic through the flat ends of the humps bends it a little.
    assert found == pytest.approx([1.11, NEVER, 9.11], abs=0.03)


def test_detection_does_not_move_with_the_step_of_time():
    """900 photons, 49,152 pixels for each number of steps: any two shares agree, 3.5 sigma of a binomial, 0.008."""
    found, n = [], 3 * 16_384
    photons = make_plate(900.0, 16_384, make_reference_pulse(), 8e-9)
    for steps in (2, 3, 6):
        gsfl = Gsfl(steps_per_sample=steps)
        shares = [run_trial(gsfl, photons, np.random.default_rng(10 * steps + k)).probability for k in range(3)]
        found.append(float(np.mean(shares)))
    assert 0.5 < min(found) < 0.95  # where the share depends on the threshold most
    for a, b in itertools.combinations(found, 2):
        p = 0.5 * (a + b)
        assert abs(a - b) < 3.5 * math.sqrt(2.0 * p * (1.0 - p) / n)
