"""Trials of a detector: the light of one pixel, copied many times, through the whole chain."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rso_lidar import units
from rso_lidar.detector import Surroundings, Trial, array_load, run_trial
from rso_lidar.records import Photons
from rso_lidar.scenario.mission.mission import Mission
from rso_lidar.scenario.preview.returns import TargetReturns
from rso_lidar.scenario.tables.lidar import Lidar

_BINS_PER_PULSE = 8  # returns of a pixel closer than an eighth of the pulse are merged (0.15 m at 8 ns)
_TRIALS, _FEWEST_TRIALS = 4000, 200
_MOST_SAMPLES = 4_000_000  # of a trial, so that a detector with a long gate is described in seconds
_MOST_LOADS = 6  # attitudes for which the effects of the array on a pixel are simulated


def copy_pixels(
    casts: Sequence[TargetReturns], pixels: Sequence[int | None], n: int, shift_m: np.ndarray
) -> tuple[Photons, np.ndarray]:
    """Copy the light of one pixel of each flash, cyclically, to `n` pixels in a row; return their true ranges (n) [m] too.

    Returns of a pixel that are closer than an eighth of the pulse are merged. The true range is that of the labels: the
    photon-weighted mean of the pixel's brightest cluster. It is NaN where there is no pixel.

    Parameters
    ----------
    casts : flashes; each one gives the same number of copies
    pixels : one pixel of each flash, None for a pixel without light
    n : total number of copies
    shift_m : (n) range shift of each copy [m], so that the copies cover all phases of the clock
    """
    merged = [_merge_returns(cast.light, pixel) for cast, pixel in zip(casts, pixels, strict=True)]
    of = np.arange(n) % len(casts)
    length, clusters, true_m = (
        np.array(column)[of] for column in zip(*((len(m.photons), m.clusters, m.range_m) for m in merged), strict=True)
    )
    first = np.cumsum([0, *(len(returns.photons) for returns in merged)])[of]
    copy = np.repeat(np.arange(n), length)
    take = np.arange(len(copy)) + np.repeat(first - (np.cumsum(length) - length), length)
    delay_s, photons, spread_s, cells, cluster = (
        np.concatenate([getattr(returns, name) for returns in merged])[take]
        for name in ("delay_s", "photons", "depth_spread_s", "coherence_cells", "cluster")
    )
    pulse = casts[0].light
    copies = Photons(
        shape=(1, n),
        pulse_fwhm_s=pulse.pulse_fwhm_s,
        pulse_step_s=pulse.pulse_step_s,
        late_s=0.0,
        pulse_power_per_s=pulse.pulse_power_per_s,
        pixel=copy,
        delay_s=delay_s + shift_m[copy] / units.RANGE_PER_DELAY_M_S,
        photons=photons,
        depth_spread_s=spread_s,
        coherence_cells=cells,
        hit=np.arange(len(copy)),
        cluster=cluster + (np.cumsum(clusters) - clusters)[copy],
        cluster_pixel=np.repeat(np.arange(n), clusters),
    )
    return copies, true_m + shift_m


def estimate_surroundings(
    lidar: Lidar, casts: Sequence[TargetReturns], pixels: Sequence[int | None], n: int
) -> Surroundings:
    """Estimate the effects on the pixels of `copy_pixels` of array current, simultaneous triggers and laser jitter.

    Parameters
    ----------
    lidar : the instrument that is in force
    casts : flashes; each one gives the same number of copies. At most `_MOST_LOADS` of them are simulated
    pixels : one pixel of each flash, None for a pixel without light
    n : total number of copies
    """
    few = np.unique(np.linspace(0, len(casts) - 1, _MOST_LOADS).round().astype(int))
    gains, together = [], []
    for number in few.tolist():
        pixel = pixels[number]
        load = array_load(lidar.detector, casts[number].light)
        gains.append(1.0 if pixel is None else float(load.gain[pixel]))
        together.append(0.0 if pixel is None else float(load.together_fraction[pixel]))
    nearest = np.abs(np.subtract.outer(np.arange(len(casts)), few)).argmin(axis=1)
    return Surroundings(
        gain=float(np.mean(gains)),
        together_fraction=np.array(together)[nearest][np.arange(n) % len(casts)],
        energy_jitter_fraction=lidar.laser.energy_jitter_fraction,
        timing_jitter_s=lidar.laser.timing_jitter_ns * units.NS,
    )


def try_pixels(mission: Mission, casts: Sequence[TargetReturns], share: float, time_s: float) -> Trial:
    """Simulate up to 4000 pixels with the light of one pixel of each flash, through the whole chain.

    The random seed is fixed, so that repeated calls give the same result.

    Parameters
    ----------
    share : quantile of the pixel in the order by photons, from 0 (dimmest) to 1 (brightest)
    time_s : time whose instrument settings apply [s since start_utc]
    """
    lidar = mission.instrument.at(time_s)
    traits = lidar.detector.traits  # trials of many pulses or samples are slow
    n = max(min(_TRIALS // traits.pulses, _MOST_SAMPLES // traits.samples), _FEWEST_TRIALS)
    pixels = [cast.pixel_at(share) for cast in casts]
    # A golden-ratio sequence spreads the copies of one flash evenly over two samples of the default readout.
    shift_m = 0.72 * (np.modf((np.arange(n) // len(casts)) * 0.618_033_988_749_894_9)[0] - 0.5)
    photons, true_m = copy_pixels(casts, pixels, n, shift_m)
    around = estimate_surroundings(lidar, casts, pixels, n)
    return run_trial(lidar.detector, photons, np.random.Generator(np.random.Philox(_TRIALS)), true_m, around)


@dataclass(frozen=True, eq=False)
class _MergedReturns:
    """Returns of one pixel, merged where their delays are about equal, in `clusters` clusters numbered from 0."""

    delay_s: np.ndarray
    photons: np.ndarray
    depth_spread_s: np.ndarray
    coherence_cells: np.ndarray
    cluster: np.ndarray
    clusters: int
    range_m: float


def _merge_returns(light: Photons, pixel: int | None) -> _MergedReturns:
    on = np.flatnonzero(light.pixel == (-1 if pixel is None else pixel))
    if not on.size:
        none = np.empty(0)
        return _MergedReturns(none, none, none, none, none.astype(int), 0, math.nan)
    delay_s, photons = light.delay_s[on], light.photons[on]
    cluster = np.unique(light.cluster[on], return_inverse=True)[1]
    step = np.floor((delay_s - delay_s.min()) * (_BINS_PER_PULSE / light.pulse_fwhm_s)).astype(int)
    steps = step.max() + 1
    pairs, group = np.unique(cluster * steps + step, return_inverse=True)
    n = len(pairs)
    weight = np.where(np.bincount(group, photons, n)[group] > 0.0, photons, 1.0)
    mean_s, spread_s = (
        np.bincount(group, weight * values, n) / np.bincount(group, weight, n)
        for values in (delay_s, light.depth_spread_s[on])
    )
    early_s, late_s = np.full(n, np.inf), np.full(n, -np.inf)
    np.minimum.at(early_s, group, delay_s)
    np.maximum.at(late_s, group, delay_s)
    in_cluster = np.bincount(cluster, photons)
    best = cluster == in_cluster.argmax()
    share = photons[best] if in_cluster.max() > 0.0 else np.ones(best.sum())
    return _MergedReturns(
        mean_s,
        np.bincount(group, photons, n),
        spread_s + late_s - early_s,
        np.bincount(group, light.coherence_cells[on], n),
        pairs // steps,
        len(in_cluster),
        float(np.average(delay_s[best], weights=share)) * units.RANGE_PER_DELAY_M_S,
    )
