import math

import numpy as np
import pytest
from scipy import stats

from rso_lidar import units
from rso_lidar.detector import Pulse, Ranging
from rso_lidar.detector.ranging.location import Locator, locate, locate_all
from rso_lidar.detector.ranging.matched_filter import Matched
from rso_lidar.detector.ranging.pulse import crlb_s, noise_covariance
from rso_lidar.detector.ranging.range_walk import correct_walk, tabulate_walk
from rso_lidar.errors import ScenarioError
from tests.reference.detector import fitting

FWHM_S = 8e-9
SIGMA_S = FWHM_S / (2 * math.sqrt(2 * math.log(2)))
POLE_S = 1.0243e-9  # two poles, 100 MHz to -3 dB
NO_POLE_S = 1e-13
SAMPLE_S = 2.38e-9
N = 20
NOISE = 10.0  # counts
ALGORITHMS = ["matched_filter", "centroid", "parabola", "constant_fraction", "leading_edge"]


def pulse_behind(pole_s=POLE_S, fwhm_s=FWHM_S, step_s=0.5e-9):
    sigma_s = fwhm_s / (2 * math.sqrt(2 * math.log(2)))
    n = 2 * math.ceil(5.5 * sigma_s / step_s) + 1
    power = np.exp(-0.5 * ((np.arange(n) - (n - 1) / 2) * step_s / sigma_s) ** 2)
    return Pulse.after(step_s, power / (power.sum() * step_s), pole_s, 8.516e-9)


PULSE = pulse_behind()


def traces(delay_s, amplitude, pulse=PULSE, sample_s=SAMPLE_S, n=N):
    """Return samples without noise of pulses with these delays and peak amplitudes."""
    time_s = np.arange(n) * sample_s - np.asarray(delay_s, float)[:, None]
    return np.asarray(amplitude, float).reshape(-1, 1) / pulse.peak * pulse.amplitude(time_s)


def noisy(samples, rng, pole_s=POLE_S, sigma=NOISE, sample_s=SAMPLE_S):
    root = np.linalg.cholesky(noise_covariance(samples.shape[1], sample_s, pole_s, sigma))
    return (samples + rng.standard_normal(samples.shape) @ root.T).astype(np.float32)


def known(pole_s=POLE_S, sigma=NOISE, threshold=50.0, sample_s=SAMPLE_S):
    return {"sample_s": sample_s, "sigma_counts": sigma, "pole_s": pole_s, "threshold_counts": threshold}


def trials(snr, algorithm, pole_s, n_trials=6000, seed=1):
    """Return errors [cm] of one pulse in N samples at all phases, and the amplitudes over the true one."""
    rng = np.random.default_rng(seed)
    pulse = pulse_behind(pole_s)
    peak = 10 + rng.uniform(-0.5, 0.5, n_trials)
    delay_s = peak * SAMPLE_S - pulse.peak_s
    clean = traces(delay_s, np.full(n_trials, snr * NOISE), pulse)
    start = (clean >= 0.6 * snr * NOISE).argmax(axis=1)
    found_s, amplitude = locate(
        noisy(clean, rng, pole_s),
        start,
        Locator.of(pulse, Ranging(algorithm=algorithm), **known(pole_s, threshold=0.6 * snr * NOISE)),
    )
    return (found_s - delay_s) * units.RANGE_PER_DELAY_M_S / units.CM, amplitude / (snr * NOISE)


def sigma_bounds(error, confidence=0.9999):
    """Return where the standard deviation lies, from the scatter of its sample, tails as they are (Kenney and Keeping)."""
    n, kurtosis = len(error), stats.kurtosis(error, fisher=False)
    half = stats.norm.ppf(0.5 + 0.5 * confidence) * math.sqrt((kurtosis - 1) / (4 * n))
    return error.std() * (1 - half), error.std() * (1 + half)


# ---------------------------------------------------------------------------------------------------- the part


