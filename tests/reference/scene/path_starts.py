"""Starts of paths in Python: the oracle of `rso_lidar.scene.bounces.path_starts`."""

import numpy as np

from rso_lidar.scene.bounces.path_starts import PATHS
from tests.reference.philox import blocks

ROOT = 1.2207440846057596  # of x^4 = x + 1


def spread_paths(pixel, area, per_pixel, key):
    """Return the hit of each path, and three numbers from 0 to 1 for each (3, path), pixel by pixel."""
    hit, uniform = [], []
    for number in np.unique(pixel):
        of = np.flatnonzero(pixel == number)
        shift = (blocks(key, 0, 0, number, PATHS).astype(float) + 0.5) / 2.0**32
        reached = np.floor(shift[0] + np.cumsum(per_pixel * area[of]))
        count = np.diff(reached, prepend=0.0).astype(int)
        hit.append(np.repeat(of, count))
        step = np.arange(count.sum())[None] * ROOT ** -np.array([[1.0], [2.0], [3.0]])
        uniform.append((shift[1:, None] + step) % 1.0)
    return np.concatenate(hit), np.concatenate(uniform, axis=1)


def draw_numbers(pixel, key, turn):
    """Return three numbers from 0 to 1 (3, path) for the direction number `turn` of each path."""
    place = [k - list(pixel).index(number) for k, number in enumerate(pixel)]
    words = [blocks(key, turn, at, number, PATHS)[:3] for at, number in zip(place, pixel, strict=True)]
    return (np.array(words, float).reshape(-1, 3).T + 0.5) / 2.0**32
