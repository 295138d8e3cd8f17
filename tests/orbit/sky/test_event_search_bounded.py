"""Spans of functions of bounded rate: what no scan would see, gaps, windows, and a search that stays near its limit."""

import numpy as np
import pytest

from rso_lidar.errors import RsoLidarWarning
from rso_lidar.orbit import find_bounded_spans, join_spans


class Known:
    """A function whose greatest rate in an interval is known from its derivative at both ends and its curvature."""

    def __init__(self, value, rate):
        self._value, self._rate, self.asked = value, rate, 0

    def sample(self, time_s):
        self.asked += len(time_s)
        return np.stack([self._value(time_s), time_s], axis=1)

    def bound_change(self, low, high, step_s):
        return self._rate(low[:, 1], high[:, 1]) * step_s


def lorentz(at_s, width_s, depth=1.5):
    """Return 1 less a dip at an instant, and a bound on its rate that falls off beside it."""

    def value(time_s):
        return 1.0 - depth / (1.0 + ((time_s - at_s) / width_s) ** 2)

    def rate(low_s, high_s):
        least = np.where((low_s <= at_s) & (high_s >= at_s), 0.0, np.minimum(abs(low_s - at_s), abs(high_s - at_s)))
        return depth / width_s / (1.0 + (least / width_s) ** 2)  # 2 x / (1 + x^2)^2 is at most 1 / (1 + x^2)

    return Known(value, rate)


@pytest.mark.parametrize("at_s", [10.0, 33_333.3, 604_790.0])
def test_a_dip_of_a_fifth_of_a_second_in_a_week_is_found_from_a_scan_of_minutes(at_s):
    function = lorentz(at_s, 0.15)
    ((begin, end),) = find_bounded_spans(function, [(0.0, 604_800.0)], 600.0)
    half = 0.15 * np.sqrt(0.5)
    assert (begin, end) == (pytest.approx(at_s - half, abs=1e-4), pytest.approx(at_s + half, abs=1e-4))
    assert function.asked < 3000


def test_a_short_gap_is_found_like_a_short_span():
    dip = lorentz(5000.0, 0.3)
    gap = Known(lambda t: -dip._value(t), dip._rate)
    spans = find_bounded_spans(gap, [(0.0, 9000.0)])
    assert [round(edge, 3) for span in spans for edge in span] == pytest.approx(
        [0.0, 5000.0 - 0.3 * np.sqrt(0.5), 5000.0 + 0.3 * np.sqrt(0.5), 9000.0], abs=1e-3
    )


def test_spans_end_with_their_windows():
    wave = Known(lambda t: np.cos(2.0 * np.pi * t / 100.0), lambda low, high: np.full(low.shape, 2.0 * np.pi / 100.0))
    spans = find_bounded_spans(wave, [(0.0, 50.0), (50.0, 60.0), (130.0, 170.0), (7.0, 7.0)])
    assert [edge for span in spans for edge in span] == pytest.approx([25, 50, 50, 60, 130, 170], abs=1e-4)
    assert join_spans(spans) == [(spans[0][0], spans[1][1]), spans[2]]
    assert find_bounded_spans(wave, []) == []


def test_where_a_function_has_no_value_it_does_not_hold():
    half = Known(lambda t: np.where(t < 40.0, -1.0, np.nan), lambda low, high: np.full(low.shape, 1e-3))
    ((begin, end),) = find_bounded_spans(half, [(0.0, 100.0)])
    assert (begin, end) == (0.0, pytest.approx(40.0, abs=1e-4))


@pytest.mark.slow
def test_a_function_that_stays_at_its_limit_ends_with_a_warning():
    still = Known(lambda t: 1e-9 * np.sin(t), lambda low, high: np.full(low.shape, 1.0))
    with pytest.warns(RsoLidarWarning, match=r"searched every 0\.\d+ s there, so that shorter events can be missed"):
        spans = find_bounded_spans(still, [(0.0, 300_000.0)])
    assert len(spans) == pytest.approx(300_000.0 / (2.0 * np.pi), abs=1.0)
    assert still.asked < 8e6
