"""Rays in bands, and bands on threads: what a band gives does not depend on how many there are."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import lru_cache
from typing import Any

# What ranges are good to: a facet through the lidar's own place has no range, and would return light without end.
NEAREST_M = 1e-6
BAND_RAYS = 8_192  # half a millisecond of casting in packets: long against the hand-over to a thread


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
