"""Triggers on nothing: when they come, how many, what is stored of them, and that rows of noise say the same."""

import math

import numpy as np
import pytest
from scipy import stats

from rso_lidar.detector import Gsfl, detect
from rso_lidar.detector.analysis.false_alarms import mean_false_alarms_per_s
from rso_lidar.detector.chain.camera import camera_of, draw_camera_pixels
from rso_lidar.detector.chain.timing import plan_time
from rso_lidar.detector.chain.traces import arm_rows, latch_rows
from rso_lidar.detector.stages.false_triggers import (
    continue_noise,
    draw_crossings,
    draw_false_traces,
    draw_first_crossings,
    draw_first_false,
    rates_per_s,
)
from rso_lidar.detector.stages.time_axis import place_rows
from tests.detector.returns_for_tests import nothing, returns, simulate_rows
from tests.reference.detector.whole_chain import PATHS, computing

C = 299_792_458.0
# Low thresholds, so that a dark frame has hundreds of false triggers.
EASY = Gsfl(
    amplifier={"noise_electrons": 1000.0},
    trigger={"threshold_electrons": 5300.0, "threshold_spread_fraction": 0.02},
    timing={"pixel_jitter_ns": 0.0},
)


@pytest.mark.parametrize("window_means", [0.3, 30.0])
def test_waiting_times_are_exponential(window_means):
    """Kolmogorov and Smirnov's test of each pixel's time in units of its own mean; 0.1 % would fail by chance.

    In a window of 0.3 means crossings are drawn for all pixels together, and times are exponential up to its end; in one of
    30, whose end matters to none, pixel by pixel. How many have one is a binomial: 4 sigma.
    """
    rates = rates_per_s(EASY.apd, EASY.amplifier, np.repeat([4800.0, 5000.0, 5400.0], 10_000), np.full(30_000, 1e9))
    assert rates[0] > rates[10_000] > rates[20_000] > 0.0
    to_s = 2e-6 + window_means / rates[20_000 if window_means > 1.0 else 0]
    pixel, first_s = draw_first_crossings(np.cumsum(rates), 2e-6, to_s, np.random.default_rng(8))
    assert np.all(np.diff(pixel) > 0) and first_s.min() >= 2e-6 and first_s.max() < to_s
    # Where they fall in the part of the law before the window's end.
    some = -np.expm1(-rates * (to_s - 2e-6))
    share = -np.expm1(-(first_s - 2e-6) * rates[pixel]) / some[pixel]
    assert stats.kstest(share, "uniform").pvalue > 1e-3
    for group in (slice(10_000), slice(10_000, 20_000), slice(20_000, None)):
        seen = np.isin(np.arange(30_000)[group], pixel).sum()
        assert abs(seen - some[group].sum()) <= 4.0 * math.sqrt((some * (1.0 - some))[group].sum()) + 1e-6


def test_the_second_crossing_of_a_pixel_is_as_far_from_the_first():
    """Gaps in units of the mean are exponential too, cut by the window's end: together they are a Poisson process."""
    pixel, at_s = draw_crossings(np.array([0.0, 1e4, 3e4]), 0.0, 1.0, np.random.default_rng(9))
    assert 0 not in pixel
    for k, rate in ((1, 1e4), (2, 2e4)):
        assert stats.kstest(np.diff(at_s[pixel == k]) * rate, "expon").pvalue > 1e-3


def test_without_noise_nothing_ever_triggers():
    quiet = EASY.replace(amplifier={"noise_electrons": 0.0}, apd={"dark_current_na": 0.0})
    for sunlight in (None, np.zeros(4)):
        pixel, first_s = draw_first_false(
            camera_of(quiet, nothing((1, 4))).comparators, sunlight, np.random.default_rng(8)
        )
        assert len(pixel) == len(first_s) == 0