def test_the_part_and_its_limits():
    assert Ranging().algorithm == "matched_filter" and not Ranging().walk_correction
    for wrong in ({"algorithm": "magic"}, {"fraction": 0.0}, {"fraction": 1.0}, {"fraction": "half"}, {"walk": True}):
        with pytest.raises(ScenarioError):
            Ranging(**wrong)


# ---------------------------------------------------------------------------------------------------- one return

# 20 cells, 8 ns, 2.38 ns, white noise: an independent Monte Carlo of 20 000 trials, given to 0.1 cm [cm].
PRECISION_CM = {
    "matched_filter": {5: 9.3, 10: 4.6, 20: 2.3, 50: 0.9, 100: 0.46},
    "centroid": {5: 12.4, 10: 6.7, 20: 4.4, 50: 3.6, 100: 3.4},
    "parabola": {5: 16.7, 10: 8.7, 20: 4.4, 50: 1.8, 100: 1.0},
    "constant_fraction": {5: 17.1, 10: 8.7, 20: 4.4, 50: 2.1, 100: 1.5},
}


@pytest.mark.parametrize(
    ("algorithm", "snr"), [(a, snr) for a in PRECISION_CM for snr in (10, 20, 50, 100)] + [("matched_filter", 5)]
)
def test_precision_in_white_noise_is_that_of_the_independent_trials(algorithm, snr):
    error, _ = trials(snr, algorithm, NO_POLE_S)
    low, high = sigma_bounds(error)
    rounding = 0.05 if snr < 100 or algorithm != "matched_filter" else 0.005
    given = PRECISION_CM[algorithm][snr]
    others = 3.9 * given / math.sqrt(2 * 20_000)  # the scatter of the other trials, at the same 99.99 %
    assert low - rounding - others <= given <= high + rounding + others


def test_at_low_signal_the_other_algorithms_keep_their_order():
    # At an SNR of 5 what counts as the peak differs between implementations: 5 % on the table.
    spread = {algorithm: trials(5, algorithm, NO_POLE_S)[0].std() for algorithm in PRECISION_CM}
    assert spread["matched_filter"] < spread["centroid"] < spread["parabola"] <= 1.05 * spread["constant_fraction"]
    for algorithm, value in spread.items():
        assert value == pytest.approx(PRECISION_CM[algorithm][5], rel=0.05)


@pytest.mark.parametrize("pole_s", [NO_POLE_S, POLE_S])
@pytest.mark.parametrize("snr", [7, 10, 20, 50])
def test_the_matched_filter_is_within_a_tenth_of_the_bound(pole_s, snr):
    error, height = trials(snr, "matched_filter", pole_s, seed=2)
    covariance = noise_covariance(N, SAMPLE_S, pole_s, NOISE)
    pulse = pulse_behind(pole_s)
    phases = (np.arange(8) - 3.5) / 8
    bound_s = math.sqrt(np.mean([crlb_s(pulse, snr * NOISE, SAMPLE_S, covariance, p) ** 2 for p in phases]))
    bound_cm = bound_s * units.RANGE_PER_DELAY_M_S / units.CM
    low, high = sigma_bounds(error)
    assert low <= 1.1 * bound_cm
    assert high >= bound_cm  # nothing unbiased is better than the bound
    assert abs(error.mean()) < 3.9 * error.std() / math.sqrt(len(error))  # 99.99 %
    assert height.mean() == pytest.approx(1.0, abs=0.25 / snr**2 + 3.9 * height.std() / math.sqrt(len(height)))


