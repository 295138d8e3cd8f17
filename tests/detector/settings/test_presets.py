"""The shipped constants: what the parts stand on, and what the calibration script makes again."""

import math

import numpy as np
import pytest

from rso_lidar.detector import DETECTOR_PRESETS, Amplifier, Empirical, Gsfl, Trigger
from rso_lidar.detector.bench import calibration

FITTED = DETECTOR_PRESETS["empirical"]


def test_defaults_are_the_shipped_constants():
    assert Amplifier().noise_electrons == DETECTOR_PRESETS["noise_limited"]["noise_electrons"]
    assert Trigger().threshold_electrons == DETECTOR_PRESETS["noise_limited"]["threshold_electrons"]
    part = Empirical()
    assert {name: getattr(part, name) for name in FITTED} == FITTED
    assert set(DETECTOR_PRESETS) == {"noise_limited", "offset_limited", "empirical"}


def test_the_script_writes_what_is_shipped():
    """Names and digits of the tables; the values are another test's."""
    table = calibration._format_table("noise_limited", {"noise_electrons": 1018.0449, "threshold_electrons": 6112.346})
    assert table == "[noise_limited]\nnoise_electrons = 1018.0\nthreshold_electrons = 6112.3\n"


@pytest.mark.parametrize(("preset", "noise"), [("noise_limited", None), ("offset_limited", 300.0)])
def test_solving_again_gives_the_shipped_threshold(preset, noise):
    """A twelfth of the script's flashes: the 5 % quantile of n peaks is known to √(0.0475/n) over their density there.

    4 standard errors of it, and the rounding to five digits; noise is a sixth of the threshold.
    """
    repeats = 2
    found, threshold = calibration.solve_preset(noise, repeats)
    shipped = DETECTOR_PRESETS[preset]
    gsfl = Gsfl(preset=preset)
    peaks = calibration.simulate_peaks(gsfl, 1)
    low, high = np.quantile(peaks, [0.03, 0.07])
    error = math.sqrt(0.0475 / (repeats * calibration._PIXELS)) * (high - low) / 0.04
    assert abs(threshold - shipped["threshold_electrons"]) < 4.0 * error + 0.5
    assert abs(found - shipped["noise_electrons"]) < 4.0 * error / 6.0 + 0.5
    assert error < 0.003 * threshold  # so that the test can fail


def test_fitting_again_gives_the_shipped_curves(monkeypatch):
    """A quarter of the script's pixels: curves, not coefficients, within the statistics of both fits.

    Detection: 4 binomial sigma of 8,192 pixels where it is steepest, 0.022. Range noise by quartiles: 4 · 1.17/√8192, 5 %.
    Counts: the mean of thousands, 0.5 %; their scatter 4/√(2 · 8192), 3 %. Each with half as much again, for what the fit
    makes of neighbours.
    """
    monkeypatch.setattr(calibration, "_PIXELS", 4096)
    again = Empirical(**calibration.fit_empirical(Gsfl()))
    shipped = Empirical()
    photons = np.array([600.0, 700.0, 800.0, 900.0, 1000.0, 1200.0])
    assert again.detection_probability(photons) == pytest.approx(shipped.detection_probability(photons), abs=0.033)
    bright = np.array([1000.0, 2000.0, 4000.0, 10_000.0])
    assert again.range_noise_m(bright, 8e-9) == pytest.approx(shipped.range_noise_m(bright, 8e-9), rel=0.075)
    counts = np.array([1000.0, 10_000.0, 60_000.0, 1e6])
    assert again.counts(counts) == pytest.approx(shipped.counts(counts), rel=0.0075)
    # exp(−T²/2σ²), T/σ = 6, of constants that are written to five digits, 5e-5 each: 36 · 7e-5.
    assert again.false_alarms_per_s == pytest.approx(shipped.false_alarms_per_s, rel=2.5e-3)
    assert again.range_plateau_m == pytest.approx(shipped.range_plateau_m, rel=1e-4)
