"""Geiger-mode array against the statistics of photon counting: Poisson detection, first photons, dead time, false peaks.

Bands are 4 standard deviations of the number of draws.
"""

import math
from dataclasses import replace

import numpy as np
import pytest

import rso_lidar as rl
from rso_lidar import units
from rso_lidar.detector import LaserPulse, detect, predict
from rso_lidar.detector.geiger.histogram import count_photons
from tests.detector.returns_for_tests import bell, nothing, returns

PER_M = units.RANGE_PER_DELAY_M_S
QUIET = rl.GeigerArray(dark_count_rate_hz=0.0, least_counts=1, jitter_ns=0.0)
ONE = QUIET.replace(pulses=1)  # the histogram of a frame is one time
N = 40_000


def rng(seed=3):
    return np.random.default_rng(seed)


def times_of(part, photons, seed=3):
    """Return the delays [s] that pixels of one pulse report."""
    found = count_photons(part, photons, rng(seed))
    return found.delay_s[found.counts > 0]


@pytest.mark.parametrize("photons", [0.05, 2.0])
def test_detection_by_one_pulse(validation, photons):
    fired = len(times_of(ONE, returns(np.full(N, 150.0), photons))) / N
    expected = -math.expm1(-0.4 * photons)
    validation(
        case=f"one pulse of {photons:g} photons fires a pixel of PDE 0.4",
        source="Poisson: 1 - exp(-PDE N)",
        expected=expected,
        got=fired,
        tolerance=4 * math.sqrt(expected * (1 - expected) / N),
        unit="1",
    )


@pytest.mark.parametrize(("photons", "depth_s"), [(0.5, 0.0), (500.0, 0.0), (10.0, 20e-9)])
def test_first_photon_fires_early(validation, photons, depth_s):
    """The density of the time is λ(t) exp(-∫λ) over 1 - exp(-N), integrated here by hand."""
    light = returns(np.full(N, 150.0), photons)
    light = replace(light, depth_spread_s=np.full(N, depth_s))
    errors_s = times_of(ONE, light) - 150.0 / PER_M
    t = np.linspace(-60e-9, 60e-9, 48_001)
    rate = np.exp2(-((t / 4e-9) ** 2))
    if depth_s > 0.0:
        rate = np.convolve(rate, np.ones(round(depth_s / (t[1] - t[0]))), mode="same")
    rate *= 0.4 * photons / rate.sum()
    density = rate * np.exp(-(np.cumsum(rate) - 0.5 * rate))
    density /= density.sum()
    mean = (density * t).sum()
    sigma = math.sqrt((density * (t - mean) ** 2).sum() + (0.25e-9) ** 2 / 12)
    case = f"{photons:g} photons in 8 ns over {depth_s / 1e-9:g} ns of depth"
    source = "first arrival of a Poisson process: λ exp(-∫λ)"
    n = len(errors_s)
    validation(
        case=f"mean of the time, {case}", source=source, expected=mean / 1e-9, got=errors_s.mean() / 1e-9,
        tolerance=(4 * sigma / math.sqrt(n) + 0.01e-9) / 1e-9, unit="ns",
    )  # fmt: skip
    validation(
        case=f"spread of the time, {case}", source=source, expected=sigma / 1e-9, got=errors_s.std() / 1e-9,
        tolerance=(4 * sigma / math.sqrt(n) + 0.01e-9) / 1e-9, unit="ns",
    )  # fmt: skip


@pytest.mark.parametrize("hold_off_ns", [20.0, 400.0])
def test_dead_time_loses_counts(validation, hold_off_ns):
    """m = n/(1 + n τ), of a long gate; the part that a gate gains at its opening is added (renewal theory)."""
    rate, gate_s = 1e7, 20e-6
    part = QUIET.replace(dark_count_rate_hz=rate, gate_to_m=gate_s * PER_M, bin_ns=1.0, hold_off_ns=hold_off_ns)
    got = count_photons(part, nothing((1, 400)), rng()).total_counts.mean() / part.pulses / gate_s
    load = rate * hold_off_ns * 1e-9
    # Renewals of a shifted exponential, alive at the start: E[X²]/2μ² - E[X1]/μ (Cox, Renewal Theory, sec. 4.2).
    edge = load**2 / (2 * (1 + load) ** 2) / gate_s
    validation(
        case=f"counts of 10 MHz with {hold_off_ns:g} ns of dead time",
        source="non-paralyzable counter, n/(1 + n τ) (Knoll, sec. 4.VII), opened alive",
        expected=rate / (1 + load) + edge,
        got=got,
        tolerance=4 * math.sqrt(rate / (1 + load) ** 3 / (gate_s * 400 * part.pulses)),
        unit="1/s",
    )


def test_dark_counts_block_the_signal(validation):
    part = ONE.replace(dark_count_rate_hz=1e6)
    found = times_of(part, returns(np.full(N, 240.0), 1000.0))
    at_s = 240.0 / PER_M
    share = (found > at_s - 20e-9).sum() / N
    expected = math.exp(-1e6 * (at_s - 13e-9))  # a kilophoton fires 10 to 16 ns early, by its leading edge
    validation(
        case="bright return at 240 m behind dark counts of 1 MHz",
        source="Poisson: exp(-rate x time since the gate opened)",
        expected=expected,
        got=share,
        tolerance=4 * math.sqrt(expected * (1 - expected) / N) + 0.006 * expected,
        unit="1",
    )


