"""False alarms: Rice's formula where it holds, and simulated or exactly known avalanche noise where it does not."""

import math

import numpy as np
import pytest
from scipy import signal, stats

from rso_lidar.detector import Apd
from rso_lidar.detector.settings.apd import cumulants, noise_rms
from rso_lidar.detector.stages.avalanche import mcintyre_pmf
from rso_lidar.detector.stages.crossing_rate import false_alarm_rate, rice_rate
from tests.detector.row_noise_for_tests import multiply

NA_PER_S = 6.241509e9  # 1 nA in electrons a second (SI)
TAU = 1.0243e-9  # √(√2 − 1)/(2π 100 MHz)
INTEGRATION = 8.516e-9


def alarms(threshold, apd=None, rate=NA_PER_S, noise=1018.0, pole_s=TAU, integration_s=INTEGRATION):
    return false_alarm_rate(
        np.asarray(threshold),
        apd=Apd() if apd is None else apd,
        rate_per_s=rate,
        noise_electrons=noise,
        pole_s=pole_s,
        integration_s=integration_s,
    )


def test_crossing_rate_is_rices_for_the_two_pole_spectrum():
    # Rice 1945: ν₀² = ∫f²|H|²df / ∫|H|²df; by sum over |H|² = 1/(1 + (2πfτ)²)², whose tail beyond f is 1/(3 (2πτ)⁴ f³).
    f = (np.arange(2_000_000) + 0.5) * 1e-4 / TAU
    h2 = 1.0 / (1.0 + (2.0 * math.pi * f * TAU) ** 2) ** 2
    nu0 = math.sqrt((f**2 * h2).sum() / h2.sum())
    assert rice_rate(0.0, 1.0, TAU) == pytest.approx(nu0, rel=1e-3)
    assert rice_rate(np.array([3.0]), 1.5, TAU) == pytest.approx(nu0 * math.exp(-2.0), rel=1e-3)


def test_noise_is_campbells():
    # Campbell's theorem: variance = rate · E[n²] ∫(integration · h)² dt, here by sum over h.
    t = np.arange(0.5, 4000) * TAU / 100.0
    h = t / TAU**2 * np.exp(-t / TAU)
    variance = NA_PER_S * 352.0 * INTEGRATION**2 * (h**2).sum() * TAU / 100.0
    assert noise_rms(Apd(), NA_PER_S, 300.0, TAU, INTEGRATION) == pytest.approx(
        math.hypot(300.0, math.sqrt(variance)), rel=1e-4
    )


@pytest.mark.parametrize(
    ("apd", "rate", "noise"),
    [
        (Apd(statistics="gaussian"), NA_PER_S, 300.0),
        (Apd(), 0.0, 300.0),
        (Apd(), 1e3, 1018.0),  # avalanches too rare to matter up to five sigma
        (Apd(gain=1.0), NA_PER_S, 1018.0),  # no avalanches
    ],
    ids=["by_name", "no_dark_current", "rare", "no_gain"],
)
def test_the_gaussian_limit_is_rice(apd, rate, noise):
    sigma = noise_rms(apd, rate, noise, TAU, INTEGRATION)
    T = sigma * np.linspace(0.0, 5.0, 21)
    assert alarms(T, apd, rate, noise) == pytest.approx(rice_rate(T, sigma, TAU), rel=1e-3)


def test_many_small_avalanches_approach_rice_as_edgeworth_says():
    """Skewness γ multiplies the density at z sigma by 1 + γ(z³ − 3z)/6 + ... (Edgeworth); here γ = 0.024, γ² is dropped."""
    rate, z = 1e13, np.array([0.5, 1.0, 2.0, 3.0])
    pulses, peak = rate * TAU, INTEGRATION / TAU
    _, _, third = cumulants(Apd())
    sigma = noise_rms(Apd(), rate, 0.0, TAU, INTEGRATION)
    # ∫x³ exp(−3x)dx = 2/27; E[x'²|x] grows as 1 + γ'z, γ' = ∫g g'² / (∫g²)^1.5 for the pulse g.
    skewness = pulses * third * peak**3 * (2.0 / 27.0) / sigma**3
    slope = pulses * third * peak**3 * (1.0 / 27.0) / sigma**3
    expected = 1.0 + skewness * (z**3 - 3.0 * z) / 6.0 + 0.5 * slope * z
    assert alarms(z * sigma, rate=rate, noise=0.0) / rice_rate(z, 1.0, TAU) == pytest.approx(expected, abs=0.01)
    assert expected[-1] > 1.05


@pytest.mark.parametrize("k", [0.2, 0.4])
def test_single_avalanches_cross_as_often_as_their_peak_is_high_enough(k):
    """With rare avalanches and a quiet amplifier the rate is exactly rate · P(n · peak > T), the peak being 1/(e τ).

    The normal slope makes the formula too high by up to a quarter (its docstring).
    """
    apd, rate = Apd(ionisation_ratio=k), 1e-4 * NA_PER_S
    first, pmf = mcintyre_pmf(1, 10.0, k)
    for threshold in (100, 200, 360):
        exact = rate * pmf[threshold - first :].sum()
        ratio = alarms(threshold, apd, rate, 5.0, integration_s=math.e * TAU) / exact
        assert 0.98 < ratio < 1.25


