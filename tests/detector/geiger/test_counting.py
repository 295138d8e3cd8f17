"""Closed forms of photon counting, against sums and integrals done by hand."""

import math

import numpy as np
import pytest

from rso_lidar.detector.geiger import counting

GATE_S, BIN_S = 1e-6, 1e-9


def poisson_tail(least, mean):
    return 1.0 - sum(math.exp(-mean) * mean**k / math.factorial(k) for k in range(least))


@pytest.mark.parametrize("counts", [1, 2, 4])
def test_a_false_peak_begins_with_a_count_that_others_follow(counts):
    """One bin wide: the others come in the rest of the first count's own bin, evenly from all of it to nothing."""
    noise = np.array([2e6])
    rest = (np.arange(20_000) + 0.5) / 20_000 * BIN_S
    followed = np.mean([poisson_tail(counts - 1, noise[0] * r) for r in rest]) if counts > 1 else 1.0
    expected = -math.expm1(-noise[0] * GATE_S * followed)
    got = counting.false_peak_probability(counts, noise, GATE_S, BIN_S, 1)
    assert got == pytest.approx([expected], rel=1e-6)


def test_a_false_peak_may_span_several_bins():
    """Five bins: three counts in what is left of the first one and four bins more; each count begins a peak of its own."""
    noise, bins, counts = 3e6, 5, 3
    window_s = BIN_S * (bins - 1 + (np.arange(20_000) + 0.5) / 20_000)
    expected = -math.expm1(-noise * GATE_S * np.mean([poisson_tail(counts - 1, noise * one) for one in window_s]))
    got = counting.false_peak_probability(np.array([counts]), np.array([noise]), GATE_S, BIN_S, bins)
    assert got == pytest.approx([expected], rel=1e-8)


def test_more_noise_wider_peaks_and_fewer_counts_are_likelier():
    def probability(counts=3, noise=1e6, peak_bins=4):
        return float(counting.false_peak_probability(np.array(counts), np.array(noise), GATE_S, BIN_S, peak_bins))

    assert probability(4) < probability() < probability(2)
    assert probability(noise=5e5) < probability() < probability(noise=2e6)
    assert probability(peak_bins=3) < probability() < probability(peak_bins=5)
    assert probability(noise=0.0) == 0.0


@pytest.mark.parametrize("wanted", [1e-9, 1e-3, 0.3])
def test_least_counts_are_the_least_that_keep_the_probability(wanted):
    noise = np.array([[0.0, 1e4], [1e6, 1e8]])
    least = counting.find_least_counts(wanted, noise, GATE_S, BIN_S, 4)
    assert least.shape == noise.shape
    assert (counting.false_peak_probability(least, noise, GATE_S, BIN_S, 4) <= wanted).all()
    fewer = counting.false_peak_probability(least - 1, noise, GATE_S, BIN_S, 4)
    assert ((fewer > wanted) | (least == 1)).all()
    assert least[0, 0] == 1 and least[1, 1] > 2


@pytest.mark.parametrize(("fired", "pulses", "counts"), [(0.1, 20, 1), (0.1, 20, 4), (0.9, 5, 5), (0.3, 1, 1)])
def test_a_peak_is_binomial(fired, pulses, counts):
    expected = sum(math.comb(pulses, k) * fired**k * (1 - fired) ** (pulses - k) for k in range(counts, pulses + 1))
    assert counting.peak_probability(np.array([fired]), pulses, counts) == pytest.approx([expected], rel=1e-12)
    half = -math.expm1(-counting.threshold_primaries(pulses, counts))
    assert counting.peak_probability(np.array([half]), pulses, counts) == pytest.approx([0.5], rel=1e-9)


def test_more_counts_than_pulses_never_come():
    assert counting.peak_probability(np.array([0.5, 1.0]), 3, 4).tolist() == [0.0, 0.0]
    assert counting.threshold_primaries(3, 4) == math.inf


def test_live_fraction_before_and_after_the_first_hold_off():
    assert counting.live_fraction(1e6, 5e-6, 1e-6) == pytest.approx(math.exp(-1.0))
    assert counting.live_fraction(1e6, 1e-6, 5e-6) == pytest.approx(0.5)
    assert counting.live_fraction(2e6, 3e-6, 3e-6) == pytest.approx(math.exp(-6.0))  # at the end of the hold-off
    assert counting.live_fraction(2e6, 3e-6, 3.001e-6) == pytest.approx(1.0 / 7.0)
    assert counting.live_fraction(0.0, 1e-6, 5e-6) == 1.0


