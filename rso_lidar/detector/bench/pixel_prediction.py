"""Prediction of every pixel of one flash: the probability that it reports its labelled cluster, and the scatter of range.

The labelled cluster of a pixel is its brightest cluster of returns, or the cluster at a given range. A report counts if it
lies within 5 m of that cluster and nearer to it than to any other cluster of the pixel. Scatter is the standard deviation of
the ranges of the reports that count.

A flash is predicted by the first method that applies to its detector:

- Curves: the empirical detector states both numbers.
- Closed form and table: `report_probability` gives the probability, and a table the scatter. The chain fills the table once
  by trials of separate pixels, over photons, depth and sunlight. Its standard error is 3 %. Pixels to which the two do not
  apply are simulated in repeated trials.
- Repetition: the flash is detected many times with other noise. This applies to any detector and setting. The standard
  error of a probability from n repetitions is at most 0.5 / √n.

The prediction is for the given light. The laser's jitter from pulse to pulse is in that light already, so it is not
included. Jitter that all pixels of a frame share is included in the scatter of each pixel.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

from rso_lidar import units
from rso_lidar.detector.analysis.pixel_reports import split_sunlight
from rso_lidar.detector.bench.scatter_table import read_scatter_m, threshold_of_returns
from rso_lidar.detector.chain.camera import camera_of
from rso_lidar.detector.chain.full import run_chain
from rso_lidar.detector.detection import AnyDetector, detect, report_probability
from rso_lidar.detector.geiger import photon_counter
from rso_lidar.detector.geiger.array import GeigerArray
from rso_lidar.detector.settings.empirical import Empirical
from rso_lidar.detector.settings.gsfl import Gsfl
from rso_lidar.errors import ScenarioError
from rso_lidar.records import Photons, PixelPrediction
from rso_lidar.ties import EQUAL

_NEAR_M = 5.0  # a report farther from a cluster is a false trigger, as in `trial.run_trial`
_SEED = 91  # random seed of repetitions and trials
_FEW_TRIALS = 8  # of a pixel for its scatter; with the pooled scatter, four times as many reduce its error to 10 % only
_POOLED = 8.0  # degrees of freedom of the scatter of equally bright pixels in a pixel's scatter; its own has up to 31
_NEIGHBOURS = 12  # pixels to each side in order of brightness, over which scatter is pooled

# Pixels to which the table and the closed form do not apply.
_LEAST_BESIDE = 0.25  # of the threshold's photons: less light in another cluster changes little
_LEAST_BEHIND = 0.5  # of the labelled light: with less light behind it, the labelled pulse stays the higher one
_FAINTEST = 0.3  # of the threshold's photons: less light is hardly ever reported
_DEEP = 1.5  # pulse lengths: the error of the table is up to 15 % for deeper light


def predict_pixels(
    photons: Photons,
    detector: AnyDetector,
    true_range_m: np.ndarray | None = None,
    *,
    draws: int = 32,
    threads: int | None = 1,
    by_table: bool = True,
) -> PixelPrediction:
    """Predict for each pixel of a flash how often it reports its labelled cluster, and how precisely.

    Parameters
    ----------
    photons : light on every pixel
    detector : a part, or an object that follows the protocol `Detector`
    true_range_m : (row, col) range of the labelled cluster [m], NaN for sky, as in `Labels` (None: the brightest cluster of
        each pixel)

    Other Parameters
    ----------------
    draws : number of repetitions and trials, where curves, closed form and table do not apply
    threads : number of threads for repetitions (None: one for each core). It does not change the result
    by_table : whether scatter may be read from the table of a detector and pulse. Filling it takes some 100,000 trials,
        which pays for many flashes of the same detector. Otherwise the scatter comes from eight trials of each pixel and of
        equally bright ones, with a standard error of 12 %

    Returns
    -------
    PixelPrediction
        Probability and scatter [m], 0 and NaN in pixels without light.

    Raises
    ------
    ScenarioError
        If `draws` is below 2.
    """
    if draws < 2:
        raise ScenarioError(f"predict_pixels: draws: {draws} repetitions have no scatter; take at least 2")
    n_pixels = photons.shape[0] * photons.shape[1]
    there = _find_clusters(photons, true_range_m)
    probability, sigma_m = np.zeros(n_pixels), np.full(n_pixels, np.nan)
    if len(there.pixel):
        probability[there.pixel], sigma_m[there.pixel] = _predict(
            photons, detector, there, draws, threads, by_table=by_table
        )
    return PixelPrediction(probability.reshape(photons.shape), sigma_m.reshape(photons.shape))


@dataclass(frozen=True, eq=False)
class _Clusters:
    """The labelled cluster of each lit pixel; arrays (lit).

    `mean_m` is the mean range that the sensor measures, the laser's delay included. `near_m` and `far_m` are the bounds of
    reports that count. `depth_s` is the length of a uniform distribution with the variance of the light in delay.
    """

    pixel: np.ndarray
    cluster: np.ndarray
    photons: np.ndarray
    mean_m: np.ndarray
    near_m: np.ndarray
    far_m: np.ndarray
    depth_s: np.ndarray

    def select(self, lit: np.ndarray) -> _Clusters:
        return _Clusters(*(getattr(self, field.name)[lit] for field in fields(self)))


def _find_clusters(photons: Photons, true_range_m: np.ndarray | None) -> _Clusters:
    """Find the labelled cluster of each pixel: the one at a range (row, col) [m], or with None the brightest."""
    n_clusters, pixel = len(photons.cluster_pixel), photons.cluster_pixel
    light = np.bincount(photons.cluster, photons.photons, n_clusters)
    total = np.where(light > 0.0, light, 1.0)
    mean_s = np.bincount(photons.cluster, photons.photons * photons.delay_s, n_clusters) / total
    beside_s = photons.delay_s - mean_s[photons.cluster]
    variance_s2 = beside_s**2 + photons.depth_spread_s**2 / 12.0
    depth_s = np.sqrt(12.0 * np.bincount(photons.cluster, photons.photons * variance_s2, n_clusters) / total)
    near_s, far_s = np.full(n_clusters, np.inf), np.full(n_clusters, -np.inf)
    np.minimum.at(near_s, photons.cluster, photons.delay_s)
    np.maximum.at(far_s, photons.cluster, photons.delay_s)
    near_m, far_m = ((delay_s + photons.late_s) * units.RANGE_PER_DELAY_M_S for delay_s in (near_s, far_s))
    mean_m = (mean_s + photons.late_s) * units.RANGE_PER_DELAY_M_S
    same = np.zeros(n_clusters, bool)  # whether the cluster before is of the same pixel
    same[1:] = pixel[1:] == pixel[:-1]
    between_m = np.full(n_clusters + 1, np.nan)
    between_m[1:-1] = 0.5 * (far_m[:-1] + near_m[1:])
    after = np.append(same[1:], False)
    from_m = np.where(same, np.maximum(near_m - _NEAR_M, between_m[:-1]), near_m - _NEAR_M)
    to_m = np.where(after, np.minimum(far_m + _NEAR_M, between_m[1:]), far_m + _NEAR_M)

    # The brightest cluster of each pixel, or the cluster at the given range; among equal ranks the nearest cluster.
    rank = -light
    if true_range_m is not None:
        true_m = np.asarray(true_range_m, dtype=float).ravel()[pixel] + photons.late_s * units.RANGE_PER_DELAY_M_S
        rank = np.abs(mean_m - true_m)
    usable = np.flatnonzero((light > 0.0) & np.isfinite(rank))
    best = np.full(photons.shape[0] * photons.shape[1], np.inf)
    np.minimum.at(best, pixel[usable], rank[usable])
    least = best[pixel[usable]]
    chosen = usable[rank[usable] <= least + EQUAL * np.abs(least)]
    chosen = chosen[np.diff(pixel[chosen], prepend=-1) != 0]
    return _Clusters(
        pixel[chosen], chosen, light[chosen], mean_m[chosen], from_m[chosen], to_m[chosen], depth_s[chosen]
    )


def _predict(
    photons: Photons, detector: AnyDetector, there: _Clusters, draws: int, threads: int | None, *, by_table: bool
) -> tuple[np.ndarray, np.ndarray]:
    """Predict probability and scatter [m] (lit) by the first method that applies to the detector."""
    if isinstance(detector, GeigerArray):
        return _summarise(photon_counter.try_lit_pixels(detector, photons, there.pixel), there, photons.pulse_fwhm_s)
    if isinstance(detector, Gsfl | Empirical):
        mine = np.zeros(len(photons.cluster_pixel), bool)
        mine[there.cluster] = True
        known = report_probability(detector, photons, mine[photons.cluster])
        if known is not None and isinstance(detector, Empirical):
            return known[there.pixel], detector.range_noise_m(there.photons, photons.pulse_fwhm_s)
        if isinstance(detector, Gsfl):
            if known is not None:
                return _predict_by_form(photons, detector, there, known[there.pixel], draws, by_table=by_table)
            if not detector.has_coupled_pixels:
                return _try_pixels(photons, detector, there, draws)
    return _predict_by_repetition(photons, detector, there, draws, threads)


def _predict_by_form(
    photons: Photons, gsfl: Gsfl, there: _Clusters, probability: np.ndarray, draws: int, *, by_table: bool
) -> tuple[np.ndarray, np.ndarray]:
    """Add scatter to the closed form, and replace both by trials in pixels to which they do not apply.

    Parameters
    ----------
    probability : (lit) probability by the closed form
    by_table : whether scatter comes from the table, and not from trials of every pixel
    """
    if by_table:
        sunlight = np.zeros(len(there.pixel))
        if photons.background_photons_per_s is not None:
            sunlight = photons.background_photons_per_s.ravel()[there.pixel]
        sigma_m = np.zeros(len(there.pixel))
        for level, weight in split_sunlight(gsfl, sunlight):
            of = np.flatnonzero(weight > 0.0)
            sigma_m[of] += weight[of] * read_scatter_m(gsfl, photons, level, there.photons[of], there.depth_s[of])
    else:
        _, sigma_m = _try_pixels(photons, gsfl, there, min(draws, _FEW_TRIALS))
    special = np.flatnonzero(_find_special(photons, gsfl, there))
    if len(special):
        probability = probability.copy()
        probability[special], sigma_m[special] = _try_pixels(photons, gsfl, there.select(special), draws)
    return probability, sigma_m


def _find_special(photons: Photons, gsfl: Gsfl, there: _Clusters) -> np.ndarray:
    """Find pixels (lit) whose light is deep, or whose stored samples hold several clusters.

    Several clusters can cross the threshold together, and the algorithm reports the higher pulse of the stored samples. So
    the cluster that triggers is not always the cluster that is reported.
    """
    pixel, n_clusters = photons.cluster_pixel, len(photons.cluster_pixel)
    light = np.bincount(photons.cluster, photons.photons, n_clusters)
    summed_s = np.bincount(photons.cluster, photons.photons * photons.delay_s, n_clusters)
    range_m = summed_s / np.where(light > 0.0, light, 1.0) * units.RANGE_PER_DELAY_M_S
    unit = threshold_of_returns(gsfl)
    total = np.bincount(pixel, light, photons.shape[0] * photons.shape[1])
    place = np.searchsorted(there.pixel, pixel)
    of = np.flatnonzero((light > _LEAST_BESIDE * unit) & (np.append(there.pixel, -1)[place] == pixel))
    mine = place[of]
    late_m = photons.late_s * units.RANGE_PER_DELAY_M_S
    reach_m = gsfl.window_m + photons.pulse_fwhm_s * units.RANGE_PER_DELAY_M_S
    behind_m = range_m[of] + late_m - there.mean_m[mine]
    beside = (of != there.cluster[mine]) & (np.abs(behind_m) < reach_m)
    beside &= (behind_m < 0.0) | (light[of] > _LEAST_BEHIND * there.photons[mine])
    special: np.ndarray = there.depth_s > _DEEP * photons.pulse_fwhm_s
    special[mine[beside]] = True
    special &= total[there.pixel] > _FAINTEST * unit
    return special


def _try_pixels(photons: Photons, gsfl: Gsfl, there: _Clusters, draws: int) -> tuple[np.ndarray, np.ndarray]:
    """Predict by trials of some pixels, which do not affect each other. Each keeps its fixed pattern."""
    lit = there.pixel
    place = np.searchsorted(lit, photons.pixel)
    of = np.flatnonzero(np.append(lit, -1)[place] == photons.pixel)
    pixel, n = place[of], len(lit)
    cluster_of = np.flatnonzero(np.isin(photons.cluster_pixel, lit))
    cluster = np.searchsorted(cluster_of, photons.cluster[of])
    each = np.arange(draws)[:, None]
    row: dict[str, Any] = {
        name: np.tile(getattr(photons, name)[of], draws)
        for name in ("delay_s", "photons", "depth_spread_s", "coherence_cells", "hit", "epoch")
        if getattr(photons, name) is not None
    }
    row |= {
        "pixel": (each * n + pixel).ravel(),
        "cluster": (each * len(cluster_of) + cluster).ravel(),
        "cluster_pixel": (each * n + np.searchsorted(lit, photons.cluster_pixel[cluster_of])).ravel(),
        "filled_fraction": None,
        "photons_variance": None,
    }
    if photons.background_photons_per_s is not None:
        row["background_photons_per_s"] = np.tile(photons.background_photons_per_s.ravel()[lit], draws)[None]
    camera = camera_of(gsfl.alone(), photons).select(np.tile(lit, draws))
    rng = np.random.Generator(np.random.Philox(_SEED))
    reading, _, _ = run_chain(camera, replace(photons, shape=(1, n * draws), **row), rng)
    reported_m = np.asarray(reading.range_m, dtype=float).reshape(draws, n)
    probability, sigma_m = _summarise(reported_m, there, photons.pulse_fwhm_s)
    return probability, np.hypot(sigma_m, gsfl.frame_jitter_s * units.RANGE_PER_DELAY_M_S)


def _predict_by_repetition(
    photons: Photons, detector: AnyDetector, there: _Clusters, draws: int, threads: int | None
) -> tuple[np.ndarray, np.ndarray]:
    """Predict by detecting the flash many times with other noise."""
    reported_m = np.empty((draws, len(there.pixel)))
    for k in range(draws):
        rng = np.random.Generator(np.random.Philox(np.random.SeedSequence(_SEED, spawn_key=(k,))))
        reported_m[k] = detect(photons, detector, rng, threads)[0].range_m.ravel()[there.pixel]
    return _summarise(reported_m, there, photons.pulse_fwhm_s)


def _summarise(reported_m: np.ndarray, there: _Clusters, fwhm_s: float) -> tuple[np.ndarray, np.ndarray]:
    """Return share and scatter [m] (lit) of the reports that count.

    The scatter of a few reports is uncertain. So the pooled variance of about equally bright pixels is added to the variance
    of each pixel, with eight degrees of freedom.

    Parameters
    ----------
    reported_m : (draw, lit) reported ranges [m], NaN where none
    fwhm_s : length of the pulse [s]. If no pixel reports twice, the scatter is that of a uniform distribution over it
    """
    with np.errstate(invalid="ignore"):
        inside = (reported_m >= there.near_m) & (reported_m <= there.far_m)
    count = inside.sum(axis=0)
    error_m = np.where(inside, reported_m - there.mean_m, 0.0)
    mean_m = error_m.sum(axis=0) / np.maximum(count, 1)
    squares = (np.where(inside, error_m - mean_m, 0.0) ** 2).sum(axis=0)
    freedom = np.maximum(count - 1, 0).astype(float)
    order = np.argsort(there.photons, kind="stable")
    window = np.ones(2 * _NEIGHBOURS + 1)
    summed, free = (
        np.convolve(values[order], window)[_NEIGHBOURS : _NEIGHBOURS + len(order)] for values in (squares, freedom)
    )
    known = np.flatnonzero(free > 0.0)
    if not len(known):
        widest_m = fwhm_s * units.RANGE_PER_DELAY_M_S / math.sqrt(12.0)
        return count / len(reported_m), np.full(len(order), widest_m)
    pooled = np.empty(len(order))
    pooled[order] = np.interp(np.arange(len(order)), known, summed[known] / free[known])
    variance = (squares + _POOLED * pooled) / (freedom + _POOLED)
    return count / len(reported_m), np.sqrt(variance)
