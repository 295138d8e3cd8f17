"""The prediction of every pixel against the chain, which detects one light many times with other noise."""

import dataclasses

import numpy as np
import pytest

import rso_lidar as rl
from rso_lidar.detector import detect, predict_pixels
from rso_lidar.errors import ScenarioError
from tests.detector.returns_for_tests import RANGE_PER_DELAY_M_S, returns

N = 128
FWHM_M = 8e-9 * RANGE_PER_DELAY_M_S  # depth of a pulse
GATE = {"delay_ns": 6000.0, "width_ns": 90.0, "pulses": 4}
DETECTORS = {  # detector, photons of a return that half of all flashes detect, sunlight, probability that is systematic
    "gsfl": (rl.Gsfl(), 780.0, 0.0, 0.01),
    "sunlit": (rl.Gsfl(), 780.0, 1.2e11, 0.01),
    "gated": (rl.Gsfl(gate=GATE), 160.0, 0.0, 0.02),
    "strongest": (rl.Gsfl(gate=GATE, returns="strongest"), 160.0, 0.0, 0.02),
    "leading edge": (rl.Gsfl(ranging={"algorithm": "leading_edge"}), 780.0, 0.0, 0.01),
    "camera": (rl.Gsfl(maps={}, defects={"dead_fraction": 0.2}, speckle={}, saturation={}), 780.0, 0.0, 0.0),
    "coupled": (rl.Gsfl(droop={}, crosstalk={}, bloom={}), 780.0, 0.0, 0.0),
    "empirical": (rl.Empirical(), 700.0, 0.0, 0.002),
    "geiger": (rl.GeigerArray(gate_from_m=895.0, gate_to_m=915.0), 0.25, 0.0, 0.0),
}
TILTED, DOUBLE = np.arange(N) % 4 == 1, np.arange(N) % 4 == 3


def make_light(unit, sunlight=0.0):
    """Return light of facing, tilted and double pixels from 0.4 to 8 units, and the range of what is labelled [m]."""
    k = np.arange(N)
    level = unit * 0.4 * 20.0 ** ((k * 0.618034) % 1.0)
    first_m = 903.0 + (k * 0.754878) % 1.0
    pixel, cluster, range_m, photons = [], [], [], []
    count, true_m, apart_m = 0, first_m.copy(), np.full(N, np.inf)
    for at in range(N):
        depths_m = np.linspace(-0.5, 0.5, 9) * FWHM_M if TILTED[at] else np.zeros(1)
        clusters = [(first_m[at], level[at])]
        if DOUBLE[at]:  # the nearer one dimmer, at 1.5 to 6 m
            apart_m[at] = 1.5 + 4.5 * ((at * 0.569840) % 1.0)
            clusters.append((first_m[at] + apart_m[at], level[at] * (1.5 + at % 3)))
            true_m[at] += apart_m[at]
        for middle_m, light in clusters:
            pixel += [at] * len(depths_m)
            cluster += [count] * len(depths_m)
            range_m += (middle_m + depths_m).tolist()
            photons += [light / len(depths_m)] * len(depths_m)
            count += 1
    light = returns(range_m, np.array(photons), pixel, (1, N), cluster)
    if sunlight:
        light = dataclasses.replace(light, background_photons_per_s=np.full((1, N), sunlight))
    return light, true_m, apart_m


def repeat(light, detector, true_m, apart_m, draws):
    """Return errors (draw, pixel) [m] of the reports of what is labelled, NaN where there is none."""
    errors = []
    for k in range(draws):
        reading, _ = detect(light, detector, np.random.Generator(np.random.Philox(10_000 + k)))
        errors.append(reading.range_m[0].astype(float) - true_m)
    errors = np.array(errors)
    with np.errstate(invalid="ignore"):
        return np.where((errors < 5.5) & (errors > -np.minimum(5.5, 0.5 * apart_m)), errors, np.nan)