@pytest.mark.parametrize("brightest", [3e8, 3e9])
def test_sunlit_pixels_trigger_at_their_own_rate(brightest):
    """Thinned from the brightest, or each for itself where crossings are many: as many as the rates say, 4 sigma."""
    part = EASY.replace(defects={"dead_fraction": 0.1, "hot_fraction": 0.1, "hot_dark_current_na": 5.0})
    n, rng, window_s = 4096, np.random.default_rng(10), 2.0 * (EASY.armed_to_m - EASY.armed_from_m) / C
    camera, sunlight = draw_camera_pixels(part, n), brightest * np.linspace(0.0, 1.0, n)
    rates = rates_per_s(part.apd, part.amplifier, 5300.0 * camera.threshold, camera.dark_per_s + sunlight)
    expected = np.where(camera.dead, 0.0, -np.expm1(-rates * window_s))
    seen = np.zeros(n)
    for _ in range(20):
        seen[draw_first_false(camera_of(part, nothing((1, n))).comparators, sunlight, rng)[0]] += 1.0
    assert not seen[camera.dead].any()
    for some in (camera.hot, sunlight < 0.3 * brightest, sunlight > 0.7 * brightest):
        left = 4.0 * math.sqrt(20.0 * (expected * (1.0 - expected))[some].sum())
        assert left > 4.0 and abs(seen[some].sum() - 20.0 * expected[some].sum()) < left


def test_false_triggers_of_an_empty_scene_are_as_many_as_the_rate_says():
    """Bernoulli trials with 1 − exp(−rate · window) sum to Poisson, to 1 %: 4 sigma of the total, 3 of the dispersion."""
    n_frames, window_s = 12, 2.0 * (EASY.armed_to_m - EASY.armed_from_m) / C
    rng = np.random.default_rng(9)
    seen = [detect(nothing((128, 128)), EASY, rng) for _ in range(n_frames)]
    counts = np.array([len(waveforms.pixel) for _, waveforms in seen])
    mean = 16_384 * mean_false_alarms_per_s(EASY) * window_s
    assert mean > 100.0 and mean_false_alarms_per_s(EASY) * window_s < 0.02
    assert abs(counts.sum() - n_frames * mean) < 4.0 * math.sqrt(n_frames * mean)
    # The index of dispersion of n Poisson counts is chi-square over n − 1.
    dispersion = counts.var(ddof=1) / mean * (n_frames - 1)
    assert stats.chi2(n_frames - 1).ppf(0.00135) < dispersion < stats.chi2(n_frames - 1).ppf(0.99865)
    latch_m = np.concatenate([waveforms.latch_s for _, waveforms in seen]) * C / 2.0
    assert latch_m.min() >= EASY.armed_from_m and latch_m.max() <= EASY.armed_to_m
    assert stats.kstest((latch_m - EASY.armed_from_m) / 4999.0, "uniform").pvalue > 1e-3
    # What latched is reported, near its latch: a peak follows within the width of the noise, a few nanoseconds.
    reading, waveforms = seen[0]
    assert np.isfinite(reading.range_m).sum() == len(waveforms.pixel)
    off_m = reading.range_m.ravel()[waveforms.pixel] - waveforms.latch_s * C / 2.0
    assert np.abs(np.median(off_m)) < 1.0


def test_the_armed_window_is_respected():
    part = EASY.replace(armed_from_m=1500.0, armed_to_m=2500.0)
    rng = np.random.default_rng(10)
    latch_s = np.concatenate([detect(nothing((128, 128)), part, rng)[1].latch_s for _ in range(8)])
    assert len(latch_s) > 50
    assert latch_s.min() * C / 2.0 >= 1500.0 and latch_s.max() * C / 2.0 <= 2500.0


