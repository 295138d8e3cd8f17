"""Labels: what was really in each pixel."""

from typing import Any, NamedTuple

import numpy as np

from rso_lidar.kernels import kernel, packed
from rso_lidar.records import Hits, Labels, Photons
from rso_lidar.ties import EQUAL
from rso_lidar.units import RANGE_PER_DELAY_M_S

_NEGLIGIBLE = 1e-3  # of a pixel's light: rays find slivers of facets, which no detector tells from nothing


class ReturnColumns(NamedTuple):
    """Columns of `Photons` (return)."""

    pixel: np.ndarray
    photons: np.ndarray
    delay_s: np.ndarray
    hit: np.ndarray
    cluster: np.ndarray


class HitColumns(NamedTuple):
    """Columns of `Hits` (hit)."""

    weight: np.ndarray
    target: np.ndarray
    part: np.ndarray
    facet: np.ndarray
    cos_incidence: np.ndarray


class LabelColumns(NamedTuple):
    """Columns of `Labels` (pixel)."""

    photons: np.ndarray
    range_m: np.ndarray
    first_range_m: np.ndarray
    cluster_count: np.ndarray
    target: np.ndarray
    part: np.ndarray
    facet: np.ndarray
    cos_incidence: np.ndarray


def label(hits: Hits, photons: Photons, max_returns: int = 1) -> Labels:
    """Label the pixels of one flash.

    A label describes the cluster of returns with most photons. In this cluster it names the part of a target with most
    photons, and the brightest return from that part. Among clusters that are equal to rounding the nearest counts. Among
    parts and returns the first by number counts. Range is half the light's path out and back.

    Parameters
    ----------
    hits : where rays met surfaces
    photons : the light that came back, in clusters by delay
    max_returns : number of clusters of each pixel that are listed one by one, if over 1

    Returns
    -------
    labels of all pixels (row, col); sky is -1 or NaN.
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
    mean_range, bright, is_counted = _write_labels(sky, hits, photons)
    if photons.photons_variance is not None:
        sky["photons_sampling_error"] = np.sqrt(photons.photons_variance.ravel()).astype(np.float32)
    if max_returns > 1:
        sky["return_range_m"] = np.full((n_pixels, max_returns), np.nan)
        sky["return_photons"] = np.zeros((n_pixels, max_returns), np.float32)
        counted = np.flatnonzero(is_counted)
        pixel = photons.cluster_pixel[counted]
        number = np.arange(len(pixel)) - np.searchsorted(pixel, pixel)
        is_listed = number < max_returns
        listed, at = counted[is_listed], (pixel[is_listed], number[is_listed])
        sky["return_range_m"][at], sky["return_photons"][at] = mean_range[listed], bright[listed]
    return Labels(**{name: values.reshape(*photons.shape, *values.shape[1:]) for name, values in sky.items()})


def _write_labels(labels: dict[str, Any], hits: Hits, photons: Photons) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Write the labels of all pixels with returns; return what `label_pixels` does."""
    if photons.filled_fraction is not None:
        labels["filled_fraction"] = photons.filled_fraction.ravel()
    else:
        sum_weights(packed(hits.pixel), packed(hits.weight), labels["filled_fraction"])
    returns = ReturnColumns(*(packed(getattr(photons, name)) for name in ReturnColumns._fields))
    struck = HitColumns(*(packed(getattr(hits, name)) for name in HitColumns._fields))
    return label_pixels(
        returns, len(photons.cluster_pixel), struck, LabelColumns(*(labels[name] for name in LabelColumns._fields))
    )


@kernel
def sum_weights(pixel: np.ndarray, weight: np.ndarray, fraction: np.ndarray) -> None:
    """Sum the weights of hits pixel by pixel.

    Parameters
    ----------
    pixel, weight : (hit), pixel in ascending order, and share of its area
    fraction : (pixel), to which the sums are written
    """
    total = 0.0
    for k in range(len(pixel)):
        total += weight[k]
        if k + 1 == len(pixel) or pixel[k + 1] != pixel[k]:
            fraction[pixel[k]] = total
            total = 0.0