@pytest.mark.parametrize(
    "kind", [pytest.param(kind, marks=pytest.mark.slow if kind == "sunlit" else ()) for kind in DETECTORS]
)
def test_pixels_report_as_often_and_as_precisely_as_predicted(kind):
    """By kind of light, with the errors of binomial numbers and of a variance of normal draws."""
    detector, unit, sunlight, systematic = DETECTORS[kind]
    light, true_m, apart_m = make_light(unit, sunlight)
    draws = 48
    told = predict_pixels(light, detector)
    probability, sigma_m = (values[0].astype(float) for values in (told.detection_probability, told.range_sigma_m))
    errors = repeat(light, detector, true_m, apart_m, draws)
    count = np.isfinite(errors).sum(axis=0)
    share = count / draws
    spread = np.maximum(0.25 * (probability + share) * (2.0 - probability - share), 1e-3)
    # What is tried has up to 32 draws of its own; the rest has a systematic error.
    variance = spread * (1.0 / draws + 1.0 / 32.0) + systematic**2
    if kind in ("gsfl", "sunlit", "gated", "leading edge", "empirical"):
        variance[~DOUBLE] = (spread / draws + systematic**2)[~DOUBLE]
    assert np.mean((probability - share) ** 2 / variance) < 1.5
    for some in (TILTED, DOUBLE, ~TILTED & ~DOUBLE):
        error = np.sqrt(variance[some].sum()) / some.sum()
        assert abs((probability - share)[some].mean()) < 4.0 * error + systematic
    with np.errstate(invalid="ignore"):
        errors[np.abs(errors) > 8.0 * sigma_m] = np.nan  # noise that triggers a pixel shortly before its light does
        count = np.isfinite(errors).sum(axis=0)
        mean_m = np.nansum(errors, axis=0) / np.maximum(count, 1)
    squares = np.nansum((errors - mean_m) ** 2, axis=0)
    for some, tolerance in ((~TILTED & ~DOUBLE, 0.04), (TILTED, 0.05), (DOUBLE & (apart_m > 3.0), 0.12)):
        of = some & (count > 10)
        ratio = np.sqrt((squares[of] / sigma_m[of] ** 2).sum() / (count[of] - 1).sum())
        assert ratio == pytest.approx(1.0, abs=tolerance + 4.0 / np.sqrt(2.0 * (count[of] - 1).sum()))


def test_a_range_that_is_given_says_which_cluster_is_there():
    light = returns([900.0, 900.0 + 30.0], np.array([3000.0, 5000.0]), [0, 0], (1, 2), [0, 1])
    near = predict_pixels(light, rl.Empirical(), np.array([[900.2, np.nan]]))
    far = predict_pixels(light, rl.Empirical())
    assert near.detection_probability[0, 0] > 0.99 and far.detection_probability[0, 0] < 0.01
    assert far.range_sigma_m[0, 0] < near.range_sigma_m[0, 0]
    assert not near.detection_probability[0, 1] and np.isnan(near.range_sigma_m[0, 1])
    nothing = predict_pixels(light, rl.Gsfl(), np.full((1, 2), np.nan))
    assert not nothing.detection_probability.any() and np.isnan(nothing.range_sigma_m).all()


def test_a_late_pulse_is_not_taken_for_an_error():
    """The laser's own delay moves reports and clusters alike, here by 30 m."""
    light = dataclasses.replace(returns([900.0] * 8, 3000.0), late_s=2e-7)
    for detector in (rl.Gsfl(), rl.Gsfl(speckle={}), rl.Empirical()):
        told = predict_pixels(light, detector, np.full((1, 8), 900.0))
        assert (told.detection_probability > 0.9).all()


