"""The bench: a plate before every pixel, and the tally of what became of it."""

import numpy as np
import pytest

from rso_lidar.detector import Empirical, Gsfl, Trial, make_plate, run_trial
from rso_lidar.detector.bench.calibration import make_reference_pulse

C = 299_792_458.0


def test_a_plate_lights_every_pixel_at_all_phases_of_the_clock():
    photons = make_plate(500.0, 1000, make_reference_pulse(), 8e-9, range_m=2000.0)
    range_m = photons.delay_s * C / 2.0
    assert photons.shape == (1, 1000) and np.array_equal(photons.pixel, np.arange(1000))
    assert range_m.min() >= 2000.0 and range_m.max() < 2001.0
    # Multiples of the golden ratio leave no gap much wider than their number's share, at most 1.9 / n here (Steinhaus).
    phase = np.sort(np.mod(photons.delay_s / 2.38e-9, 1.0))
    assert np.diff(phase).max() < 0.01
    assert np.all(photons.photons == 500.0) and not photons.depth_spread_s.any()
    ramp = make_plate(np.arange(4.0), 4, make_reference_pulse(), 8e-9, range_m=np.arange(4.0) * 100.0)
    assert ramp.photons.tolist() == [0.0, 1.0, 2.0, 3.0]
    assert np.floor(ramp.delay_s * C / 2.0 / 100.0).tolist() == [0.0, 1.0, 2.0, 3.0]


def test_the_pulse_of_the_reference_state():
    """Area 1, 8 ns full width at half maximum, centred."""
    step_s, power = make_reference_pulse()
    assert power.sum() * step_s == pytest.approx(1.0, rel=1e-12)
    above = np.flatnonzero(power >= 0.5 * power.max())
    assert (above[-1] - above[0]) * step_s == pytest.approx(8e-9, rel=0.03)
    assert len(power) % 2 == 1 and power.argmax() == len(power) // 2


def test_a_trial_tells_shares_bias_and_noise():
    rng = np.random.default_rng(1)
    errors = rng.normal(0.3, 0.05, 20_000)
    one = Trial(np.arange(40_000) % 2 == 0, errors, np.full(20_000, 7))
    assert one.probability == 0.5
    # 4 standard errors; a quartile of n normal values is known to 1.36 σ/√n, half their distance to 1.17 σ/√n.
    assert one.range_bias_m == pytest.approx(0.3, abs=4.0 * 0.05 / np.sqrt(20_000))
    assert one.range_noise_m == pytest.approx(0.05, rel=4.0 * 1.17 / np.sqrt(20_000))
    stray = Trial(one.detected, np.append(errors, [4.9] * 20), one.intensity_counts)
    assert stray.range_noise_m == pytest.approx(one.range_noise_m, rel=0.01)


def test_nothing_reported_is_told_as_such():
    none = Trial(np.zeros(5, bool), np.zeros(0), np.zeros(0))
    assert none.probability == 0.0 and np.isnan(none.range_bias_m) and np.isnan(none.range_noise_m)
    assert np.isnan(Trial(np.ones(1, bool), np.zeros(1), np.ones(1)).range_noise_m)


@pytest.mark.parametrize("part", [Gsfl(), Empirical()], ids=["gsfl", "empirical"])
def test_both_detectors_stand_the_trial(part):
    """A bright plate is seen by all, a dark one by none but noise, and false triggers far from it do not count."""
    rng = np.random.default_rng(2)
    bright = run_trial(part, make_plate(20_000.0, 2000, make_reference_pulse(), 8e-9), rng)
    assert bright.probability > 0.99 and abs(bright.range_bias_m) < 0.01
    assert len(bright.range_error_m) == len(bright.intensity_counts) == bright.detected.sum()
    dark = run_trial(part, make_plate(0.0, 2000, make_reference_pulse(), 8e-9), rng)
    assert dark.probability < 0.005
