"""Maps that the simulator measures of an invented camera, pixel by pixel."""

import numpy as np

from rso_lidar import units
from rso_lidar.detector import detect, make_point_returns
from rso_lidar.detector.curve_fit.measured_map import MeasuredMap

FROM_M = 21.0


def take_frames(camera, pulse, shape, photons, flashes, seed):
    """Return intensities and range errors (shot, row, col) of a plate at many phases of the clock, NaN without a report."""
    rng = np.random.Generator(np.random.Philox(seed))
    n = shape[0] * shape[1]
    counts, error_m = np.full((2, flashes, *shape), np.nan)
    for k in range(flashes):
        at_m = FROM_M + k * 0.618_033_988_749_894_9 % 1.0
        light = make_point_returns(
            shape, (pulse.step_s, pulse.power_per_s), pulse.fwhm_s, np.arange(n), np.full(n, at_m), np.full(n, photons)
        )
        reading, _ = detect(light, camera, rng)
        error = reading.range_m.astype(float) - at_m
        with np.errstate(invalid="ignore"):
            near = np.abs(error) < 5.0
        error_m[k] = np.where(near, error, np.nan)
        counts[k] = np.where(near, reading.intensity_counts, np.nan)
    return counts, error_m


def measure_maps(camera, pulse, shape, levels, flashes, seed, quantities=("counts_mean", "range_mean")):
    """Return the maps of means at each level of light."""
    maps = []
    for k, photons in enumerate(levels):
        frames = dict(
            zip(
                ("counts_mean", "range_mean"),
                take_frames(camera, pulse, shape, photons, flashes, seed + k),
                strict=True,
            )
        )
        maps += [
            make_mean(f"{quantity} at {photons:g}", quantity, photons, frames[quantity]) for quantity in quantities
        ]
    return maps


def make_mean(name, quantity, photons, stack):
    """Return the map of the means of a stack (shot, row, col), outliers left out."""
    middle = np.sort(np.nan_to_num(stack, nan=np.inf), axis=0)[len(stack) // 2]
    middle = np.where(np.isfinite(middle), middle, np.nan)
    low, high = np.nanquantile(stack - middle, [0.25, 0.75])
    kept = np.where(np.abs(stack - middle) < 5.0 * (high - low) / 1.349, stack, np.nan)
    trials = np.isfinite(kept).sum(axis=0).astype(float)
    total = np.nansum(kept, axis=0)
    mean = np.where(trials > 0.0, total / np.maximum(trials, 1.0), np.nan)
    scatter = np.sqrt(np.nansum((kept - mean) ** 2) / (trials.sum() - (trials > 0.0).sum()))
    return MeasuredMap(name, quantity, photons, mean, trials, float(scatter), FROM_M, 0.0)


def measure_rates(camera, pulse, shape, levels, flashes, seed):
    """Return the maps of the number of detections at each level of light."""
    maps = []
    for k, photons in enumerate(levels):
        _, error_m = take_frames(camera, pulse, shape, photons, flashes, seed + k)
        hits = np.isfinite(error_m).sum(axis=0).astype(float)
        maps.append(
            MeasuredMap(
                f"detections at {photons:g}",
                "detection_rate",
                photons,
                hits,
                np.full(shape, float(flashes)),
                np.nan,
                FROM_M,
                0.0,
            )
        )
    return maps


def list_truth(pixels, shape):
    """Return the true maps by the names of a file of maps, relative to their means as the fit's are."""
    live = ~pixels.dead
    truth = {
        "gain_factor": pixels.gain - pixels.gain[live].mean() + 1.0,
        "offset_counts": pixels.offset_counts - pixels.offset_counts[live].mean(),
        "t0_ns": (pixels.t0_s - pixels.t0_s[live].mean()) / units.NS,
        "threshold_factor": pixels.threshold,
    }
    return {name: values.reshape(shape) for name, values in truth.items()}