def test_jitter_of_a_frame_and_of_pixels_is_in_every_deviation():
    """By the table, and where pixels are tried alone because of fixed patterns."""
    light = returns([900.0] * 32, 60_000.0)
    jitter = rl.Gsfl(timing={"frame_jitter_ns": 2.0, "pixel_jitter_ns": 1.0})
    wanted_m = np.hypot(2.0, 1.0) * 1e-9 * RANGE_PER_DELAY_M_S
    for detector in (jitter, jitter.replace(maps=rl.detector.Maps())):
        sigma_m = predict_pixels(light, detector).range_sigma_m
        assert np.sqrt((sigma_m**2).mean()) == pytest.approx(wanted_m, rel=0.04)


def test_the_depth_of_a_single_return_counts():
    """As that of nine returns over the same depth does, half a pulse length and more."""
    depth_m = 1.2 * FWHM_M
    whole = returns([900.0] * 8, 1500.0)
    whole = dataclasses.replace(whole, depth_spread_s=np.full(8, depth_m / RANGE_PER_DELAY_M_S))
    apart_m = 900.0 + np.linspace(-0.5, 0.5, 9) * depth_m * 8.0 / 9.0
    pieces = returns(np.tile(apart_m, 8), 1500.0 / 9.0, np.repeat(np.arange(8), 9), (1, 8), np.repeat(np.arange(8), 9))
    one, two = (predict_pixels(light, rl.Gsfl()) for light in (whole, pieces))
    flat = predict_pixels(returns([900.0] * 8, 1500.0), rl.Gsfl())
    np.testing.assert_allclose(one.range_sigma_m, two.range_sigma_m, rtol=0.08)
    assert (one.range_sigma_m > 1.2 * flat.range_sigma_m).all()


def test_a_users_detector_is_repeated():
    class Coin:
        """Reports half of all pixels, with a scatter of 0.2 m."""

        traits = rl.detector.DetectorTraits(sees_to_m=2000.0, threshold_photons=1.0)

        def detect(self, photons, rng):
            range_m = photons.delay_s * RANGE_PER_DELAY_M_S + 0.2 * rng.standard_normal(len(photons.pixel))
            range_m = np.where(rng.random(len(range_m)) < 0.5, range_m, np.nan).reshape(photons.shape)
            reading = rl.records.Reading(range_m, np.ones(photons.shape), np.zeros(photons.shape))
            return reading, None

    light = returns(np.linspace(800.0, 900.0, 64), 5.0)
    told = predict_pixels(light, Coin(), draws=200)
    assert told.detection_probability.mean() == pytest.approx(0.5, abs=4.0 * 0.5 / np.sqrt(64 * 200))
    np.testing.assert_allclose(told.range_sigma_m, 0.2, rtol=0.25)
    with pytest.raises(ScenarioError, match="draws: 1"):
        predict_pixels(light, Coin(), draws=1)


def test_the_prediction_is_the_same_every_time():
    light, _, _ = make_light(780.0)
    for detector in (rl.Gsfl(), rl.Gsfl(speckle={})):
        one, two = (predict_pixels(light, detector) for _ in range(2))
        np.testing.assert_array_equal(one.detection_probability, two.detection_probability)
        np.testing.assert_array_equal(one.range_sigma_m, two.range_sigma_m)


def test_scatter_of_few_trials_agrees_with_the_table():
    detector, unit, _, _ = DETECTORS["gsfl"]
    light, true_m, _ = make_light(unit)
    table, trials = (predict_pixels(light, detector, true_m[None], by_table=by_table) for by_table in (True, False))
    assert np.array_equal(table.detection_probability, trials.detection_probability)
    often = table.detection_probability[0] > 0.5
    ratio = (trials.range_sigma_m / table.range_sigma_m)[0, often]
    # Of 60 pixels with an error of 12 % each, correlated over 25 neighbours, the mean has one of 4 %; the table has 3 %.
    assert often.sum() > 50 and abs(np.median(ratio) - 1.0) < 0.15
    assert np.quantile(np.abs(ratio - 1.0), 0.9) < 0.35
    assert not np.array_equal(table.range_sigma_m[0, often], trials.range_sigma_m[0, often])