@pytest.mark.parametrize("pole_s", [NO_POLE_S, POLE_S])
@pytest.mark.parametrize(
    ("algorithm", "worst_mm", "mean_mm"),
    [
        ("matched_filter", 0.05, 0.01),
        # A window of whole samples: the centroid's floor is 3.4 cm rms, evenly spread over phases.
        ("centroid", 3.4 * math.sqrt(3) * 10 * 1.1, 1.0),
        # A parabola is no Gaussian: its vertex is pulled to the sample by up to 1 % of the distance of samples.
        ("parabola", 0.03 * SAMPLE_S * units.RANGE_PER_DELAY_M_S / units.MM, 1.0),
    ],
)
def test_without_noise_the_bias_is_only_the_algorithm_s_own(algorithm, worst_mm, mean_mm, pole_s):
    pulse = pulse_behind(pole_s)
    delay_s = (7 + np.arange(512) / 128) * SAMPLE_S
    found_s, height = locate(
        traces(delay_s, np.full(512, 1000.0), pulse),
        np.full(512, 6),
        Locator.of(pulse, Ranging(algorithm=algorithm), **known(pole_s)),
    )
    error_mm = (found_s - delay_s) * units.RANGE_PER_DELAY_M_S / units.MM
    assert np.abs(error_mm).max() < worst_mm
    assert abs(error_mm.mean()) < mean_mm
    assert np.allclose(height, 1000.0, rtol=1e-5)


def test_constant_fraction_is_early_by_what_straight_lines_between_samples_make():
    # -1.6 cm at half maximum, 8 ns, 2.38 ns: the independent trials' bias, whatever the amplitude.
    pulse = pulse_behind(NO_POLE_S)
    delay_s = (9 + np.arange(256) / 256) * SAMPLE_S
    for amplitude in (100.0, 3000.0):
        found_s, _ = locate(
            traces(delay_s, np.full(256, amplitude), pulse),
            np.full(256, 8),
            Locator.of(pulse, Ranging(algorithm="constant_fraction"), **known(NO_POLE_S)),
        )
        bias_cm = (found_s - delay_s).mean() * units.RANGE_PER_DELAY_M_S / units.CM
        assert bias_cm == pytest.approx(-1.6, abs=0.05)


@pytest.mark.parametrize(("pole_s", "fwhm_s", "n"), [(POLE_S, 4e-9, 20), (NO_POLE_S, 6e-9, 16), (3e-9, 20e-9, 60)])
def test_other_pulses_and_amplifiers_are_ranged_at_their_bound_too(pole_s, fwhm_s, n):
    rng = np.random.default_rng(3)
    pulse = pulse_behind(pole_s, fwhm_s, fwhm_s / 16)
    peak = 0.5 * n + rng.uniform(-0.5, 0.5, 4000)
    delay_s = peak * SAMPLE_S - pulse.peak_s
    clean = traces(delay_s, np.full(4000, 200.0), pulse, n=n)
    start = (clean >= 120.0).argmax(axis=1)
    found_s, _ = locate(
        noisy(clean, rng, pole_s), start, Locator.of(pulse, Ranging(), **known(pole_s, threshold=120.0))
    )
    error = found_s - delay_s
    covariance = noise_covariance(n, SAMPLE_S, pole_s, NOISE)
    bound_s = math.sqrt(
        np.mean([crlb_s(pulse, 200.0, SAMPLE_S, covariance, p) ** 2 for p in (-0.375, -0.125, 0.125, 0.375)])
    )
    assert sigma_bounds(error)[0] < 1.1 * bound_s
    assert abs(error.mean()) < 3.9 * error.std() / math.sqrt(4000)


def test_a_second_pulse_does_not_draw_the_first():
    delay_s = (5 + np.arange(64) / 64) * SAMPLE_S
    second = traces(delay_s + 2 * PULSE.fwhm_s, np.full(64, 1000.0), n=26)
    samples = traces(delay_s, np.full(64, 1000.0), n=26) + second
    found_s, _ = locate(samples, np.full(64, 4), Locator.of(PULSE, Ranging(), **known()))
    # The neighbour's rise reaches into the window, where the template is almost nothing: 2 % of a FWHM.
    assert np.abs(found_s - delay_s).max() < 0.02 * PULSE.fwhm_s


def test_the_first_peak_after_the_latch_is_the_one():
    delay_s = np.array([5.2, 5.2, 5.2]) * SAMPLE_S
    samples = traces(delay_s, [300.0] * 3, n=30) + traces(delay_s + 4 * PULSE.fwhm_s, [900.0] * 3, n=30)
    found_s, height = locate(samples, np.array([4, 6, 15]), Locator.of(PULSE, Ranging(), **known()))
    assert np.allclose(height, [300.0, 300.0, 900.0], rtol=1e-3)
    assert (found_s[2] - found_s[0]) / PULSE.fwhm_s == pytest.approx(4.0, abs=0.01)


