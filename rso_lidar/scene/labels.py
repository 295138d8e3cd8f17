"""What was really there, pixel by pixel."""

from typing import Any

import numpy as np

from rso_lidar import units
from rso_lidar.arithmetic import compiled, packed
from rso_lidar.records import Hits, Labels, Photons
from rso_lidar.ties import EQUAL, first_greatest_of_each


def label(hits: Hits, photons: Photons, max_returns: int = 1) -> Labels:
    """Return the labels of one flash.

    The labels describe the cluster of a pixel that returns most photons; in it the part of a target that returns most, and
    of that the brightest return. Of clusters equal to rounding the nearest counts, of parts and returns the first by
    number. With `max_returns` over 1 the first clusters of each pixel are listed as well. Range is half the light's way
    out and back.
    """
    n_pixels = photons.shape[0] * photons.shape[1]
    sky: dict[str, Any] = {
        "range_m": np.full(n_pixels, np.nan),
        "first_range_m": np.full(n_pixels, np.nan),
        "cluster_count": np.zeros(n_pixels, np.uint8),
        "target": np.full(n_pixels, -1, np.int16),
        "part": np.full(n_pixels, -1, np.int16),
        "facet": np.full(n_pixels, -1, np.int32),
        "cos_incidence": np.full(n_pixels, np.nan, np.float32),
        "photons": np.zeros(n_pixels, np.float32),
        "filled_fraction": np.zeros(n_pixels, np.float32),
    }
    mean_range, bright = (_spoken_by_loops if compiled() else _spoken)(sky, hits, photons)
    if max_returns > 1:
        sky["return_range_m"] = np.full((n_pixels, max_returns), np.nan)
        sky["return_photons"] = np.zeros((n_pixels, max_returns), np.float32)
        first = np.searchsorted(photons.cluster_pixel, photons.cluster_pixel)
        number = np.arange(len(first)) - first
        listed = np.flatnonzero(number < max_returns)
        at = photons.cluster_pixel[listed], number[listed]
        sky["return_range_m"][at], sky["return_photons"][at] = mean_range[listed], bright[listed]
    return Labels(**{name: values.reshape(*photons.shape, *values.shape[1:]) for name, values in sky.items()})


def _spoken_by_loops(labels: dict[str, Any], hits: Hits, photons: Photons) -> tuple[np.ndarray, np.ndarray]:
    """Do what `_spoken` does."""
    from rso_lidar.scene.labels_loops import Returns, Said, Struck, filled, spoken

    if photons.filled_fraction is not None:
        labels["filled_fraction"] = photons.filled_fraction.ravel()
    else:
        filled(packed(hits.pixel), packed(hits.weight), labels["filled_fraction"])
    returns = Returns(*(packed(getattr(photons, name)) for name in Returns._fields))
    struck = Struck(*(packed(getattr(hits, name)) for name in Struck._fields))
    return spoken(returns, len(photons.cluster_pixel), struck, Said(*(labels[name] for name in Said._fields)))


def _spoken(labels: dict[str, Any], hits: Hits, photons: Photons) -> tuple[np.ndarray, np.ndarray]:
    """Write the labels of the pixels that see something; return the mean range [m] and the photons of each cluster."""
    n_pixels, n_clusters = len(labels["range_m"]), len(photons.cluster_pixel)
    labels["photons"] = np.bincount(photons.pixel, photons.photons, n_pixels)
    labels["filled_fraction"] = (
        np.bincount(hits.pixel, hits.weight, n_pixels)
        if photons.filled_fraction is None
        else photons.filled_fraction.ravel()
    )
    bright = np.bincount(photons.cluster, photons.photons, n_clusters)
    if not n_clusters:
        return bright, bright
    # A black facet returns nothing and is there all the same: then area weighs instead of light.
    share = np.where(bright[photons.cluster] > 0.0, photons.photons, hits.weight[photons.hit])
    range_m = photons.delay_s * units.RANGE_PER_DELAY_M_S
    mean_range: np.ndarray = np.bincount(photons.cluster, share * range_m, n_clusters) / np.bincount(
        photons.cluster, share, n_clusters
    )

    first = np.flatnonzero(np.diff(photons.cluster_pixel, prepend=-1))  # nearest cluster of each pixel that has any
    pixel = photons.cluster_pixel[first]
    best = first_greatest_of_each(bright, first)
    labels["first_range_m"][pixel] = mean_range[first]
    labels["range_m"][pixel] = mean_range[best]
    labels["cluster_count"][pixel] = np.minimum(np.diff(first, append=n_clusters), 255)

    of_best = np.zeros(n_clusters, dtype=bool)
    of_best[best] = True
    speak = np.flatnonzero(of_best[photons.cluster])
    speak = speak[_of_brightest_part(hits, share, photons, speak)]
    # By pixel and hit: a lens orders returns by delay, where rounding decides between equal ones.
    speak = speak[np.lexsort((photons.hit[speak], photons.pixel[speak]))]
    starts = np.flatnonzero(np.diff(photons.pixel[speak], prepend=-1))
    chosen = speak[first_greatest_of_each(share[speak], starts)]
    for name in ("target", "part", "facet", "cos_incidence"):
        labels[name][pixel] = getattr(hits, name)[photons.hit[chosen]]
    return mean_range, bright


def _of_brightest_part(hits: Hits, share: np.ndarray, photons: Photons, speak: np.ndarray) -> np.ndarray:
    """Return which of the returns `speak` belong to the part of a target that returns most light in their pixel."""
    hit, pixel = photons.hit[speak], photons.pixel
    target, part = hits.target[hit].astype(np.int64), hits.part[hit].astype(np.int64)
    number = target * (int(part.max()) + 1) + part
    kinds = np.flatnonzero(np.bincount(number))
    if len(kinds) == 1:
        return np.ones(len(speak), dtype=bool)
    kind = np.searchsorted(kinds, number)
    group = np.cumsum(np.diff(pixel[speak], prepend=-1) != 0) - 1
    light = np.bincount(group * len(kinds) + kind, share[speak], (group[-1] + 1) * len(kinds))
    each = light.reshape(-1, len(kinds))
    brightest = np.argmax(each >= each.max(axis=1, keepdims=True) * (1.0 - EQUAL), axis=1)
    mine: np.ndarray = kind == brightest[group]
    return mine
