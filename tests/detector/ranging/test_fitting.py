"""The range algorithms against their reference, on traces with noise, clipping, edges and several pulses."""

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from rso_lidar.detector import Pulse, Ranging
from rso_lidar.detector.ranging import location
from rso_lidar.detector.ranging.fitting import fit_all, fit_first
from rso_lidar.detector.ranging.location import Locator, locate, locate_all
from rso_lidar.detector.ranging.matched_filter import Matched
from rso_lidar.detector.ranging.pulse import noise_covariance
from tests.reference.detector import fitting as reference

SAMPLE_S, POLE_S, NOISE = 2.38e-9, 1.0243e-9, 10.0
KNOWN = {"sample_s": SAMPLE_S, "sigma_counts": NOISE, "pole_s": POLE_S, "threshold_counts": 60.0}
STEP_S, SIGMA_S = 0.5e-9, 3.4e-9
POWER = np.exp(-0.5 * (np.arange(-40, 41) * STEP_S / SIGMA_S) ** 2)
PULSE = Pulse.after(STEP_S, POWER / (POWER.sum() * STEP_S), POLE_S, 8.516e-9)
RAIL = 4000.0


def traces(n_traces, n, pulses, seed, sample_s=SAMPLE_S):
    """Return noisy samples of pulses of many heights at places all over the trace, whole counts, clipped at the rail."""
    rng = np.random.default_rng(seed)
    root = np.linalg.cholesky(noise_covariance(n, sample_s, POLE_S, NOISE) + 1e-6 * np.eye(n))
    samples = np.einsum("ij,tj->ti", root, rng.standard_normal((n_traces, n)))
    for _ in range(pulses):
        place = rng.uniform(-2.0, n + 1.0, (n_traces, 1))
        height = 10.0 ** rng.uniform(1.5, 4.3, (n_traces, 1))
        samples += height / PULSE.peak * PULSE.amplitude((np.arange(n) - place) * sample_s + PULSE.peak_s)
    samples = np.minimum(np.rint(samples), RAIL).astype(np.float32)
    return samples, samples >= RAIL


def both(function, *arguments, **settings):
    """Return what a function gives with the reference in the kernels' place, and with the kernels."""
    made = function(*arguments, **settings)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(location, "fit_first_pulses", reference.fit_first_pulses)
        patch.setattr(location, "fit_all_pulses", reference.fit_all_pulses)
        return function(*arguments, **settings), made


def same(one, other):
    """Whole counts add without rounding, so both paths take the same decisions: places to rounding, 1e-12 of a trace."""
    for a, b, scale in zip(one, other, (20.0 * SAMPLE_S, 2e4), strict=True):
        np.testing.assert_allclose(a, b, rtol=0.0, atol=1e-12 * scale)


@pytest.mark.parametrize("algorithm", ["matched_filter", "constant_fraction", "parabola"])
@pytest.mark.parametrize("clips", [False, True])
@pytest.mark.parametrize("n", [8, 20])
def test_the_first_pulse_is_the_same(n, clips, algorithm):
    samples, clipped = traces(2000, n, 1, seed=n)
    assert 100 < clipped.any(axis=1).sum() < 1900
    start = np.random.default_rng(1).integers(0, n, 2000)
    locator = Locator.of(PULSE, Ranging(algorithm=algorithm), **KNOWN)
    same(*both(locate, samples, start, locator, clipped if clips else None))


@pytest.mark.parametrize("clips", [False, True])
@pytest.mark.parametrize(("n", "pulses", "most"), [(20, 2, 8), (84, 5, 3), (20, 0, 2)])
def test_all_pulses_are_the_same(n, pulses, most, clips):
    """The pulses taken away are summed in float32, in both, but what is read of the table may round another way.

    A float32 of 2e4 counts is good to 1e-3: 1e-4 of the noise, which can move a place by so much of its error, 0.1 sample.
    """
    samples, clipped = traces(600, n, pulses, seed=pulses)
    locator = Locator.of(PULSE, Ranging(), **KNOWN)
    (one_s, one), (other_s, other) = both(locate_all, samples, locator, most, clipped if clips else None)
    assert one_s.shape == other_s.shape
    assert pulses == 0 or np.isfinite(one_s).sum() > 600
    alike = (np.isfinite(one_s) == np.isfinite(other_s)).all(axis=1)
    assert alike.mean() > 0.998  # a height may lie on the threshold
    np.testing.assert_allclose(one_s[alike], other_s[alike], rtol=0.0, atol=1e-4 * SAMPLE_S)
    np.testing.assert_allclose(one[alike], other[alike], rtol=1e-4, atol=1e-3 * NOISE)