@pytest.mark.parametrize("least", [2, 3])
def test_false_peaks_of_a_dark_frame(validation, least):
    part = rl.GeigerArray(dark_count_rate_hz=60_000.0, least_counts=least, peak_ns=0.25, pulses=200, gate_to_m=75.0)
    pixels = 60_000
    reading, _ = detect(nothing((1, pixels)), part, rng())
    # Bins are independent: each has k counts by Poisson's law, of pulses that no earlier count has blocked (1.5 %).
    mean = 200 * 60_000.0 * 0.25e-9 * 0.985
    expected = -math.expm1(-part.n_bins * mean**least / math.factorial(least))
    validation(
        case=f"dark pixels with {least} counts in one bin",
        source="Poisson, independent bins",
        expected=expected,
        got=np.isfinite(reading.range_m).mean(),
        tolerance=4 * math.sqrt(expected / pixels) + 0.04 * expected,
        unit="1",
    )
    assert float(part.false_peak_probability(np.zeros(1))[0]) == pytest.approx(expected, rel=0.08)


def test_least_counts_keep_the_false_alarms_that_are_asked_for():
    part = rl.GeigerArray(false_alarm_probability=0.02, dark_count_rate_hz=30_000.0)
    reading, _ = detect(nothing((1, 20_000)), part, rng())
    share, stated = np.isfinite(reading.range_m).mean(), float(part.false_peak_probability(np.zeros(1))[0])
    assert stated <= 0.02
    assert share <= stated * 1.05 + 4 * math.sqrt(stated / 20_000)
    assert share >= 0.7 * stated - 4 * math.sqrt(stated / 20_000)


def test_afterpulses(validation):
    """Without other noise each avalanche has a following p/(1 - p) afterpulses on average."""
    part = QUIET.replace(hold_off_ns=20.0, afterpulse_probability=0.1, afterpulse_time_ns=30.0)
    light = returns(np.full(2000, 20.0), 0.5)
    with_them, without = (
        count_photons(one, light, rng()).total_counts.sum() for one in (part, part.replace(afterpulse_probability=0.0))
    )
    validation(
        case="counts per avalanche with an afterpulse probability of 0.1",
        source="branching: 1/(1 - p)",
        expected=1 / 0.9,
        got=with_them / without,
        tolerance=4 * math.sqrt(0.1 / without * 4),
        unit="1",
    )


def test_jitter_adds_in_variance(validation):
    light = returns(np.full(N, 150.0), 5000.0)
    still, moved = (times_of(ONE.replace(jitter_ns=ns), light).var() for ns in (0.0, 1.5))
    validation(
        case="jitter of 1.5 ns",
        source="variances of independent times add",
        expected=1.5,
        got=math.sqrt(moved - still) / 1e-9,
        tolerance=4 * 1.5 * 1.2 / math.sqrt(2 * N),
        unit="ns",
    )


@pytest.mark.parametrize("photons", [0.06, 0.15, 0.6])
def test_closed_form_agrees_with_frames(validation, photons):
    part = rl.GeigerArray()
    light = returns(np.full(8000, 150.0), photons, pulse_fwhm_s=1e-9)
    reading, _ = detect(light, part, rng())
    near = np.abs(reading.range_m - 150.0) < 1.0
    shape = bell(1e-9)
    told = predict(part, LaserPulse(shape["pulse_step_s"], shape["pulse_power_per_s"], 1e-9), np.array([photons]), 0.0)
    p = float(told.probability[0])
    validation(
        case=f"frames of 100 pulses of {photons:g} photons that report",
        source="binomial counts in the peak, 1 - exp(-PDE N) each",
        expected=p,
        got=near.mean(),
        tolerance=4 * math.sqrt(p * (1 - p) / 8000) + 0.02,
        unit="1",
    )
    assert reading.range_m.ravel()[near.ravel()].std() == pytest.approx(float(told.range_precision_m[0]), rel=0.25)


@pytest.mark.parametrize("photons", [0.012, 0.02])
def test_closed_form_counts_dark_counts_in_the_peak(validation, photons):
    """A peak holds dark counts too: half of a threshold that noise has raised is noise."""
    part = rl.GeigerArray(
        dark_count_rate_hz=2e6, pulses=2000, gate_to_m=30.0, hold_off_ns=1000.0, detection_efficiency=1.0
    )
    light = returns(np.full(4000, 15.0), photons, pulse_fwhm_s=0.5e-9)
    reading, _ = detect(light, part, rng())
    near = np.abs(reading.range_m - 15.0) < 0.5
    shape = bell(0.5e-9)
    pulse = LaserPulse(shape["pulse_step_s"], shape["pulse_power_per_s"], 0.5e-9)
    p = float(predict(part, pulse, np.array([photons]), 0.0).probability[0])
    validation(
        case=f"frames of 2000 pulses of {photons:g} photons that report above 8 dark counts",
        source="binomial counts of light and noise in the peak",
        expected=p,
        got=near.mean(),
        tolerance=4 * math.sqrt(p * (1 - p) / 4000)
        + 0.08,  # the fullest of the windows that hold the pulse: + 0.3 sigma
        unit="1",
    )
    alive = part.replace(
        hold_off_ns=1.0, peak_ns=4.0
    )  # noise neither kills the pixel, nor does the window cut the pulse
    half = predict(alive, pulse, np.array([alive.traits.threshold_photons]), 0.0).probability[0]
    assert half == pytest.approx(0.5, abs=0.06)
