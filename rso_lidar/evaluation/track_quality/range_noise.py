"""The range noise of a recording, from a simulation of its returns with its detector."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rso_lidar import units
from rso_lidar.detector import Surroundings, array_load, detect, isolate, make_plate, make_point_returns, run_trial
from rso_lidar.records import Frame, Photons, Reading
from rso_lidar.scenario import Lidar

_FRAMES, _TRIALS = 12, 2000
_LEVELS, _EACH = np.geomspace(100.0, 1e6, 60), 25  # photons at which the detector's counts are looked up
_FLOOR_M, _UNKNOWN_M = 1e-3, 0.05


def estimate_range_noise_m(lidar: Lidar, frames: Sequence[Frame]) -> float:
    """Estimate the standard deviation of one range [m] in a recording.

    Some of its frames are converted back into light: a return for each range, with the photons that give its intensity. A
    trial of these returns reproduces the recording's distribution of intensities, the array current of its flashes, and
    the number of pixels that trigger together.
    """
    chosen = np.unique(np.linspace(0, len(frames) - 1, _FRAMES).round().astype(int)).tolist()
    readings = [frames[k].observation.reading for k in chosen]
    rng = np.random.Generator(np.random.Philox(_TRIALS))
    answers = (
        _mean_intensity(lidar, float(np.nanmedian(_ranges_m(readings))), rng) if len(_ranges_m(readings)) else None
    )
    if answers is None:
        return _UNKNOWN_M
    photons, range_m, together, gain = [], [], [], []
    for reading in readings:
        light = _light_of_reading(lidar, reading, answers)
        load = array_load(lidar.detector, light)
        photons.append(light.photons)
        range_m.append(light.delay_s * units.RANGE_PER_DELAY_M_S)
        together.append(load.together_fraction[light.pixel])
        gain.append(load.gain[light.pixel])
    every = np.linspace(0, sum(map(len, photons)) - 1, _TRIALS).round().astype(int)
    seen = make_plate(
        np.concatenate(photons)[every],
        _TRIALS,
        lidar.laser.pulse,
        lidar.laser.pulse_fwhm_s,
        np.maximum(np.concatenate(range_m)[every] - 0.5, 0.0),
    )
    around = Surroundings(
        gain=float(np.mean(np.concatenate(gain))),
        together_fraction=np.concatenate(together)[every],
        timing_jitter_s=lidar.laser.timing_jitter_ns * units.NS,
    )
    noise_m = run_trial(lidar.detector, seen, rng, around=around).range_noise_m
    return max(noise_m, _FLOOR_M) if np.isfinite(noise_m) else _UNKNOWN_M


def _ranges_m(readings: Sequence[Reading]) -> np.ndarray:
    every: np.ndarray = np.concatenate([reading.range_m.ravel() for reading in readings])
    seen: np.ndarray = every[np.isfinite(every)]
    return seen


def _mean_intensity(lidar: Lidar, range_m: float, rng: np.random.Generator) -> np.ndarray:
    """Return the mean intensity [counts] of a plate at each level of photons, made monotonic; ranges in [m]."""
    n = len(_LEVELS) * _EACH
    level = np.arange(n) % len(_LEVELS)
    laser = lidar.laser
    seen = make_plate(_LEVELS[level], n, laser.pulse, laser.pulse_fwhm_s, max(range_m - 0.5, 0.0))
    reading, _ = detect(seen, isolate(lidar.detector), rng)
    counts = reading.intensity_counts.ravel().astype(float)
    n_reports = np.bincount(level, counts > 0, len(_LEVELS))
    mean = np.bincount(level, counts, len(_LEVELS)) / np.maximum(n_reports, 1)
    rising: np.ndarray = np.maximum.accumulate(mean)
    return rising


def _light_of_reading(lidar: Lidar, reading: Reading, answers: np.ndarray) -> Photons:
    """Return the light that gives a reading, one return to a range; answers (level) are mean intensities [counts]."""
    pixel = np.flatnonzero(np.isfinite(reading.range_m))
    counts = reading.intensity_counts.ravel()[pixel].astype(float)
    # Intensities that clip take the dimmest level that clips.
    first = np.flatnonzero(np.diff(answers, prepend=0.0) > 0.0)
    photons = np.exp(np.interp(counts, answers[first], np.log(_LEVELS[first])))
    range_m = reading.range_m.ravel()[pixel].astype(float)
    # The recorded intensities include speckle, which must not be drawn again.
    laser, shape = lidar.laser, reading.range_m.shape
    return make_point_returns(shape, laser.pulse, laser.pulse_fwhm_s, pixel, range_m, photons, coherence_cells=np.inf)