@pytest.mark.parametrize("primaries", [1e-3, 1.0, 30.0])
def test_first_photons_of_an_even_pulse(primaries):
    """Even light over T: the first time is exponential, cut at T. Mean T/N - T/(e^N - 1); variance by the same integrals."""
    step_s, n = 0.05e-9, 401
    length_s = n * step_s
    power = np.full(n, 1.0 / length_s)
    mean_s, variance_s2 = counting.first_photon_moments(np.array([primaries]), np.zeros(1), step_s, power)
    t = (np.arange(200_000) + 0.5) / 200_000 * length_s
    density = np.exp(-primaries * t / length_s)
    density /= density.sum()
    mean = (density * t).sum()
    assert mean == pytest.approx(length_s / primaries - length_s / math.expm1(primaries), rel=1e-4)
    assert mean_s[0] + 0.5 * length_s == pytest.approx(mean, abs=0.003 * length_s)
    assert variance_s2[0] == pytest.approx((density * (t - mean) ** 2).sum(), rel=0.02)


def test_depth_widens_the_times_and_moves_them_by_nothing():
    step_s, power = 0.1e-9, np.exp2(-((np.arange(-60, 61) / 20.0) ** 2))
    power /= power.sum() * step_s
    mean_s, variance_s2 = counting.first_photon_moments(np.full(2, 1e-3), np.array([0.0, 6e-9]), step_s, power)
    assert mean_s == pytest.approx([0.0, 0.0], abs=3e-12)
    assert variance_s2[1] - variance_s2[0] == pytest.approx((6e-9) ** 2 / 12.0, rel=0.02)


TAPS = (1.0, 1.0, 1.0, 5.0, 5.0, 2.0, 0.0)  # of a lopsided pulse; the middle one is time zero


def first_photon_by_hand(primaries, depth_s, step_s, power_per_s):
    """Return mean and variance of the first of a Poisson number of photons, each spread by the pulse and by the depth.

    A photon has come by t with the probability F, a sum of boxes of one step spread evenly over the depth; in closed form.
    The first has come by t with G = (1 - exp(-N F)) / (1 - exp(-N)). Moments by parts: E[t] = end - ∫ G, E[t²] =
    end² - 2 ∫ t G.
    """
    count = len(power_per_s)
    start_s = step_s * (np.arange(count) - count / 2.0)  # of each box
    t, width_s = np.linspace(start_s[0] - depth_s, start_s[-1] + step_s + depth_s, 400_001, retstep=True)
    ramp = lambda x: 0.5 * np.maximum(x, 0.0) ** 2  # noqa: E731
    came = np.zeros(len(t))
    for begin_s, power in zip(start_s, power_per_s, strict=True):
        late, early = t - begin_s + 0.5 * depth_s, t - begin_s - 0.5 * depth_s
        came += power * (ramp(late) - ramp(late - step_s) - ramp(early) + ramp(early - step_s)) / depth_s
    G = np.expm1(-primaries * came) / math.expm1(-primaries)
    mean_s = t[-1] - np.trapezoid(G, dx=width_s)
    return mean_s, t[-1] ** 2 - 2.0 * np.trapezoid(t * G, dx=width_s) - mean_s**2


def test_first_photons_of_a_lopsided_pulse_from_a_deep_surface():
    """More returns than are computed together, of other light and depth each: down to one step, and to four pulses."""
    step_s = 0.5e-9
    power = np.array(TAPS) / (sum(TAPS) * step_s)
    primaries = np.geomspace(0.02, 12.0, 600)
    depth_s = np.tile([0.6e-9, 1.7e-9, 5.3e-9, 14e-9], 150)
    mean_s, variance_s2 = counting.first_photon_moments(primaries, depth_s, step_s, power)
    for k in (0, 130, 255, 256, 257, 311, 598, 599):
        expected = first_photon_by_hand(float(primaries[k]), float(depth_s[k]), step_s, power)
        spread_s = math.sqrt(expected[1])
        # 511 cells over some 20 spreads: a cell puts its photons in its middle, which takes 1/12 of its square
        assert mean_s[k] == pytest.approx(expected[0], abs=2e-3 * spread_s)
        assert variance_s2[k] == pytest.approx(expected[1], rel=2e-3)
