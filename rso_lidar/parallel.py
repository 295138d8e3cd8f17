"""Pieces of one task on threads: the results do not depend on how many threads there are."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import lru_cache
from typing import Any


def run_in_threads(threads: int | None, work: Callable[[Any], Any], pieces: Sequence[Any]) -> list[Any]:
    """Call `work` with each piece on several threads, of which the caller's is one; return the results in order.

    The caller begins with the last piece and the others with the first, so that a few pieces do not wait for a thread.

    Parameters
    ----------
    threads : number of threads (None: one for each core)
    work : called with one piece
    pieces : the arguments
    """
    helpers = min(threads or os.cpu_count() or 1, len(pieces)) - 1
    if helpers < 1:
        return [work(piece) for piece in pieces]
    started = [_pool(helpers).submit(work, piece) for piece in pieces]
    results = [
        work(piece) if future.cancel() else future.result()
        for future, piece in zip(started[::-1], pieces[::-1], strict=True)
    ]
    return results[::-1]


@lru_cache(maxsize=8)
def _pool(threads: int) -> ThreadPoolExecutor:
    return ThreadPoolExecutor(max_workers=threads, thread_name_prefix="rso_lidar")
