"""The closed forms of the detectors: what jitter, depth and few photons do to range, against other formulas."""

import math

import numpy as np
import pytest

from rso_lidar import units
from rso_lidar.detector import Empirical, Gsfl, LaserPulse, predict
from tests.detector.returns_for_tests import bell

FWHM_S = 8e-9
TAPS = bell(FWHM_S)
PULSE = LaserPulse(TAPS["pulse_step_s"], TAPS["pulse_power_per_s"], FWHM_S)
GATE = {"delay_ns": 6000.0, "width_ns": 90.0, "pulses": 9}


@pytest.mark.parametrize(("gate", "pulses"), [(None, 1), (GATE, 9)])
def test_the_three_jitters_add_in_squares_and_average_out_over_the_pulses_of_a_gate(gate, pulses):
    jitter = {"pixel_jitter_ns": 0.9, "frame_jitter_ns": 1.2}
    still = {"pixel_jitter_ns": 0.0, "frame_jitter_ns": 0.0}
    photons = np.array([900.0, 4000.0])
    quiet = predict(Gsfl(gate=gate, timing=still), PULSE, photons, 0.0).range_precision_m
    shaken = predict(
        Gsfl(gate=gate, timing=jitter), PULSE._replace(timing_jitter_ns=2.0), photons, 0.0
    ).range_precision_m
    added_m = 2.5e-9 * units.RANGE_PER_DELAY_M_S / math.sqrt(pulses)  # 0.9² + 1.2² + 2.0² = 2.5²
    assert np.sqrt(shaken**2 - quiet**2) == pytest.approx([added_m, added_m], rel=1e-9)


def test_a_report_of_hardly_any_light_is_from_anywhere_within_the_stretched_pulse():
    """Even over its length, with the standard deviation of a rectangle, also where that of the fit is far more."""
    still = Gsfl(timing={"pixel_jitter_ns": 0.0})
    told = predict(still, PULSE, np.full(2, 1e-3), np.array([0.0, 2.0 * FWHM_S]))
    length_m = np.array([FWHM_S, 3.0 * FWHM_S]) * units.RANGE_PER_DELAY_M_S
    assert told.range_precision_m == pytest.approx(length_m / math.sqrt(12.0), rel=1e-9)


def test_the_error_of_range_falls_with_the_light_in_the_noise_of_the_amplifier_and_with_its_root_in_its_own():
    """Ten times the light: ten times as precise where the amplifier decides, √10 times where the light's own noise does."""
    still = Gsfl(timing={"pixel_jitter_ns": 0.0}, readout={"quantised": False})
    loud = still.replace(amplifier=still.amplifier.replace(noise_electrons=1e3 * still.amplifier.noise_electrons))
    quiet = still.replace(
        amplifier=still.amplifier.replace(noise_electrons=1e-3), apd=still.apd.replace(dark_current_na=0.0)
    )
    for gsfl, photons, ratio in ((loud, 1e6, 10.0), (quiet, 1e3, math.sqrt(10.0))):
        told = predict(gsfl, PULSE, np.array([photons, 10.0 * photons]), 0.0).range_precision_m
        assert told[0] / told[1] == pytest.approx(ratio, rel=0.01)


def test_the_jitter_of_the_laser_adds_in_squares_to_an_empirical_error_and_its_counts_are_clipped_at_full_scale():
    part = Empirical()
    photons = np.array([700.0, 0.99 * part.saturation_photons, 1.01 * part.saturation_photons])
    quiet, shaken = (predict(part, PULSE._replace(timing_jitter_ns=ns), photons, 0.0) for ns in (0.0, 0.5))
    added_m = 0.5e-9 * units.RANGE_PER_DELAY_M_S
    assert np.sqrt(shaken.range_precision_m**2 - quiet.range_precision_m**2) == pytest.approx([added_m] * 3, rel=1e-9)
    assert quiet.range_precision_m == pytest.approx(part.range_noise_m(photons, FWHM_S), rel=1e-12)
    assert quiet.saturated.tolist() == [False, False, True]