def test_what_a_quiet_amplifier_sees_at_360_electrons():
    """1 nA · P(n > 360) is 2.4e4 /s at k = 0.2 and 5.8e5 /s at k = 0.4; pile-up and 60 electrons of noise raise it.

    The former are the often quoted figures, of single avalanches. Pile-up: 6.4 primaries come in a time constant.
    """
    for k, single in ((0.2, 2.42e4), (0.4, 5.83e5)):
        first, pmf = mcintyre_pmf(1, 10.0, k)
        assert NA_PER_S * pmf[360 - first :].sum() == pytest.approx(single, rel=0.01)
        quiet = alarms(360.0, Apd(ionisation_ratio=k), NA_PER_S, 60.0, integration_s=math.e * TAU)
        assert 3.0 * single < quiet < 40.0 * single


def simulated(apd, pulses, noise, peak, thresholds, seed, n=2_500_000, step=0.02):
    """Return upcrossings in one long trace, and its length in τ: avalanches and white noise through two poles."""
    rng, decay = np.random.default_rng(seed), math.exp(-step)
    electrons = multiply(np.full(n, pulses * step), apd, rng)
    x = peak * (signal.lfilter([0.0, step * decay], [1.0, -2.0 * decay, decay**2], electrons) - pulses * apd.gain)
    # du = −u dt + dW, dv = (u − v) dt; the increments over a step have the covariance ∫(1, g)ᵀ(1, g) exp(−2g) dg.
    e = math.exp(-2.0 * step)
    c11, c12 = (1.0 - e) / 2.0, (1.0 - e * (1.0 + 2.0 * step)) / 4.0
    c22 = (1.0 - e * (1.0 + 2.0 * step + 2.0 * step**2)) / 4.0
    first, second = rng.standard_normal((2, n))
    dv = c12 / math.sqrt(c11) * first + math.sqrt(c22 - c12**2 / c11) * second
    u = signal.lfilter([1.0], [1.0, -decay], math.sqrt(c11) * first)
    dv[1:] += step * decay * u[:-1]
    x += 2.0 * noise * signal.lfilter([1.0], [1.0, -decay], dv)  # ∫h² = 1/4
    x = x[1000:]
    return np.array([((x[:-1] < T) & (x[1:] >= T)).sum() for T in thresholds]), len(x) * step


@pytest.mark.parametrize(
    ("k", "pulses", "noise", "least"),
    [
        (0.2, 6.4, 1018.0, 0.97),
        (0.2, 6.4, 60.0, 0.85),
        (0.2, 0.64, 60.0, 0.8),
        (0.4, 0.64, 60.0, 0.75),
        (0.0, 20.0, 100.0, 0.95),
    ],
)
def test_crossings_of_a_simulated_trace(k, pulses, noise, least):
    """The formula is as seen or a little high: between `least` and 1.02 of it, beyond Poisson's 99.9 % interval.

    Steps of 0.02 τ miss less than 2 % of crossings; the rest is the slope, which is not normal where few pulses overlap.
    1 nA is 6.4 primaries in a time constant. Crossings cluster, so the interval takes each to count twice.
    """
    apd, peak = Apd(ionisation_ratio=k), 8.3
    sigma = float(noise_rms(apd, pulses, noise, 1.0, peak))
    thresholds = sigma * np.array([2.5, 3.0, 3.5])
    seen, length = simulated(apd, pulses, noise, peak, thresholds, seed=11)
    expected = length * alarms(thresholds, apd, pulses, noise, pole_s=1.0, integration_s=peak)
    low = stats.poisson(least * expected / 2.0).ppf(0.0005) * 2.0
    high = stats.poisson(1.02 * expected / 2.0).isf(0.0005) * 2.0
    assert np.all((low <= seen) & (seen <= high)), (seen, expected)
    if noise < 1000.0:  # where a Gaussian would be far off
        assert np.all(seen[1:] > 1.3 * length * rice_rate(thresholds, sigma, 1.0)[1:])


def test_a_field_of_thresholds_and_rates_is_what_each_pixel_is_alone():
    """Interpolation in threshold and rate costs less than 2e-3, over a hundredfold of rates and 20 decades of alarms."""
    rng = np.random.default_rng(12)
    T, rate = rng.uniform(0.0, 9000.0, (4, 5)), NA_PER_S * 10.0 ** rng.uniform(-1.0, 1.0, (4, 5))
    T[0, 0], rate[0, 1] = math.inf, 0.0
    together = alarms(T, rate=rate)
    alone = np.array(
        [[float(alarms(t, rate=r)) for t, r in zip(*row, strict=True)] for row in zip(T, rate, strict=True)]
    )
    assert together == pytest.approx(alone, rel=2e-3)
    assert together[0, 0] == 0.0
    assert alarms(T[1]).shape == (5,) and alarms(6112.0).shape == ()


def test_alarms_fall_with_the_threshold_and_rise_with_everything_else():
    T = np.linspace(0.0, 12000.0, 200)
    rates = alarms(T)
    assert np.all(np.diff(rates[rates > 0.0]) <= 1e-9 * rates.max()) and rates[60] > 1e3 * rates[-1]
    high = 6112.0
    assert alarms(high, rate=2.0 * NA_PER_S) > alarms(high)
    assert alarms(high, noise=1100.0) > alarms(high)
    assert alarms(high, apd=Apd(ionisation_ratio=0.4)) > 2.0 * alarms(high)
    assert alarms(-50.0) == alarms(0.0)


def test_a_silent_comparator_never_triggers():
    assert alarms(100.0, rate=0.0, noise=0.0) == 0.0
    assert rice_rate(np.array([100.0]), 0.0, TAU).tolist() == [0.0]
    assert alarms(1e9) == 0.0