def test_rows_of_noise_trigger_as_often_as_dark_pixels_are_said_to():
    """Rows that are simulated step by step, without light, against the formula: 4 sigma of 470 events, 18 %.

    Upcrossings come at Rice's rate (clumps make 3 % of them second ones), and a row begins above with P(x > T).
    """
    part = Gsfl(
        amplifier={"noise_electrons": 1000.0},
        trigger={"threshold_electrons": 3800.0, "threshold_spread_fraction": 0.0},
        armed_from_m=990.0,
        armed_to_m=1010.0,
    )
    photons = returns(np.full(16_384, 1000.0), 1e-6)
    plan, camera = plan_time(part, 8e-9), camera_of(part, photons)
    rows, arming = arm_rows(camera.comparators, place_rows(photons, plan), plan.step_s)
    threshold = np.full(16_384, 3800.0, np.float32)
    rng, seen = np.random.default_rng(11), 0
    for _ in range(10):
        made = simulate_rows(part, photons, rows, rng)
        base = np.full(len(rows.pixel), part.apd.dark_electrons_per_s)
        before, axis = part.readout.pretrigger_samples * plan.steps_per_sample, camera.axis(rows.length)
        latch = latch_rows(camera.comparators, axis, made, threshold, base, arming, before, rng)
        seen += np.count_nonzero(latch >= 0)
    watched_s = float((rows.last - rows.first)[0] - 1) * plan.step_s
    rate = float(
        rates_per_s(part.apd, part.amplifier, np.array([3800.0]), np.array([part.apd.dark_electrons_per_s]))[0]
    )
    expected = 10 * 16_384 * (1.0 - math.exp(-rate * watched_s) + stats.norm.sf(3800.0 / part.noise_electrons))
    assert expected > 300.0
    assert abs(seen - expected) < 4.0 * math.sqrt(expected)


def test_a_watched_pixel_triggers_falsely_at_one_rate_not_two():
    """A little light has all pixels watched for half of the time that they are armed: in it noise triggers them once.

    Each crossing counted twice there would make half as many again. 4 sigma, and 5 % because crossings come in clumps.
    """
    part = Gsfl(
        amplifier={"noise_electrons": 1000.0},
        trigger={"threshold_electrons": 3300.0, "threshold_spread_fraction": 0.0},
        armed_from_m=997.0,
        armed_to_m=1002.0,
    )
    n, frames, rng = 16_384, 6, np.random.default_rng(15)
    photons = returns(np.full(n, 1000.0), 0.01 * part.traits.threshold_photons)
    plan = plan_time(part, 8e-9)
    rows, _ = arm_rows(camera_of(part, photons).comparators, place_rows(photons, plan), plan.step_s)
    armed_s = 2.0 * 5.0 / C
    assert len(rows.pixel) == n
    assert 0.4 < float((rows.last - rows.first)[0]) * plan.step_s / armed_s < 0.7
    dark = np.array([part.apd.dark_electrons_per_s])
    expected = (
        frames * n * -math.expm1(-float(rates_per_s(part.apd, part.amplifier, np.array([3300.0]), dark)[0]) * armed_s)
    )
    seen = sum(len(detect(photons, part, rng)[1].pixel) for _ in range(frames))
    assert expected > 1000.0
    assert abs(seen - expected) < 4.0 * math.sqrt(expected) + 0.05 * expected


def traces(n=4000, **readout):
    part = EASY.replace(readout=readout)
    rng = np.random.default_rng(12)
    threshold = np.full(n, 5300.0)
    crossing_s = 1e-6 + rng.random(n) * 1e-6
    base = np.full(n, part.apd.dark_electrons_per_s)
    amplitude, first = draw_false_traces(part.apd, part.amplifier, part.readout, crossing_s, threshold, base, rng)
    lag_s = (first[:, None] + np.arange(amplitude.shape[1])) * part.readout.sample_s - crossing_s[:, None]
    return part, amplitude, lag_s