@pytest.mark.parametrize("overdrive", [1.2, 2, 5, 20])
def test_clipped_samples_are_left_out_of_the_fit(overdrive):
    rng = np.random.default_rng(4)
    full_scale = 4000.0
    delay_s = (8 + rng.uniform(0, 1, 1000)) * SAMPLE_S
    samples = noisy(traces(delay_s, np.full(1000, overdrive * full_scale)), rng, sigma=5.0)
    samples = np.rint(np.minimum(samples, full_scale))
    clipped = samples >= full_scale
    start = (samples >= 80).argmax(axis=1)
    found_s, height = locate(
        samples, start, Locator.of(PULSE, Ranging(), **known(sigma=5.0, threshold=80.0)), clipped=clipped
    )
    blind_s, _ = locate(samples, start, Locator.of(PULSE, Ranging(), **known(sigma=5.0, threshold=80.0)))
    error_mm = (found_s - delay_s) * units.RANGE_PER_DELAY_M_S / units.MM
    # What is left of the pulse stands at an SNR of hundreds: below a millimetre and a per cent.
    assert error_mm.std() < 1.0 and abs(error_mm.mean()) < 0.1
    assert np.allclose(height, overdrive * full_scale, rtol=0.02)
    assert (blind_s - delay_s).std() > 3 * (found_s - delay_s).std()


def test_a_pulse_that_is_all_rail_still_has_a_place():
    samples = np.minimum(traces([9 * SAMPLE_S], [4e7]), 4000.0)
    for algorithm in ALGORITHMS:
        found_s, height = locate(
            samples,
            np.array([3]),
            Locator.of(PULSE, Ranging(algorithm=algorithm), **known()),
            clipped=samples >= 4000.0,
        )
        assert np.isfinite(height).all() and np.isfinite(found_s).all()
        assert abs(found_s[0] - 9 * SAMPLE_S) < 3 * PULSE.fwhm_s


@pytest.mark.parametrize("algorithm", ALGORITHMS)
def test_odd_traces_are_no_error(algorithm):
    ranging = Ranging(algorithm=algorithm)
    empty = locate(np.zeros((0, N), np.float32), np.zeros(0, int), Locator.of(PULSE, ranging, **known()))
    assert empty[0].shape == empty[1].shape == (0,)
    rng = np.random.default_rng(5)
    odd = np.zeros((6, N), np.float32)
    odd[1] = -7.0
    odd[2, 0] = odd[3, -1] = odd[4, 9] = 500.0
    odd[5] = rng.standard_normal(N) * NOISE
    for start in (0, 8, N - 1, N + 3):
        delay_s, height = locate(odd, np.full(6, start), Locator.of(PULSE, ranging, **known()), clipped=odd > 400.0)
        assert delay_s.shape == height.shape == (6,)
        seen = np.isfinite(delay_s)
        assert np.all(np.abs(delay_s[seen]) < 2 * N * SAMPLE_S)
        assert np.isfinite(height).all()
    if algorithm in ("constant_fraction", "leading_edge"):
        # A pulse that is high in the first sample has no crossing in the window.
        falling = traces([-1 * SAMPLE_S], [500.0])
        assert np.isnan(locate(falling, np.array([0]), Locator.of(PULSE, ranging, **known()))[0][0])


def test_traces_do_not_know_of_each_other():
    rng = np.random.default_rng(6)
    samples = noisy(traces((7 + rng.uniform(0, 2, 300)) * SAMPLE_S, rng.uniform(80, 900, 300)), rng)
    start = np.full(300, 8)
    together = locate(samples, start, Locator.of(PULSE, Ranging(), **known()))
    parts = [
        locate(samples[k], start[k], Locator.of(PULSE, Ranging(), **known())) for k in np.array_split(np.arange(300), 7)
    ]
    for i in (0, 1):
        assert np.array_equal(together[i], np.concatenate([part[i] for part in parts]))


