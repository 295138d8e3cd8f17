"""Labels of pixels in NumPy.

The oracle of `rso_lidar.scene.labels.sum_weights` and `rso_lidar.scene.labels.label_pixels`.
"""

from typing import Any

import numpy as np

from rso_lidar import units
from rso_lidar.records import Hits, Photons
from rso_lidar.ties import EQUAL
from tests.reference.ties import find_first_greatest_of_each

NEGLIGIBLE = 1e-3  # of a pixel's light


def label_pixels(labels: dict[str, Any], hits: Hits, photons: Photons) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Write the labels of the pixels that see something; return mean range [m], photons and whether it counts (cluster)."""
    n_pixels, n_clusters = len(labels["range_m"]), len(photons.cluster_pixel)
    labels["photons"] = np.bincount(photons.pixel, photons.photons, n_pixels)
    labels["filled_fraction"] = (
        np.bincount(hits.pixel, hits.weight, n_pixels)
        if photons.filled_fraction is None
        else photons.filled_fraction.ravel()
    )
    bright = np.bincount(photons.cluster, photons.photons, n_clusters)
    if not n_clusters:
        return bright, bright, np.zeros(0, dtype=bool)
    # A black facet returns nothing and is there all the same: then area weighs instead of light.
    share = np.where(bright[photons.cluster] > 0.0, photons.photons, hits.weight[photons.hit])
    range_m = photons.delay_s * units.RANGE_PER_DELAY_M_S
    mean_range: np.ndarray = np.bincount(photons.cluster, share * range_m, n_clusters) / np.bincount(
        photons.cluster, share, n_clusters
    )

    first = np.flatnonzero(np.diff(photons.cluster_pixel, prepend=-1))  # nearest cluster of each pixel that has any
    pixel = photons.cluster_pixel[first]
    best = find_first_greatest_of_each(bright, first)
    is_counted = bright >= NEGLIGIBLE * labels["photons"][photons.cluster_pixel]
    counted = np.flatnonzero(is_counted)
    labels["first_range_m"][pixel] = mean_range[counted[np.searchsorted(counted, first)]]
    labels["range_m"][pixel] = mean_range[best]
    labels["cluster_count"][pixel] = np.minimum(np.add.reduceat(is_counted.astype(int), first), 255)

    of_best = np.zeros(n_clusters, dtype=bool)
    of_best[best] = True
    speak = np.flatnonzero(of_best[photons.cluster])
    speak = speak[_of_brightest_part(hits, share, photons, speak)]
    # By pixel and hit: a lens orders returns by delay, where rounding decides between equal ones.
    speak = speak[np.lexsort((photons.hit[speak], photons.pixel[speak]))]
    starts = np.flatnonzero(np.diff(photons.pixel[speak], prepend=-1))
    chosen = speak[find_first_greatest_of_each(share[speak], starts)]
    for name in ("target", "part", "facet", "cos_incidence"):
        labels[name][pixel] = getattr(hits, name)[photons.hit[chosen]]
    return mean_range, bright, is_counted


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
