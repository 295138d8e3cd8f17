"""Clusters: the returns of a pixel that the depth of one surface joins."""

import numpy as np

from rso_lidar.kernels import kernel
from rso_lidar.optics.sorting import sort_by


@kernel
def find_clusters(
    pixel: np.ndarray, delay_s: np.ndarray, depth_spread_s: np.ndarray, gap_s: float
) -> tuple[np.ndarray, np.ndarray]:
    """Find the clusters of returns in each pixel, numbered by pixel and then from near to far.

    Neighbours in delay are in different clusters if the gap between them is too wide: wider than `gap_s` plus the depth
    spread of the less steep of their surfaces. A tilted surface is one cluster, however far apart its rays land. A rim
    before a wall is not.

    Parameters
    ----------
    pixel : (return), never falling
    delay_s, depth_spread_s : (return)
    gap_s : the gap that separates clusters

    Returns
    -------
    The cluster of each return, and the pixel of each cluster.
    """
    n = len(pixel)
    cluster, cluster_pixel = np.empty(n, np.int32), np.empty(n, np.int32)
    order, sorted_s = np.empty(n, np.int64), np.empty(n)
    spare = np.empty(n, np.int64), np.empty(n)
    number, start = 0, 0
    while start < n:
        stop, near, far = start, delay_s[start], delay_s[start]
        while stop < n and pixel[stop] == pixel[start]:
            near, far = min(near, delay_s[stop]), max(far, delay_s[stop])
            stop += 1
        cluster_pixel[number] = pixel[start]
        if far - near <= gap_s:
            cluster[start:stop] = number
        else:
            for k in range(start, stop):
                order[k], sorted_s[k] = k, delay_s[k]
            sort_by(sorted_s, order, spare, start, stop)
            cluster[order[start]] = number
            for k in range(start + 1, stop):
                before, this = order[k - 1], order[k]
                bridged = min(depth_spread_s[before], depth_spread_s[this])
                if (delay_s[this] - delay_s[before]) - bridged > gap_s:
                    number += 1
                    cluster_pixel[number] = pixel[start]
                cluster[this] = number
        number += 1
        start = stop
    return cluster, cluster_pixel[:number].copy()