def test_what_is_stored_crosses_the_threshold_at_the_latch():
    """Samples every 0.1 τ: the trace passes the threshold upward between the two samples about the crossing."""
    part, amplitude, lag_s = traces(sample_ns=0.1)
    before, after = lag_s[:, 8], lag_s[:, 9]
    assert np.all(before <= 0.0) and np.all(after > 0.0)
    share = before / (before - after)
    at_latch = amplitude[:, 8] + share * (amplitude[:, 9] - amplitude[:, 8])
    # Between samples h apart a straight line is off by h²/8 of the bend, which at T is T/τ² (conditional mean): 6 electrons;
    # the rest of the noise adds about σ (h/τ)^1.5 / 8.
    assert np.abs(at_latch - 5300.0).max() < 40.0
    slope = (amplitude[:, 9] - amplitude[:, 8]) / (after - before) * part.amplifier.pole_s
    # At an upcrossing the slope is Rayleigh with the slope's own sigma, σ/τ (Leadbetter et al. 1983, ch. 10); the chord over
    # h = 0.1 τ has the mean of (1 − |x|) exp(−|x|) of it, 1 − 2h/3τ to first order.
    h = part.readout.sample_s / part.amplifier.pole_s
    rayleigh = part.noise_electrons * math.sqrt(0.5 * math.pi) * (1.0 - 2.0 * h / 3.0 + 0.25 * h**2)
    assert abs(slope.mean() - rayleigh) < 4.0 * slope.std() / math.sqrt(len(slope))


def test_far_from_the_latch_it_is_plain_noise():
    """4 standard errors of mean and rms of 4000 traces; at eight τ the memory of the latch is (1 + 8) exp(−8) = 0.003."""
    part, amplitude, lag_s = traces()
    far = np.abs(lag_s[0]) > 8.0 * part.amplifier.pole_s
    assert far.sum() > 8
    n, sigma = len(amplitude), part.noise_electrons
    for sample in np.flatnonzero(far):
        values = amplitude[:, sample].astype(float)
        assert abs(values.mean()) < 4.0 * sigma / math.sqrt(n) + 0.003 * 5300.0
        assert abs(values.std() / sigma - 1.0) < 4.0 / math.sqrt(2.0 * n)


@pytest.mark.parametrize("path", PATHS)
@pytest.mark.parametrize("phase", [0.0, 1e-4, 0.37, 0.999])
def test_the_law_of_a_trace_is_that_of_noise_given_a_crossing(path, phase):
    """Slepian's regression on value and slope, and the rest's covariance, worked out as matrices; 5 standard errors.

    Mean T r + σ (π/2)^½ s, covariance σ² (R − r rᵀ − s sᵀ + (2 − π/2) s sᵀ), with s = −τ r', whose factor is Rayleigh's.
    """
    n, part = 20_000, EASY
    crossing_s = np.full(n, (500.0 + phase) * part.readout.sample_s)
    base = np.full(n, part.apd.dark_electrons_per_s)
    with computing(path):
        amplitude, first = draw_false_traces(
            part.apd, part.amplifier, part.readout, crossing_s, np.full(n, 5300.0), base, np.random.default_rng(16)
        )
    assert np.all(first == 492)
    lag = (first[0] + np.arange(20)) * part.readout.sample_s - crossing_s[0]
    r, s = part.amplifier.correlation(lag), lag / part.amplifier.pole_s * np.exp(-np.abs(lag) / part.amplifier.pole_s)
    sigma = part.noise_electrons
    between = part.amplifier.correlation(np.subtract.outer(lag, lag))
    covariance = between - np.outer(r, r) + (1.0 - 0.5 * math.pi) * np.outer(s, s)
    mean = 5300.0 / sigma * r + math.sqrt(0.5 * math.pi) * s
    drawn = amplitude.astype(float) / sigma
    rms = np.sqrt(np.maximum(covariance.diagonal(), 0.0))
    assert np.all(np.abs(drawn.mean(axis=0) - mean) < 5.0 * rms / math.sqrt(n) + 1e-6)
    error = np.sqrt((np.outer(rms, rms) ** 2 + covariance**2) / n)
    assert np.all(np.abs(np.cov(drawn.T) - covariance) < 5.0 * error + 1e-6)


