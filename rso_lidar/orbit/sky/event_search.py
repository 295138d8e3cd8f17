"""Search for events: the spans in which a smooth function of time is negative, and its minima."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

_SCAN_S = 60.0
_PARTS = 16  # equal parts into which a bracket is divided
_WITHIN_S = 1e-4
_AT_ONCE = 100_000  # instants evaluated in one call


def find_spans_below(
    value: Callable[[np.ndarray], np.ndarray], start_s: float, end_s: float, scan_s: float = _SCAN_S
) -> list[tuple[float, float]]:
    """Find the spans in which a smooth function is negative.

    The function is scanned every `scan_s` at most. Each dip between instants of the scan is followed to its bottom, so
    that a short span is not missed.

    Parameters
    ----------
    value : function of instants (time,) [s] that returns (time,)
    start_s, end_s : first and last instant [s]
    scan_s : greatest step of the scan [s]

    Returns
    -------
    list of (begin, end)
        [s] to 0.1 ms. A span that holds at the start begins at -inf, and one that holds at the end lasts to inf
    """
    time_s = np.linspace(start_s, end_s, max(3, int(np.ceil((end_s - start_s) / scan_s)) + 1))
    values = np.concatenate([value(time_s[k : k + _AT_ONCE]) for k in range(0, len(time_s), _AT_ONCE)])
    if end_s <= start_s:
        return [(-np.inf, np.inf)] if values[0] < 0.0 else []
    bottoms_s, bottoms = _find_dips(value, time_s, values)
    order = np.argsort(time_s := np.concatenate([time_s, bottoms_s]), kind="stable")
    time_s, below = time_s[order], np.concatenate([values, bottoms])[order] < 0.0
    turns = np.flatnonzero(below[1:] != below[:-1])
    crossed = _find_crossings(value, time_s[turns], time_s[turns + 1])
    begins = [
        *([-np.inf] if below[0] else []),
        *(float(t) for t, k in zip(crossed, turns, strict=True) if below[k + 1]),
    ]
    ends = [*(float(t) for t, k in zip(crossed, turns, strict=True) if below[k]), *([np.inf] if below[-1] else [])]
    return list(zip(begins, ends, strict=True))


def find_minimum(value: Callable[[np.ndarray], np.ndarray], start_s: float, end_s: float) -> tuple[float, float]:
    """Find the least value of a smooth function between two instants.

    The lowest of 129 instants is followed to the bottom of its dip.

    Parameters
    ----------
    value : function of instants (time,) [s] that returns (time,)
    start_s, end_s : first and last instant [s]

    Returns
    -------
    instant [s] to 0.1 ms, and the value there
    """
    time_s = np.linspace(start_s, end_s, 129)
    lowest = int(np.argmin(value(time_s)))
    found_s, values = _narrow_to_minimum(value, time_s[[max(lowest - 1, 0)]], time_s[[min(lowest + 1, 128)]])
    return float(found_s[0]), float(values[0])


def _find_dips(
    value: Callable[[np.ndarray], np.ndarray], time_s: np.ndarray, values: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Follow the dips of a scan that may reach below zero between its instants to their bottoms: instants and values."""
    before = np.concatenate([[np.inf], values[:-1]])
    after = np.concatenate([values[1:], [np.inf]])
    # between its instants a round dip is deeper by a quarter of its rise beside them, a sharp one by half; the ends are open
    deep = values <= np.maximum(before, after) - values
    dips = np.flatnonzero((values <= before) & (values <= after) & (values >= 0.0) & deep)
    if not len(dips):
        return np.zeros(0), np.zeros(0)
    return _narrow_to_minimum(value, time_s[np.maximum(dips - 1, 0)], time_s[np.minimum(dips + 1, len(time_s) - 1)])


def _narrow_to_minimum(
    value: Callable[[np.ndarray], np.ndarray], low: np.ndarray, high: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Find where between each low and high the function is least, and its values there.

    Parameters
    ----------
    value : function of instants (time,) [s] with values (time,)
    low, high : (bracket,) ends [s]
    """
    steps = np.arange(_PARTS + 1) / _PARTS
    while True:
        times = low[:, None] + (high - low)[:, None] * steps
        values = value(times.ravel()).reshape(times.shape)
        best = np.argmin(values, axis=1)
        if np.max(high - low) <= _WITHIN_S:
            return np.take_along_axis(times, best[:, None], 1)[:, 0], np.take_along_axis(values, best[:, None], 1)[:, 0]
        low = np.take_along_axis(times, np.maximum(best - 1, 0)[:, None], 1)[:, 0]
        high = np.take_along_axis(times, np.minimum(best + 1, _PARTS)[:, None], 1)[:, 0]


def _find_crossings(value: Callable[[np.ndarray], np.ndarray], low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """Find where between each low and high the function changes sign.

    Parameters
    ----------
    value : function of instants (time,) [s] with values (time,)
    low, high : (bracket,) ends [s], at which its signs differ
    """
    steps = np.arange(_PARTS + 1) / _PARTS
    while len(low) and np.max(high - low) > _WITHIN_S:
        times = low[:, None] + (high - low)[:, None] * steps
        below = value(times.ravel()).reshape(times.shape) < 0.0
        first = np.argmax(below != below[:, :1], axis=1)[:, None]
        first = np.maximum(first, 1)
        low, high = np.take_along_axis(times, first - 1, 1)[:, 0], np.take_along_axis(times, first, 1)[:, 0]
    middle: np.ndarray = 0.5 * (low + high)
    return middle
