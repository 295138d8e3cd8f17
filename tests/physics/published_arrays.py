"""Published figures of linear-mode arrays of avalanche photodiodes, and the full detector set to them.

The numbers are facts that were read for this comparison; no text or file of the sources is copied. Each table says where
its numbers stand, and which parameters of the detector were free.
"""

from functools import cache

import numpy as np
from scipy.interpolate import CubicSpline

import rso_lidar as rl
from rso_lidar import units
from rso_lidar.detector import Apd, make_plate, make_point_returns, run_trial
from rso_lidar.detector.chain.camera import camera_of
from rso_lidar.detector.chain.full import store_waveforms

CM_PER_S = units.RANGE_PER_DELAY_M_S / units.CM
LASER = rl.Laser()

# ------------------------------------------------------------------------ an early flash ladar: error of the highest cell
#
# S. P. Jordan, "Range estimation algorithm comparison in 3-D flash ladar data", AFIT/GE/ENG/09-22 (2009), sec. 5.3.1,
# read as text of that section: rms range error of measured pixels, averaged, by the highest cell and by the peak of a
# cubic spline. Cells of 1.876 ns and 20 cells are those of papers on the same camera. The section states no pulse
# length, no light and no spread of the time origins. All three are free here; the pulse is the default of 8 ns.

CELL_NS, CELLS = 1.876, 20
JORDAN_RAW_CM = {121: 20.53, 500: 21.95}  # by the number of pixels
JORDAN_SPLINE_CM = {121: 16.08, 500: 17.55}
JORDAN_T0_NS = 0.93  # free: spread of the time origins, for the spline of 121 pixels with 5,000 photons
JORDAN_PHOTONS = {121: 5000.0, 500: 2800.0}  # the first is assumed; the second is free: the larger region was dimmer


def cell_errors_cm(photons, *, is_ideal=False, droop=None, t0_ns=JORDAN_T0_NS, n=4096):
    """Return rms range errors [cm] of the highest cell and of the peak of a cubic spline through the cells.

    Parameters
    ----------
    photons : on each of `n` pixels
    is_ideal : whether amplifier noise, jitter and maps are off.
    droop : of the bias, by the `n` pixels together
    t0_ns : spread of the time origins, 1 sigma [ns]
    """
    side, delay_ns = round(n**0.5), (30.0 - 2.8) / units.RANGE_PER_DELAY_M_S / units.NS
    settings = {"gate": {"delay_ns": delay_ns, "width_ns": CELLS * CELL_NS}, "droop": droop}
    detector = rl.Gsfl(**settings, readout={"sample_ns": CELL_NS, "samples": CELLS}, maps={"t0_spread_ns": t0_ns})
    if is_ideal:
        detector = rl.Gsfl(
            **settings, readout={"sample_ns": CELL_NS, "samples": CELLS, "quantised": False},
            apd=Apd(dark_current_na=0.0, statistics="gaussian"), amplifier={"noise_electrons": 1e-3},
        )  # fmt: skip
    places = 30.0 + np.modf(np.arange(n) * 0.618_034)[0] * CELL_NS * units.NS * units.RANGE_PER_DELAY_M_S
    light = make_point_returns(
        (side, side), LASER.pulse, LASER.pulse_fwhm_s, np.arange(n), places, np.full(n, photons), np.inf
    )
    camera, rng = camera_of(detector, light), np.random.default_rng(3)
    stored, _ = store_waveforms(camera, light, rng)
    counts, index = stored.samples_counts, np.arange(stored.samples_counts.shape[1])
    fine = np.arange(0.0, len(index) - 1.0, 0.02)
    found = counts.argmax(axis=1), fine[CubicSpline(index, counts, axis=1)(fine).argmax(axis=1)]
    own_s = camera.processor.pixels.t0_s + (0.0 if is_ideal else detector.timing.pixel_jitter_ns * units.NS) * (
        rng.standard_normal(n)
    )
    errors = [stored.start_s + cells * stored.sample_s + own_s - light.delay_s - camera.pulse.peak_s for cells in found]
    return [CM_PER_S * float(np.sqrt(np.mean(error**2))) for error in errors]


# -------------------------------------------------------------------------- Pixell: precision over counts, and detection
#
# LeddarTech, Pixell user guide 54A0049 7.0 EN, pages 19, 23 and 24, read as text: precision of 0.6 cm "at amplitude
# counts greater than 60", below that the curve of a radar equation over the amplitude (figure 7, whose values cannot be
# read); detection "SNR 9.8 dB, > 90 % probability of detection, and 0.0001 false alarm rate"; electronic crosstalk 40 dB
# below the aggressor in the next pixel and 60 dB at the fourth. Pulse, clock and photons of a count are not stated. Free
# are the floor (a jitter), the noise of a sample and the photons of a count; pulse and clock are the defaults.

PIXELL_FLOOR_CM, PIXELL_COUNTS = 0.6, 60.0
PIXELL_SNR_DB, PIXELL_DETECTED, PIXELL_FALSE = 9.8, 0.9, 1e-4
PIXELL_NOISE_COUNTS = 0.2  # free: 5 % more than the floor at 60 counts
PIXELL_PHOTONS_PER_COUNT = 10_000.0  # free: so many that shot noise is below the floor at 60 counts


@cache
def pixell():
    """Return the camera: a gate, a floor of range noise, and a converter of many photons in a count."""
    per_count = PIXELL_PHOTONS_PER_COUNT * 8.0 * camera_of(rl.Gsfl(), plate(1.0, 1)).pulse.peak
    return rl.Gsfl(
        gate={"delay_ns": 640.0, "width_ns": 47.6, "false_alarm_probability": PIXELL_FALSE},
        apd=Apd(dark_current_na=0.0, statistics="gaussian"),
        amplifier={"noise_electrons": PIXELL_NOISE_COUNTS * per_count},
        readout={"electrons_per_count": per_count, "quantised": False},
        timing={"pixel_jitter_ns": PIXELL_FLOOR_CM / (CM_PER_S * units.NS)},
    )


def plate(photons, n):
    """Return the light of a plate in the gate of the camera."""
    return make_plate(photons, n, LASER.pulse, LASER.pulse_fwhm_s, 97.0)


def pixell_trial(counts, n=4000):
    """Return what the camera makes of returns whose peak has so many counts."""
    return run_trial(pixell(), plate(counts * PIXELL_PHOTONS_PER_COUNT, n), np.random.default_rng(1))


# ------------------------------------------------------------------------------------------- TigerCub: words of a report
#
# ASC TigerCub, as the public import scripts of the repository hdnate08/flash_lidar read its .SEQ files: words of 32 bits,
# 12 of them intensity and 20 of them range in 1/64 foot. Fuller et al., sec. 3.3: 20 samples; introduction: 5 km.

FOOT_M = 0.3048
TIGERCUB_QUANTUM_M = FOOT_M / 64.0
TIGERCUB_RANGE_BITS, TIGERCUB_INTENSITY_BITS, TIGERCUB_SAMPLES = 20, 12, 20