# ---------------------------------------------------------------------------------------------------- several returns


@pytest.mark.parametrize("algorithm", ALGORITHMS[:4])
@pytest.mark.parametrize("apart", [1.5, 2.0, 3.0])
def test_two_equal_pulses_are_two_returns(apart, algorithm):
    first_s = (6 + np.arange(64) / 64) * SAMPLE_S
    second_s = first_s + apart * PULSE.fwhm_s
    samples = traces(first_s, np.full(64, 800.0), n=28) + traces(second_s, np.full(64, 800.0), n=28)
    found_s, height = locate_all(samples, Locator.of(PULSE, Ranging(algorithm=algorithm), **known()), most=4)
    assert found_s.shape == height.shape == (64, 2)
    within = 0.01 if algorithm == "matched_filter" else 0.1
    assert np.abs(found_s[:, 0] - first_s).max() < within * PULSE.fwhm_s
    assert np.abs(found_s[:, 1] - second_s).max() < within * PULSE.fwhm_s
    assert np.allclose(height[:, :2], 800.0, rtol=0.01)


def test_two_pulses_in_noise_are_found_and_not_drawn_together():
    rng = np.random.default_rng(7)
    first_s = (6 + rng.uniform(0, 1, 1500)) * SAMPLE_S
    second_s = first_s + 1.5 * PULSE.fwhm_s
    clean = traces(first_s, np.full(1500, 200.0), n=24) + traces(second_s, np.full(1500, 200.0), n=24)
    found_s, _ = locate_all(noisy(clean, rng), Locator.of(PULSE, Ranging(), **known()), most=3)
    both = np.isfinite(found_s[:, 1])
    assert both.mean() > 0.99
    for k, true_s in enumerate((first_s, second_s)):
        error = (found_s[both, k] - true_s[both]) / PULSE.fwhm_s
        assert np.mean(np.abs(error) < 0.1) > 0.99
        assert abs(error.mean()) < 3.9 * error.std() / math.sqrt(both.sum()) + 1e-3


def test_a_strong_pulse_casts_no_false_returns():
    rng = np.random.default_rng(8)
    delay_s = (8 + rng.uniform(0, 1, 800)) * SAMPLE_S
    for amplitude in (500.0, 20_000.0):
        samples = noisy(traces(delay_s, np.full(800, amplitude), n=30), rng)
        found_s, height = locate_all(samples, Locator.of(PULSE, Ranging(), **known(threshold=60.0)), most=4)
        assert np.array_equal(np.isfinite(found_s).sum(axis=1), np.ones(800))
        assert np.array_equal(np.isfinite(found_s), height > 0)


@pytest.mark.parametrize("spread", [0.5, 1.0, 2.0, 4.0])
def test_a_tilted_surface_is_one_return_however_long(spread):
    rng = np.random.default_rng(11)
    offsets = (np.arange(64) - 31.5) / 64 * spread * PULSE.fwhm_s
    delay_s = (14 + rng.uniform(0, 1, 400)) * SAMPLE_S
    clean = sum(traces(delay_s + offset, np.full(400, 1.0), n=36) for offset in offsets)
    samples = noisy(clean * (300.0 / clean.max()), rng)
    found_s, _ = locate_all(samples, Locator.of(PULSE, Ranging(), **known()), most=3)
    assert np.isfinite(found_s[:, 0]).all()
    assert np.isfinite(found_s[:, 1:]).sum() < 0.01 * len(found_s)
    assert np.abs(found_s[:, 0] - delay_s).max() < (0.5 * spread + 0.1) * PULSE.fwhm_s


