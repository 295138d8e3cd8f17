"""Rays in bands, and bands on threads: what a band gives does not depend on how many there are."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import lru_cache
from itertools import pairwise
from typing import Any

import numpy as np

# What ranges are good to: a facet through the lidar's own place has no range, and would return light without end.
NEAREST_M = 1e-6
BAND_RAYS = 8_192  # half a millisecond of casting in packets: long against the hand-over to a thread


def bands_of(pixel: np.ndarray, n_cols: int) -> list[slice]:
    """Return slices of rays that each hold whole rows of pixels, of some `BAND_RAYS` rays."""
    edges = [0]
    while edges[-1] < len(pixel):
        last = min(edges[-1] + BAND_RAYS, len(pixel)) - 1
        next_row = (pixel[last] // n_cols + 1) * n_cols
        edges.append(int(np.searchsorted(pixel, next_row)))
    return [slice(a, b) for a, b in pairwise(edges)]


def at_once(threads: int | None, work: Callable[[Any], Any], pieces: Sequence[Any]) -> list[Any]:
    """Return what work makes of each piece, `threads` at once (None: one for each core); the one that asks is one of them.

    It begins at the end, the others at the beginning: for few pieces nobody waits for a thread to wake up.
    """
    helpers = min(threads or os.cpu_count() or 1, len(pieces)) - 1
    if helpers < 1:
        return [work(piece) for piece in pieces]
    begun = [_pool(helpers).submit(work, piece) for piece in pieces]
    made = [
        work(piece) if future.cancel() else future.result()
        for future, piece in zip(begun[::-1], pieces[::-1], strict=True)
    ]
    return made[::-1]


@lru_cache(maxsize=8)
def _pool(threads: int) -> ThreadPoolExecutor:
    return ThreadPoolExecutor(max_workers=threads, thread_name_prefix="cast")