def test_both_paths_draw_the_same_traces():
    """Rounding alone: float64, in terms that do not cancel but where samples nearly meet the latch."""
    drawn = []
    for path in PATHS:
        with computing(path):
            drawn += [traces(300), traces(7, samples=256, sample_ns=0.3)]
    for (_, one, _), (_, other, _) in zip(drawn[:2], drawn[2:], strict=True):
        assert one.dtype == other.dtype == np.float32 and one.shape == other.shape
        assert np.abs(one - other).max() < 1e-3
    assert len(continue_noise.dispatcher.signatures) == 1


def test_hot_pixels_fire_more():
    """Hot pixels draw 20 nA: rate and share from the same formula as dark ones; 4 sigma of a binomial."""
    part = EASY.replace(defects={"dead_fraction": 0.0, "hot_fraction": 0.05, "hot_dark_current_na": 20.0})
    camera = draw_camera_pixels(part, 16_384)
    rng, window_s = np.random.default_rng(13), 2.0 * (part.armed_to_m - part.armed_from_m) / C
    fired = np.zeros(16_384)
    for _ in range(6):
        fired[detect(nothing((128, 128)), part, rng)[1].pixel] += 1.0
    hot = camera.hot
    base = np.where(hot, 20.0, 1.0) * EASY.apd.dark_electrons_per_s
    p = -np.expm1(-rates_per_s(part.apd, part.amplifier, 5300.0 * camera.threshold, base) * window_s)
    assert p[hot].mean() > 5.0 * p[~hot].mean()
    for some in (hot, ~hot):
        assert abs(fired[some].sum() - 6.0 * p[some].sum()) < 4.0 * math.sqrt(6.0 * (p[some] * (1.0 - p[some])).sum())


def test_noise_before_the_light_takes_its_place():
    """A pixel that latched on noise misses the return: 1 − exp(−rate · time before it) of them, 4 sigma."""
    n = 16_384
    photons = returns(np.full(n, 4000.0), 1e5)
    reading, _ = detect(photons, EASY, np.random.default_rng(14))
    early = np.count_nonzero(reading.range_m < 3990.0)
    expected = n * mean_false_alarms_per_s(EASY) * 2.0 * (4000.0 - EASY.armed_from_m) / C
    assert expected > 50.0 and abs(early - expected) < 4.0 * math.sqrt(expected)
    assert np.isfinite(reading.range_m).all()


@pytest.mark.parametrize("shape", [(1, 1), (4, 2)])
def test_no_pixels_with_false_triggers_is_no_traces(shape):
    reading, waveforms = detect(nothing(shape), Gsfl(armed_to_m=2.0), np.random.default_rng(0))
    assert waveforms.samples_counts.shape == (0, 20) and np.isnan(reading.range_m).all()


@pytest.mark.parametrize("sunlight", [None, 3e8])
def test_pixels_selected_from_a_camera_trigger_as_they_do_there(sunlight):
    """Each selected several times: the same share of triggers as in its camera, whose rates are not computed again."""
    camera = draw_camera_pixels(EASY, 600)
    chosen = np.repeat(np.argsort(camera.threshold)[:40], 200)
    counted = np.zeros(len(chosen))
    light = None if sunlight is None else np.full(600, sunlight)
    armed = camera_of(EASY, nothing((1, 600))).comparators
    few = None if light is None else light[chosen]
    noisy, _ = draw_first_false(armed.select(chosen), few, np.random.default_rng(1))
    counted[noisy] = 1.0
    base = camera.dark_per_s + (0.0 if sunlight is None else sunlight)
    rates = rates_per_s(EASY.apd, EASY.amplifier, EASY.trigger.threshold_electrons * camera.threshold, base)
    wanted = -np.expm1(-rates[chosen[::200]] * (armed.to_s - armed.from_s))
    share = counted.reshape(40, 200).mean(axis=1)
    assert wanted.max() > 1.5 * wanted.min() or wanted.min() > 0.05
    assert np.mean((share - wanted) ** 2 / np.maximum(wanted * (1.0 - wanted) / 200.0, 1e-4)) < 1.8