def test_returns_come_near_to_far_and_no_more_than_asked_for():
    places_s = np.array([6.3, 16.1, 26.8]) * SAMPLE_S
    samples = sum(traces([p], [a], n=40) for p, a in zip(places_s, (200.0, 900.0, 400.0), strict=True))
    for algorithm in ALGORITHMS[:4]:
        found_s, height = locate_all(samples, Locator.of(PULSE, Ranging(algorithm=algorithm), **known()), most=5)
        assert np.allclose(found_s[0, :3], places_s, atol=0.1 * PULSE.fwhm_s)
        assert np.allclose(height[0, :3], [200.0, 900.0, 400.0], rtol=0.01)
        assert np.isnan(found_s[0, 3:]).all()
    strongest_s, strongest = locate_all(samples, Locator.of(PULSE, Ranging(), **known()), most=2)
    assert np.allclose(strongest, [[900.0, 400.0]], rtol=0.01)
    assert np.allclose(strongest_s, [places_s[1:]], atol=1e-11)


def test_a_clipped_pulse_among_others_keeps_its_height():
    places_s = np.array([6.3, 17.1]) * SAMPLE_S
    samples = np.minimum(traces([places_s[0]], [9000.0], n=30) + traces([places_s[1]], [400.0], n=30), 4000.0)
    found_s, height = locate_all(samples, Locator.of(PULSE, Ranging(), **known()), most=2, clipped=samples >= 4000.0)
    assert np.allclose(found_s, [places_s], atol=0.02 * PULSE.fwhm_s)
    assert np.allclose(height, [[9000.0, 400.0]], rtol=0.05)


def test_no_traces_and_no_pulses_are_no_returns():
    for samples in (np.zeros((0, N), np.float32), np.zeros((3, N), np.float32)):
        found_s, height = locate_all(samples, Locator.of(PULSE, Ranging(), **known()), most=2)
        assert found_s.shape == height.shape == (len(samples), 1) and np.isnan(found_s).all() and np.all(height == 0)


# ---------------------------------------------------------------------------------------------------- the statistic


def test_the_statistic_is_the_amplitude_where_the_pulse_is():
    samples = traces([9 * SAMPLE_S - PULSE.peak_s], [700.0])
    statistic = fitting.statistic(Matched.of(PULSE, SAMPLE_S, POLE_S, math.inf), samples)
    assert statistic.shape == samples.shape
    assert statistic[0].argmax() == 9 and statistic[0, 9] == pytest.approx(700.0, rel=1e-5)


def test_its_noise_is_what_the_bound_of_the_amplitude_says():
    # White noise: the matched filter's gain over a single sample is sqrt(sum s^2) = sqrt(sqrt(pi) s / dt) = 1.59.
    rng = np.random.default_rng(9)
    white = rng.standard_normal((4000, 40)).astype(np.float32) * NOISE
    statistic = fitting.statistic(Matched.of(pulse_behind(NO_POLE_S), SAMPLE_S, NO_POLE_S, math.inf), white)
    gain = NOISE / statistic[:, 20].std()
    assert gain == pytest.approx(1.59, abs=0.005 + 1.59 * 3.9 / math.sqrt(2 * 4000))


@pytest.mark.parametrize("pole_s", [NO_POLE_S, POLE_S])
def test_noise_makes_as_many_false_returns_as_rice_says(pole_s):
    rng = np.random.default_rng(10)
    n, n_traces, u = 30, 20_000, 2.8
    pulse = pulse_behind(pole_s)
    samples = noisy(np.zeros((n_traces, n)), rng, pole_s)
    matched = Matched.of(pulse, SAMPLE_S, pole_s, math.inf)
    statistic, crossings_per_s = fitting.statistic(matched, samples), matched.crossings_per_s
    sigma = statistic[:, 10:20].std()
    found_s, _ = locate_all(samples, Locator.of(pulse, Ranging(), **known(pole_s, threshold=u * sigma)), most=4)
    inside = (found_s + pulse.peak_s > 6 * SAMPLE_S) & (found_s + pulse.peak_s < 24 * SAMPLE_S)
    # Rice (1944): nu_0 exp(-u^2/2) upcrossings a second; each is a peak, but two within one FWHM are one return.
    expected = n_traces * 18 * SAMPLE_S * crossings_per_s * math.exp(-0.5 * u**2)
    scatter = 3.9 * math.sqrt(expected)
    assert 0.95 * expected - scatter < inside.sum() < expected + scatter


# ---------------------------------------------------------------------------------------------------- walk