def test_two_peaks_that_fit_to_one_place_are_one_pulse():
    """A rising edge on the rail behind a pulse: the fits of both come closer than three quarters of the FWHM."""
    samples = [-6, 0, 3, 1, 4, -7, -13, -6, -5, -7, 9, 47, 236, 706, 1360, 1689, 1415, 1067, 1734, 4000]
    samples = np.array([samples], np.float32)
    for delay_s, height in both(
        locate_all, samples, Locator.of(PULSE, Ranging(), **KNOWN), most=8, clipped=samples >= RAIL
    ):
        assert np.isfinite(delay_s).sum() == 1
        matched = Matched.of(PULSE, SAMPLE_S, POLE_S, NOISE)
        assert delay_s[0, 0] / SAMPLE_S + matched.lead == pytest.approx(15.3 + matched.lead, abs=0.5)
        assert height[0, 0] == pytest.approx(1689.0, rel=0.05)


def test_what_is_learnt_at_once_is_all_known(monkeypatch):
    """Threads that learn side by side lose no pattern, and one too many leaves only those that are asked for."""
    matched = Matched(PULSE, SAMPLE_S, POLE_S, 0.003)
    keys = np.arange(1, 65) << 3

    def patterns(keys):
        return (np.asarray(keys)[:, None] >> np.arange(matched.width)) & 1 > 0

    with ThreadPoolExecutor(8) as pool:
        list(pool.map(matched.learn, np.array_split(patterns(keys), 16)))
    known = matched.known()
    assert np.array_equal(known.keys, keys)
    for used, weights in zip(patterns(known.keys), known.weights, strict=True):
        assert np.array_equal(weights, matched.solve_weights(used))
    monkeypatch.setattr("rso_lidar.detector.ranging.matched_filter._MOST_KEPT", 64)
    assert np.array_equal(matched.learn(patterns(keys[:5])).keys, keys)
    assert np.array_equal(matched.learn(patterns(np.r_[keys[:5], 1])).keys, np.r_[1, keys[:5]])
    samples, clipped = traces(400, 20, 1, seed=5)
    whole = locate(samples, np.full(400, 8), Locator.of(PULSE, Ranging(), **KNOWN), clipped)
    monkeypatch.setattr("rso_lidar.detector.ranging.matched_filter._MOST_KEPT", 4)
    few = locate(samples, np.full(400, 8), Locator.of(PULSE, Ranging(), **KNOWN), clipped)
    assert np.array_equal(whole[0], few[0])


def test_patterns_are_learnt_once_and_do_not_depend_on_the_order():
    samples, clipped = traces(400, 20, 1, seed=5)
    start = np.full(400, 8)
    locator = Locator.of(PULSE, Ranging(), **KNOWN)
    whole, matched = locate(samples, start, locator, clipped), locator.matched
    patterns = len(matched.known().keys)
    parts = [locate(samples[k], start[k], locator, clipped[k]) for k in np.array_split(np.arange(400)[::-1], 7)]
    assert len(matched.known().keys) == patterns > 10
    for i in (0, 1):
        assert np.array_equal(whole[i][::-1], np.concatenate([part[i] for part in parts]))


def test_no_traces():
    none = np.zeros((0, 20), np.float32)
    for found in both(locate, none, np.zeros(0, int), Locator.of(PULSE, Ranging(), **KNOWN)):
        assert all(part.shape == (0,) for part in found)
    for found in both(locate_all, none, Locator.of(PULSE, Ranging(), **KNOWN), most=3):
        assert all(len(part) == 0 for part in found)


def test_each_loop_compiles_once():
    samples, clipped = traces(10, 20, 2, seed=6)
    for mask in (None, clipped):
        locate(samples, np.full(10, 8), Locator.of(PULSE, Ranging(), **KNOWN), clipped=mask)
        locate_all(samples, Locator.of(PULSE, Ranging(), **KNOWN), most=2, clipped=mask)
    assert len(fit_first.dispatcher.signatures) == len(fit_all.dispatcher.signatures) == 1


@pytest.mark.parametrize("clips", [False, True])
def test_a_window_of_more_samples_than_an_integer_has_bits(clips):
    """A clock nine times as fast: 65 samples in the window, whose patterns go by random words; the same as above."""
    fast = Locator.of(PULSE, Ranging(), **{**KNOWN, "sample_s": SAMPLE_S / 9.0})
    samples, clipped = traces(150, 150, 1, 7, SAMPLE_S / 9.0)
    assert fast.matched.width > 63
    start = np.random.default_rng(1).integers(0, 150, 150)
    (one_s, one), (other_s, other) = both(locate, samples, start, fast, clipped if clips else None)
    np.testing.assert_allclose(one_s, other_s, rtol=0.0, atol=1e-9 * SAMPLE_S)
    np.testing.assert_allclose(one, other, rtol=1e-9, atol=1e-6)
