"""Search for events: the spans in which a smooth function of time is negative, and its minima.

A function whose rate is bounded is searched by `find_bounded_spans`: an interval is divided until its bound excludes a
change of sign. A function without a known rate is searched by `find_spans_below`, which follows its dips.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Protocol

import numpy as np

from rso_lidar.errors import warn

_SCAN_S = 60.0
_PARTS = 16  # equal parts into which a bracket is divided
_WITHIN_S = 1e-4
_NODES = 129  # instants among which a minimum is bracketed
_MINIMUM_SPAN_S = (_NODES - 1) * _SCAN_S  # longer spans are divided, so that no orbit is skipped
_AT_ONCE = 100_000  # instants evaluated in one call
_POSITIVE = 1e300  # stands for what is not finite
_FINEST_S = 0.1  # intervals are not divided below this
_SPLIT = 4  # parts of an interval in which the sign may change
_MOST = 2_000_000  # instants of one search; with them a week is searched every 0.3 s

Span = tuple[float, float]


class BoundedFunction(Protocol):
    """A function of time with a bound on its change between two instants."""

    def sample(self, time_s: np.ndarray) -> np.ndarray:
        """Return rows (time, n) at instants (time,) [s]: the value first, then whatever the bound needs.

        Parameters
        ----------
        time_s : instants [s]
        """
        ...

    def bound_change(self, low: np.ndarray, high: np.ndarray, step_s: np.ndarray) -> np.ndarray:
        """Return the greatest change of the value along each interval (interval,).

        Parameters
        ----------
        low, high : (interval, n) rows at both ends
        step_s : (interval,) lengths [s]
        """
        ...


def find_bounded_spans(function: BoundedFunction, windows: Sequence[Span], scan_s: float = _SCAN_S) -> list[Span]:
    """Find the spans within some windows in which a function of bounded rate is negative.

    Windows are divided into intervals of `scan_s` at most. An interval is divided further while its bound allows a change
    of sign, down to 0.1 s. So no span or gap of 0.1 s is missed, however coarse the scan is.

    Parameters
    ----------
    function : with its bound; a value that is not finite counts as positive
    windows : spans to search, in order [s]
    scan_s : greatest step of the first scan [s]

    Returns
    -------
    list of (begin, end)
        [s] to 0.1 ms, in order; spans end at the ends of the windows
    """
    windows = [(begin, end) for begin, end in windows if end > begin]
    if not windows:
        return []
    number, time_s, values = _divide_windows(function, windows, scan_s)
    below = values < 0.0
    same = number[1:] == number[:-1]
    turns = np.flatnonzero((below[1:] != below[:-1]) & same)
    crossed = _find_crossings(lambda at: _clean(function.sample(at))[:, 0], time_s[turns], time_s[turns + 1])
    first = np.concatenate([[True], ~same])
    last = np.concatenate([~same, [True]])
    begins = np.sort(np.concatenate([crossed[below[turns + 1]], time_s[first & below]]))
    ends = np.sort(np.concatenate([crossed[below[turns]], time_s[last & below]]))
    return list(zip(begins.tolist(), ends.tolist(), strict=True))


def join_spans(spans: Sequence[Span], gap_s: float = 1e-3) -> list[Span]:
    """Join spans that overlap or follow each other, such as those of neighbouring windows.

    Parameters
    ----------
    spans : in any order [s]
    gap_s : greatest gap between two that are joined [s]

    Returns
    -------
    list of (begin, end)
        in order

    >>> join_spans([(4.0, 5.0), (0.0, 2.0), (2.0, 3.0)])
    [(0.0, 3.0), (4.0, 5.0)]
    """
    joined: list[Span] = []
    for begin, end in sorted(spans):
        if joined and begin <= joined[-1][1] + gap_s:
            joined[-1] = joined[-1][0], max(end, joined[-1][1])
        else:
            joined.append((begin, end))
    return joined


def _divide_windows(
    function: BoundedFunction, windows: Sequence[Span], scan_s: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Sample windows so densely that no change of sign hides between two instants.

    Returns
    -------
    number of the window, instant [s] and value, in order of time
    """
    grids = [np.linspace(*window, max(int(np.ceil((window[1] - window[0]) / scan_s)), 1) + 1) for window in windows]
    number = np.repeat(np.arange(len(grids)), [len(grid) for grid in grids])
    time_s = np.concatenate(grids)
    rows = _sample(function, time_s)
    held = [(number, time_s, rows[:, 0])]
    count = len(time_s)
    inner = np.flatnonzero(number[1:] == number[:-1])
    low_s, high_s, low, high, which = time_s[inner], time_s[inner + 1], rows[inner], rows[inner + 1], number[inner]
    parts = np.arange(1, _SPLIT) / _SPLIT
    while True:
        step_s = high_s - low_s
        may_turn = np.abs(low[:, 0]) + np.abs(high[:, 0]) <= function.bound_change(low, high, step_s)
        doubtful = (step_s > _FINEST_S) & (may_turn | ((low[:, 0] < 0.0) != (high[:, 0] < 0.0)))
        low_s, high_s, low, high, which = (of[doubtful] for of in (low_s, high_s, low, high, which))
        if not len(low_s):
            break
        count += len(low_s) * len(parts)
        if count > _MOST:
            warn(
                f"events: a condition stays near its limit for hours; it is searched every {np.max(high_s - low_s):.2g} s "
                "there, so that shorter events can be missed; change its limit, or search fewer days"
            )
            break
        inside_s = low_s[:, None] + (high_s - low_s)[:, None] * parts
        between = _sample(function, inside_s.ravel()).reshape(len(low_s), len(parts), -1)
        held.append((np.repeat(which, len(parts)), inside_s.ravel(), between[..., 0].ravel()))
        nodes_s = np.concatenate([low_s[:, None], inside_s, high_s[:, None]], axis=1)
        nodes = np.concatenate([low[:, None], between, high[:, None]], axis=1)
        low_s, high_s = nodes_s[:, :-1].ravel(), nodes_s[:, 1:].ravel()
        low, high = (of.reshape(len(low_s), -1) for of in (nodes[:, :-1], nodes[:, 1:]))
        which = np.repeat(which, _SPLIT)
    number, time_s, values = (np.concatenate(column) for column in zip(*held, strict=True))
    order = np.lexsort((time_s, number))
    return number[order], time_s[order], values[order]


