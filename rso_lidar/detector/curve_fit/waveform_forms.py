"""Closed forms of what raw samples of a pixel tell: noise, pulse, and the variance of its area over the mean."""

from __future__ import annotations

import math

import numpy as np

from rso_lidar import units
from rso_lidar.detector.curve_fit.measured_curve import MeasuredCurve
from rso_lidar.detector.ranging.pulse import LaserPulse, Pulse
from rso_lidar.detector.settings.apd import cumulants
from rso_lidar.detector.settings.gsfl import Gsfl

_ROUNDING_VARIANCE = 1.0 / 12.0  # of a count


def predict_waveform(detector: Gsfl, pulse: LaserPulse, curve: MeasuredCurve, photons_scale: float) -> np.ndarray:
    """Return the expected values (point) of a statistic of raw samples.

    A primary electron leaves the avalanche as n electrons and adds the area n T / g to a shot, T being the integration time
    and g the electrons in a count. So the mean area of N photons is QE N E[n] T / g, and its variance is QE N E[n²] (T / g)²
    above that of the noise: the slope of one over the other is M F T / g.

    Parameters
    ----------
    detector : the detector
    pulse : the laser's pulse
    curve : the statistic, with the light and the length of the shots
    photons_scale : true over stated photons
    """
    readout, amplifier = detector.readout, detector.amplifier
    same = np.ones(len(curve.value))
    noise2 = (detector.noise_electrons / readout.electrons_per_count) ** 2
    rounding2 = _ROUNDING_VARIANCE if readout.quantised else 0.0
    if curve.quantity == "baseline":
        return same * readout.baseline_counts
    if curve.quantity == "sample_noise":
        return same * math.sqrt(noise2 + rounding2)
    if curve.quantity == "noise_correlation":
        share = noise2 / max(noise2 + rounding2, 1e-300)
        return same * share * float(amplifier.correlation(np.array(curve.sample_s)))
    if curve.quantity == "clip_level":
        rail = math.inf if detector.saturation is None else detector.saturation.rail_electrons
        return same * min(
            float(readout.full_scale_counts), readout.baseline_counts + rail / readout.electrons_per_count
        )
    if curve.quantity == "pulse_width":
        return same * Pulse.after(pulse.step_s, pulse.power_per_s, amplifier.pole_s, amplifier.integration_s).fwhm_s
    primaries = detector.quantum_efficiency * curve.photons * photons_scale
    first, second, _ = cumulants(detector.apd)
    ns_per_electron = amplifier.integration_ns / readout.electrons_per_count
    if curve.quantity == "pulse_area":
        return primaries * first * ns_per_electron
    sample_ns, n = curve.sample_s / units.NS, curve.samples
    lag = np.arange(1 - n, n)
    noise = noise2 * float(((n - np.abs(lag)) * amplifier.correlation(lag * curve.sample_s)).sum()) + n * rounding2
    variance: np.ndarray = primaries * second * ns_per_electron**2 + noise * sample_ns**2
    return variance