def test_the_leading_edge_walks_with_amplitude_as_a_gaussian_does():
    # -s sqrt(2 ln(A/T)) from the peak, 8 ns: the walk in cm of an ideal comparator.
    walk_cm = {1.05: -15.9, 1.5: -46, 2: -60, 5: -91, 10: -109, 50: -142, 100: -155}
    pulse, sample_s, threshold = pulse_behind(NO_POLE_S), 0.25e-9, 40.0
    ranging = Ranging(algorithm="leading_edge")
    for ratio, expected_cm in walk_cm.items():
        samples = traces([20e-9], [ratio * threshold], pulse, sample_s, 160)
        start = (samples >= threshold).argmax(axis=1)
        settings = known(NO_POLE_S, threshold=threshold, sample_s=sample_s)
        found_s, _ = locate(samples, start, Locator.of(pulse, ranging, **settings))
        error_cm = (found_s[0] - 20e-9) * units.RANGE_PER_DELAY_M_S / units.CM
        # Reckoned from the crossing of a pulse of twice the threshold; figures given to a centimetre.
        assert error_cm - SIGMA_S * math.sqrt(2 * math.log(2)) * units.RANGE_PER_DELAY_M_S / units.CM == pytest.approx(
            expected_cm, abs=0.55 if ratio != 1.05 else 0.1
        )


@pytest.mark.parametrize(("algorithm", "worst_cm"), [("leading_edge", 1.0), ("constant_fraction", 1.0)])
def test_the_calibration_takes_the_walk_away(algorithm, worst_cm):
    ranging, full_scale = Ranging(algorithm=algorithm), 4000.0
    settings = known(sigma=5.0, threshold=40.0)
    table = tabulate_walk(Locator.of(PULSE, ranging, **settings), full_scale_counts=full_scale)
    assert np.all(np.diff(table[0]) > 0) and table[0][0] < 45.0 and table[0][-1] > 7900.0
    delay_s = (9 + (np.arange(64) + 0.3) / 64) * SAMPLE_S
    walk_cm, left_cm = [], []
    for amplitude in np.geomspace(1.1 * 40, 190 * 40, 23):
        samples = np.minimum(traces(delay_s, np.full(64, amplitude), n=24), full_scale)
        clipped = samples >= full_scale
        start = (samples >= 40.0).argmax(axis=1)
        found_s, height = locate(samples, start, Locator.of(PULSE, ranging, **settings), clipped=clipped)
        for store, value_s in ((walk_cm, found_s), (left_cm, correct_walk(found_s, height, table))):
            store.append((value_s - delay_s).mean() * units.RANGE_PER_DELAY_M_S / units.CM)
    assert np.ptp(walk_cm) > (150 if algorithm == "leading_edge" else 20)
    assert np.abs(left_cm).max() < worst_cm


def test_the_matched_filter_does_not_walk():
    table = tabulate_walk(Locator.of(PULSE, Ranging(), **known(sigma=5.0, threshold=40.0)), full_scale_counts=4000.0)
    assert np.abs(table[1]).max() * units.RANGE_PER_DELAY_M_S < 1e-3


def test_a_far_overdriven_calibration_still_rises():
    for algorithm in ALGORITHMS:
        amplitudes, bias_s = tabulate_walk(
            Locator.of(PULSE, Ranging(algorithm=algorithm), **known(threshold=2000.0)), full_scale_counts=4000.0
        )
        assert np.all(np.diff(amplitudes) > 0) and np.isfinite(bias_s).all()
        shape = (3, 2)
        assert correct_walk(np.zeros(shape), np.zeros(shape), (amplitudes, bias_s)).shape == shape


def test_correction_keeps_what_is_missing_missing():
    table = (np.array([10.0, 100.0]), np.array([1e-9, -1e-9]))
    delay_s = np.array([[5e-9, np.nan]])
    corrected = correct_walk(delay_s, np.array([[math.sqrt(1000.0), 0.0]]), table)
    assert corrected[0, 0] == pytest.approx(5e-9) and np.isnan(corrected[0, 1])
