"""Curves over light and the photons of a detection: against exact laws, curves that are settings, and other trials."""

import math

import numpy as np
import pytest

import rso_lidar as rl
from rso_lidar.detector import (
    Defects,
    DetectorTraits,
    Gsfl,
    LaserPulse,
    estimate_detection_photons,
    simulate_light_curve,
)
from rso_lidar.detector.bench.trial import make_plate, run_trial
from rso_lidar.errors import ScenarioError

LASER = rl.Laser(pulse_fwhm_ns=5.0)
PULSE = LaserPulse(*LASER.pulse, LASER.pulse_fwhm_s)
WANTED = np.array([0.5, 0.9, 0.95, 0.99])


class FirstPhoton:
    """A counter without noise: it reports a return of one photon or more, with a jitter of 3 cm and an offset of 1 cm."""

    traits = DetectorTraits(sees_to_m=2000.0, threshold_photons=1.0)

    def detect(self, photons, rng):
        hit = rng.poisson(photons.photons) > 0
        range_m = np.full(photons.shape[1], np.nan)
        jitter_m = 0.01 + 0.03 * rng.standard_normal(len(hit))
        range_m[photons.pixel[hit]] = (photons.delay_s * rl.units.RANGE_PER_DELAY_M_S + jitter_m)[hit]
        counts = np.where(np.isfinite(range_m), 100, 0)
        planes = (values.reshape(photons.shape) for values in (range_m, counts, np.zeros(len(counts), bool)))
        return rl.records.Reading(*planes), None


def test_photons_by_trials_are_those_of_an_exact_law():
    """P = 1 − exp(−N): N = −ln(1 − P). The intervals are of 95 %; three times as wide, they hold all four."""
    found = estimate_detection_photons(FirstPhoton(), PULSE, WANTED)
    exact = -np.log1p(-WANTED)
    assert found.how == "33 x 4,000 trials"
    assert (np.abs(found.photons - exact) < 1.5 * (found.high - found.low)).all()
    assert found.photons == pytest.approx(exact, rel=0.06)


@pytest.mark.parametrize("detector", [Gsfl(), rl.Empirical()], ids=["gsfl", "empirical"])
def test_photons_of_the_closed_form_are_detected_as_often(detector):
    """By trials at another range with other draws: 4 sigma of the binomial law, and the 0.01 of the closed form."""
    found = estimate_detection_photons(detector, PULSE, WANTED)
    assert (found.low < found.high).all()
    assert (np.abs(found.photons - 0.5 * (found.low + found.high)) < 0.03 * found.photons).all()
    n = 4000
    for photons, probability in zip(found.photons, WANTED, strict=True):
        light = make_plate(photons, n, LASER.pulse, LASER.pulse_fwhm_s, 900.0)
        share = run_trial(detector, light, np.random.default_rng(11)).probability
        assert abs(share - probability) < 0.01 + 4.0 * math.sqrt(probability * (1.0 - probability) / n)


def test_what_the_closed_form_leaves_out_is_tried():
    """Of 5 % dead pixels nothing is detected in more than 95 %; the light of 50 % is that of 52.6 % of the others."""
    broken = Gsfl(defects=Defects(dead_fraction=0.05, hot_fraction=0.0))
    found = estimate_detection_photons(broken, PULSE, np.array([0.5, 0.99]))
    whole = estimate_detection_photons(Gsfl(), PULSE, np.array([0.5 / 0.95]))
    assert found.photons[0] == pytest.approx(whole.photons[0], rel=0.02)
    assert np.isinf(found.photons[1]) and found.how.endswith("trials")


def test_a_curve_is_that_of_its_detector():
    """Offset and jitter of `FirstPhoton`, and the settings of the empirical detector, within 4 standard errors."""
    curve = simulate_light_curve(FirstPhoton(), PULSE, np.array([5.0, 1.0]), trials=2000)
    assert curve.photons.tolist() == [1.0, 5.0] and curve.trials == 2000
    assert (np.abs(curve.range_bias_m - 0.01) < 4.0 * curve.range_bias_error_m).all()
    assert (np.abs(curve.range_sigma_m - 0.03) < 4.0 * curve.range_sigma_error_m).all()
    assert np.isnan(curve.closed_form_probability).all() and np.isnan(curve.snr).all()
    empirical = rl.Empirical()
    curve = simulate_light_curve(empirical, PULSE, np.array([800.0, 3000.0]))
    sigma_m = empirical.range_noise_m(curve.photons, LASER.pulse_fwhm_s)
    assert (np.abs(curve.range_sigma_m - sigma_m) < 4.0 * curve.range_sigma_error_m).all()
    assert curve.intensity_counts[1] == pytest.approx(float(empirical.counts(np.array(3000.0))), rel=0.01)


def test_the_jitter_of_the_laser_is_in_the_scatter():
    jittery = PULSE._replace(timing_jitter_ns=2.0)  # 30 cm
    quiet, loud = (simulate_light_curve(Gsfl(), pulse, np.array([5000.0])) for pulse in (PULSE, jittery))
    added_m = math.sqrt(loud.range_sigma_m[0] ** 2 - quiet.range_sigma_m[0] ** 2)
    assert added_m == pytest.approx(2e-9 * rl.units.RANGE_PER_DELAY_M_S, rel=4.0 * 1.166 / math.sqrt(4000))


def test_too_little_light_has_a_detection_and_no_range():
    curve = simulate_light_curve(Gsfl(), PULSE, np.array([1.0]), trials=100)
    assert curve.detected_fraction[0] == 0.0 and 0.0 < curve.detected_high[0] < 0.05
    assert np.isnan(curve.range_sigma_m[0]) and np.isnan(curve.intensity_counts[0])


@pytest.mark.parametrize(
    ("call", "says"),
    [
        (lambda: simulate_light_curve(Gsfl(), PULSE, np.array([])), "photons: a light curve needs at least one"),
        (lambda: simulate_light_curve(Gsfl(), PULSE, np.array([np.nan])), "photons: a light curve needs at least one"),
        (lambda: simulate_light_curve(Gsfl(), PULSE, np.array([1.0]), trials=3), "trials: 3 leave no interval"),
        (lambda: estimate_detection_photons(Gsfl(), PULSE, np.array([1.0])), "never or always reached"),
    ],
)
def test_what_cannot_be_tried_is_one_line(call, says):
    with pytest.raises(ScenarioError, match=says) as caught:
        call()
    assert "\n" not in str(caught.value)
