"""Cameras that tests invent, the curves that a laboratory would measure of them, and the fits that find them again."""

from dataclasses import dataclass, field

import numpy as np

from rso_lidar import units
from rso_lidar.detector import (
    Empirical,
    GeigerArray,
    Gsfl,
    LaserPulse,
    MeasuredCurve,
    detect,
    fit_constants,
    make_point_returns,
)
from rso_lidar.detector.curve_fit.free_constants import set_constants
from rso_lidar.detector.curve_fit.measured_curve import simulate_levels


def make_pulse(fwhm_ns):
    """Return a Gaussian pulse of the laser."""
    step_s = fwhm_ns * units.NS / 48.0
    power = np.exp(-np.log(2.0) * (np.arange(-177, 178) / 24.0) ** 2)
    return LaserPulse(step_s, power / (power.sum() * step_s), fwhm_ns * units.NS)


@dataclass(frozen=True)
class Invented:
    """A camera as its data sheet has it, the constants that are hidden in it, and the bench that measures it."""

    sheet: object
    hidden: dict
    pulse: LaserPulse
    photons: tuple
    quantities: tuple
    range_m: float = 20.0
    dark_s: float = 0.0  # armed time without light
    start: dict = field(default_factory=dict)


CAMERAS = {
    # 64 x 64 silicon pixels at 850 nm, which no preset describes.
    "silicon": Invented(
        Gsfl(
            quantum_efficiency=0.7,
            apd={"gain": 80.0, "ionisation_ratio": 0.02, "dark_current_na": 0.05},
            amplifier={"noise_electrons": 1000.0, "bandwidth_mhz": 150.0},
            trigger={"threshold_electrons": 9000.0},
            readout={"sample_ns": 1.5},
        ),
        {"amplifier.noise_electrons": 1600.0, "trigger.threshold_electrons": 12_000.0, "timing.pixel_jitter_ns": 0.15},
        make_pulse(5.0),
        tuple(np.geomspace(130.0, 3000.0, 12)),
        ("detection_rate", "range_scatter"),
    ),
    "curves": Invented(
        Empirical(false_alarms_per_s=100.0),
        {
            "reference_photons": 420.0,
            "noise_equivalent_photons": 60.0,
            "counts_per_photon": 0.11,
            "compression_counts": 2500.0,
            "range_plateau_m": 0.021,
            "false_alarms_per_s": 450.0,
        },
        make_pulse(6.0),
        tuple(np.geomspace(150.0, 30_000.0, 14)),
        ("detection_rate", "range_scatter", "counts_mean"),
        dark_s=4.0,
        start={"reference_photons": 700.0},
    ),
    "geiger": Invented(
        GeigerArray(least_counts=6, peak_ns=3.0),
        {"detection_efficiency": 0.27, "jitter_ns": 0.33, "dark_count_rate_hz": 31_000.0},
        make_pulse(1.0),
        tuple(np.geomspace(0.05, 0.8, 10)),
        ("detection_rate", "range_scatter", "counts_mean"),
        range_m=100.0,
        dark_s=0.2,
    ),
}


def measure(camera, seed, shots=1000, detector=None):
    """Return the curves of a camera with its hidden constants, or of another detector on the same bench."""
    detector = set_constants(camera.sheet, camera.hidden) if detector is None else detector
    photons = np.array(camera.photons)
    levels = simulate_levels(detector, camera.pulse, photons, np.full(len(photons), camera.range_m), shots, seed)
    values = {
        "detection_rate": levels.share,
        "range_mean": levels.range_mean_m,
        "walk": levels.range_mean_m + 0.3,
        "range_scatter": levels.range_scatter_m,
        "counts_mean": levels.counts_mean,
        "counts_scatter": levels.counts_scatter,
    }
    curves = []
    for quantity in camera.quantities:
        is_rate = quantity == "detection_rate"
        kept = np.isfinite(values[quantity]) & (is_rate | (levels.share > 0.5))
        trials = np.where(is_rate, shots, np.rint(levels.share * shots))[kept]
        curves.append(make_curve(quantity, photons[kept], values[quantity][kept], trials, camera.range_m))
    if camera.dark_s:
        curves.append(measure_dark_counts(detector, camera, seed))
    return curves


def make_curve(quantity, photons, values, trials, range_m=20.0):
    """Return a curve named like its quantity, without systematic errors."""
    n = len(values)
    constant = (np.full(n, range_m), np.full(n, np.nan), np.zeros(n))
    return MeasuredCurve(
        quantity, quantity, np.asarray(photons, float), np.asarray(values), np.asarray(trials), *constant
    )


def measure_dark_counts(detector, camera, seed):
    """Return the number of triggers without light in some armed time.

    Pixels of the chain in the dark give it: the times of their first triggers, and the whole window of those without any.
    """
    rng = np.random.Generator(np.random.Philox([seed, 1]))
    if isinstance(detector, GeigerArray):  # which reports peaks of counts, not avalanches
        return make_curve(
            "dark_counts", [0.0], [float(rng.poisson(detector.dark_count_rate_hz * camera.dark_s))], [camera.dark_s]
        )
    window_s = (detector.armed_to_m - detector.armed_from_m) / units.RANGE_PER_DELAY_M_S
    none, pulse = np.zeros(0), (camera.pulse.step_s, camera.pulse.power_per_s)
    shape = (1, round(camera.dark_s / window_s))
    light = make_point_returns(shape, pulse, camera.pulse.fwhm_s, none.astype(int), none, none)
    reported_m = detect(light, detector, rng)[0].range_m.ravel()
    after_s = (np.nan_to_num(reported_m, nan=detector.armed_to_m) - detector.armed_from_m) / units.RANGE_PER_DELAY_M_S
    return make_curve("dark_counts", [0.0], [float(np.isfinite(reported_m).sum())], [float(after_s.sum())])


def fit(camera, curves, **options):
    """Fit the hidden constants of a camera from its data sheet and curves."""
    return fit_constants(camera.sheet, camera.pulse, curves, list(camera.hidden), start=camera.start, **options)