def _sample(function: BoundedFunction, time_s: np.ndarray) -> np.ndarray:
    """Sample a function in lots that fit the memory."""
    lots = [_clean(function.sample(time_s[k : k + _AT_ONCE])) for k in range(0, len(time_s), _AT_ONCE)]
    return np.concatenate(lots)


def _clean(rows: np.ndarray) -> np.ndarray:
    """Replace values that are not finite by a positive one."""
    rows[~np.isfinite(rows[:, 0]), 0] = _POSITIVE
    return rows


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

    All dips among 129 instants, or among instants a minute apart at most, are followed to their bottoms.

    Parameters
    ----------
    value : function of instants (time,) [s] that returns (time,)
    start_s, end_s : first and last instant [s]

    Returns
    -------
    instant [s] to 0.1 ms, and the value there
    """
    found_s, values = find_minima(value, np.array([start_s]), np.array([end_s]))
    return float(found_s[0]), float(values[0])


def find_minima(
    value: Callable[[np.ndarray], np.ndarray], start_s: np.ndarray, end_s: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Find the least value of a smooth function in each of several spans, as `find_minimum` does.

    Parameters
    ----------
    value : function of instants (time,) [s] that returns (time,)
    start_s, end_s : (span,) first and last instants [s]

    Returns
    -------
    instants (span,) [s] to 0.1 ms, and the values there
    """
    parts = np.maximum(np.ceil((end_s - start_s) / _MINIMUM_SPAN_S), 1.0).astype(np.int64)
    span = np.repeat(np.arange(len(parts)), parts)
    part, length_s = np.arange(len(span)) - (np.cumsum(parts) - parts)[span], (end_s - start_s) / parts
    begin_s = start_s[span] + part * length_s[span]
    stop_s = np.where(part + 1 == parts[span], end_s[span], start_s[span] + (part + 1) * length_s[span])
    time_s = np.linspace(begin_s, stop_s, _NODES, axis=1)
    values = value(time_s.ravel()).reshape(time_s.shape)
    beside = np.pad(values, ((0, 0), (1, 1)), constant_values=np.inf)
    is_dip = (values < beside[:, :-2]) & (values <= beside[:, 2:])
    is_dip[np.arange(len(values)), np.argmin(values, axis=1)] = True  # also where values are not finite
    row, node = np.nonzero(is_dip)
    found_s, values = _narrow_to_minimum(
        value, time_s[row, np.maximum(node - 1, 0)], time_s[row, np.minimum(node + 1, _NODES - 1)]
    )
    order = np.lexsort((values, span[row]))
    least = order[np.searchsorted(span[row][order], np.arange(len(parts)))]
    return found_s[least], values[least]


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
