"""Bloom: charge that a pixel cannot hold, and that its neighbours collect.

It acts on expected photons, before any noise is drawn, so it needs no random numbers: the neighbours draw the noise of what
they collect as they draw that of light. Spilled charge is expressed in photons that would make it.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from rso_lidar import units
from rso_lidar.detector.settings.focal_plane import Bloom
from rso_lidar.records import Photons

_BIN_FWHM = 2.0  # width of the bins of delay whose light counts as one pulse, over the width of the pulse
_LEAST_PHOTONS = 0.01  # less spilled charge than these photons make is left out
_MOST_ROUNDS = 400  # of spilling: each passes the charge on by a pixel
_NO_SPECKLE = 1e6  # cells of coherence: charge does not interfere


def spill_charge(bloom: Bloom, photons: Photons, electrons_per_photon: float) -> Photons:
    """Move the charge above full wells to the neighbours of the pixels that it was made in.

    Of the charge above the full well, `spill_fraction` leaves a pixel, and each of the four neighbours collects a quarter.
    Collected charge above their own wells spills on. The rest stays in its pixel. What leaves over the edge of the array
    is lost.

    Parameters
    ----------
    bloom : full well, share and delay of what spills
    electrons_per_photon : mean number of electrons after the APD for each photon
    """
    if not len(photons.pixel):
        return photons
    n_pixels, well = photons.shape[0] * photons.shape[1], bloom.full_well_electrons / electrons_per_photon
    epoch = np.zeros(len(photons.pixel), np.int64) if photons.epoch is None else photons.epoch.astype(np.int64)
    share = np.ones(1)  # of the frame's pulses, by epoch: each pulse fills the wells alone
    if photons.pulse_epoch is not None:
        share = np.bincount(photons.pulse_epoch) / len(photons.pulse_epoch)
    light = photons.photons / share[epoch]
    number = ((photons.delay_s - photons.delay_s.min()) / (_BIN_FWHM * photons.pulse_fwhm_s)).astype(np.int64)
    number += epoch * (int(number.max()) + 1)
    charge = light.copy()
    spilled: list[dict[str, np.ndarray]] = []
    for group in np.unique(number):
        of = np.flatnonzero(number == group)
        held = np.bincount(photons.pixel[of], light[of], n_pixels)
        if held.max() <= well:
            continue
        lost, collected = find_spill(held.reshape(photons.shape), well, bloom.spill_fraction)
        kept = 1.0 - lost / np.maximum(held.reshape(lost.shape) + collected, 1e-300)  # of what was made and collected
        charge[of] = light[of] * kept.ravel()[photons.pixel[of]]
        spilled.append(_return_charge(photons, of, lost, collected * kept, bloom.delay_ns * units.NS))
        spilled[-1]["epoch"] = np.full(len(spilled[-1]["pixel"]), epoch[of[0]])
    if not spilled:
        return photons
    return _join(photons, charge * share[epoch], epoch, spilled, share)


def find_spill(held: np.ndarray, well: float, spill_fraction: float) -> tuple[np.ndarray, np.ndarray]:
    """Find what charge leaves each pixel and what each collects (row, col).

    Parameters
    ----------
    held : (row, col) charge made in each pixel
    well : charge that a pixel holds, in the same unit
    spill_fraction : share of the charge above the well that leaves
    """
    lost, collected = np.zeros_like(held, dtype=float), np.zeros_like(held, dtype=float)
    leaving = spill_fraction * np.maximum(held - well, 0.0)
    for _ in range(_MOST_ROUNDS):
        if not leaving.max() > 1e-6 * well:
            break
        lost += leaving
        quarter = 0.25 * leaving
        arriving = np.zeros_like(lost)
        arriving[1:] += quarter[:-1]
        arriving[:-1] += quarter[1:]
        arriving[:, 1:] += quarter[:, :-1]
        arriving[:, :-1] += quarter[:, 1:]
        before = np.maximum(held + collected - well, 0.0)
        collected += arriving
        leaving = spill_fraction * (np.maximum(held + collected - well, 0.0) - before)
    return lost, collected


def _return_charge(
    photons: Photons, of: np.ndarray, lost: np.ndarray, collected: np.ndarray, delay_s: float
) -> dict[str, np.ndarray]:
    """Return the collected charge (row, col) of one pulse as returns, with the delay of the nearest pixel that spills."""
    from scipy.ndimage import distance_transform_edt

    n_pixels = lost.size
    light = np.bincount(photons.pixel[of], photons.photons[of], n_pixels)
    made_here = light.reshape(lost.shape) > 0.0
    sources = (lost > 0.0) & made_here
    row, col = distance_transform_edt(~sources, return_distances=False, return_indices=True)
    nearest = (row * lost.shape[1] + col).ravel()
    pixel = np.flatnonzero(collected.ravel() >= _LEAST_PHOTONS)
    weight = np.maximum(light, 1e-300)

    def mean(values: np.ndarray) -> np.ndarray:
        total = np.bincount(photons.pixel[of], photons.photons[of] * values[of], n_pixels)
        means: np.ndarray = (total / weight)[nearest[pixel]]
        return means

    order = of[np.argsort(photons.photons[of], kind="stable")]
    hit = np.zeros(n_pixels, np.int64)
    hit[photons.pixel[order]] = photons.hit[order]  # the brightest return of a pixel is written last
    return {
        "pixel": pixel,
        "delay_s": mean(photons.delay_s) + delay_s,
        "photons": collected.ravel()[pixel],
        "depth_spread_s": mean(photons.depth_spread_s),
        "coherence_cells": np.full(len(pixel), _NO_SPECKLE),
        "hit": hit[nearest[pixel]],
    }


def _join(
    photons: Photons, light: np.ndarray, epoch: np.ndarray, spilled: list[dict[str, np.ndarray]], share: np.ndarray
) -> Photons:
    """Join the charge that stays and the charge that is collected, each of the latter in a cluster of its own.

    Parameters
    ----------
    light : (return) what is left of it
    epoch : (return) epoch of each
    share : (epoch) share of the pulses
    """
    new = {name: np.concatenate([returns[name] for returns in spilled]) for name in spilled[0]}
    new["photons"] = new["photons"] * share[new["epoch"]]
    columns: dict[str, Any] = {}
    for name in ("pixel", "delay_s", "photons", "depth_spread_s", "coherence_cells", "hit"):
        old = light if name == "photons" else getattr(photons, name)
        columns[name] = np.concatenate([old, new[name].astype(old.dtype)])
    all_epochs = np.concatenate([epoch, new["epoch"]])
    n_old = len(photons.cluster_pixel)
    cluster = np.concatenate([photons.cluster, n_old + np.arange(len(new["pixel"]))])
    cluster_pixel = np.concatenate([photons.cluster_pixel, new["pixel"]])
    first_s = np.full(len(cluster_pixel), np.inf)
    np.minimum.at(first_s, cluster, columns["delay_s"])
    by_pixel = np.lexsort((first_s, cluster_pixel))
    place = np.empty(len(by_pixel), np.int64)
    place[by_pixel] = np.arange(len(by_pixel))
    order = np.lexsort((columns["delay_s"], all_epochs, columns["pixel"]))
    columns = {name: values[order] for name, values in columns.items()}
    if photons.epoch is not None:
        columns["epoch"] = all_epochs[order]
    return replace(photons, **columns, cluster=place[cluster][order], cluster_pixel=cluster_pixel[by_pixel])