@kernel
def label_pixels(
    returns: ReturnColumns, n_clusters: int, struck: HitColumns, written: LabelColumns
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Write the labels of all pixels with returns.

    Parameters
    ----------
    written : the labels, to which is written

    Returns
    -------
    Mean range [m], photons, and whether it counts (cluster). A cluster counts unless it has a negligible share of its
    pixel's light.
    """
    pixel, photons, delay_s, hit, cluster = returns
    weight, target, part, facet, cos_incidence = struck
    bright, mean_range_m, share = np.zeros(n_clusters), np.zeros(n_clusters), np.zeros(n_clusters)
    is_counted = np.ones(n_clusters, np.bool_)
    # The parts of targets in the brightest cluster of a pixel: target, part, photons, and photons of the brightest return.
    kind_target, kind_part = np.empty(len(pixel), np.int16), np.empty(len(pixel), np.int16)
    kind_light, kind_most = np.empty(len(pixel)), np.empty(len(pixel))
    start, first = 0, 0
    while start < len(pixel):
        at, total, last, stop = pixel[start], 0.0, first, start
        while stop < len(pixel) and pixel[stop] == at:
            bright[cluster[stop]] += photons[stop]
            total += photons[stop]
            last = max(last, cluster[stop])
            stop += 1
        most = 0.0
        for c in range(first, last + 1):
            most = max(most, bright[c])
        best = first
        while bright[best] < most * (1.0 - EQUAL):
            best += 1
        kinds = 0
        for k in range(start, stop):
            c, h = cluster[k], hit[k]
            # A black facet returns no light and is labelled all the same, weighted by area.
            light = photons[k] if bright[c] > 0.0 else weight[h]
            share[c] += light
            mean_range_m[c] += light * (delay_s[k] * RANGE_PER_DELAY_M_S)
            if c != best:
                continue
            kind = 0
            while kind < kinds and (kind_target[kind] != target[h] or kind_part[kind] != part[h]):
                kind += 1
            if kind == kinds:
                kind_target[kind], kind_part[kind], kind_light[kind], kind_most[kind] = target[h], part[h], 0.0, -1.0
                kinds += 1
            kind_light[kind] += light
            kind_most[kind] = max(kind_most[kind], light)
        nearest, counted = -1, 0
        for c in range(first, last + 1):
            mean_range_m[c] /= share[c]
            is_counted[c] = bright[c] >= _NEGLIGIBLE * total
            counted += is_counted[c]
            if nearest < 0 and is_counted[c]:
                nearest = c
        if nearest < 0:
            nearest, counted, is_counted[best] = best, 1, True
        most = 0.0
        for kind in range(kinds):
            most = max(most, kind_light[kind])
        chosen_kind = -1
        for kind in range(kinds):
            if kind_light[kind] < most * (1.0 - EQUAL):
                continue
            earlier = 0 if chosen_kind < 0 else kind_target[kind] - kind_target[chosen_kind]
            if chosen_kind >= 0 and earlier == 0:
                earlier = kind_part[kind] - kind_part[chosen_kind]
            if chosen_kind < 0 or earlier < 0:
                chosen_kind = kind
        enough, chosen = kind_most[chosen_kind] * (1.0 - EQUAL), -1
        for k in range(start, stop):
            h = hit[k]
            if cluster[k] != best or target[h] != kind_target[chosen_kind] or part[h] != kind_part[chosen_kind]:
                continue
            light = photons[k] if bright[best] > 0.0 else weight[h]
            if light >= enough and (chosen < 0 or h < chosen):
                chosen = h
        written.photons[at] = total
        written.range_m[at], written.first_range_m[at] = mean_range_m[best], mean_range_m[nearest]
        written.cluster_count[at] = min(counted, 255)
        written.target[at], written.part[at] = kind_target[chosen_kind], kind_part[chosen_kind]
        written.facet[at], written.cos_incidence[at] = facet[chosen], cos_incidence[chosen]
        start, first = stop, last + 1
    return mean_range_m, bright, is_counted
