"""How time is taken: in turns, so that what else the machine does hits all alike; wall clock or CPU."""

import math
import multiprocessing
import time
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from typing import Any

import numpy as np

SLOT_S = 0.06  # one turn lasts so long at least: short works are repeated in it

Work = Callable[[], Any]
Timer = Callable[[], float]


def seconds(work: Work, times: int = 1, timer: Timer = time.perf_counter) -> float:
    """Return the seconds that one call takes, on the average over `times`."""
    start = timer()
    for _ in range(times):
        work()
    return (timer() - start) / times


def pairs(ours: Work, peer: Work, n: int, timer: Timer = time.perf_counter) -> np.ndarray:
    """Return the seconds (pair, ours_peer) of two works that take turns, both warm."""
    works = (ours, peer)
    times = []
    for work in works:
        work()
        times.append(math.ceil(SLOT_S / max(seconds(work, 1, timer), 1e-6)))
    return np.array([[seconds(work, many, timer) for work, many in zip(works, times, strict=True)] for _ in range(n)])


def quartiles(values: np.ndarray, form: str = ".2f") -> str:
    """Return the median of some values and, in brackets, their quartiles."""
    low, middle, high = np.percentile(values, (25, 50, 75))
    return f"{middle:{form}} ({low:{form}} to {high:{form}})"


def fresh(function: Callable[..., Any], *arguments: Any) -> Any:
    """Return what a function of a module gives in a new process, which knows nothing yet."""
    with ProcessPoolExecutor(1, mp_context=multiprocessing.get_context("spawn")) as process:
        return process.submit(function, *arguments).result()
