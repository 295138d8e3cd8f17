"""Photons made by hand: what a detector is handed, without a scene."""

import numpy as np

from rso_lidar.records import Photons

RANGE_PER_DELAY_M_S = 299_792_458.0 / 2


def returns(range_m, photons, pixel=None, shape=None, cluster=None, pulse_fwhm_s=8e-9):
    """Return Photons with one return for each range [m], by default one to a pixel, each a cluster of its own."""
    range_m, photons = np.broadcast_arrays(np.atleast_1d(np.asarray(range_m, dtype=float)), photons)
    pixel = np.arange(len(range_m)) if pixel is None else np.asarray(pixel)
    cluster = np.arange(len(range_m)) if cluster is None else np.asarray(cluster)
    first = np.flatnonzero(np.diff(cluster, prepend=-1))
    return Photons(
        shape=(1, len(range_m)) if shape is None else shape,
        pulse_fwhm_s=pulse_fwhm_s,
        pixel=pixel,
        delay_s=range_m / RANGE_PER_DELAY_M_S,
        photons=np.asarray(photons, dtype=float),
        depth_spread_s=np.zeros(len(range_m)),
        cluster=cluster,
        cluster_pixel=pixel[first],
    )


def nothing(shape):
    """Return the photons of an empty scene."""
    empty = np.zeros(0)
    return Photons(shape, 8e-9, empty, empty, empty, empty, empty, empty)
