"""Place of a pulse that clips so far that hardly a sample of it is left: from its edges on both sides of the plateau.

The first edge gives a place for each height of the pulse, the last edge another. Both agree at one height. Where the last
edge lies beyond the stored samples, the steepness of the first one tells the height, less well: a Gaussian flank is steeper
the farther it is from the peak. The place is then the mean over all heights that the samples allow. A pulse of known shape
is assumed, as for the matched filter, down to 1e-10 of its peak.
"""

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from rso_lidar.detector.ranging.matched_filter import Matched
from rso_lidar.detector.ranging.peaks import find_plateau
from rso_lidar.kernels import kernel, packed

_DEEPEST = 32.0  # nepers below the peak, to which edges are tabulated
_EDGE_POINTS = 1024
_TABLE_FROM = 1e-6  # of the peak; below it, edges are continued
_LEAST_HEIGHT, _MOST_HEIGHT = 0.02, 23.0  # of the pulse over the level that clips [nepers]
_HEIGHTS = 256
_CLEAR = 4.0  # times the noise, from which a sample shows an edge
_RARER = math.log(2.0) / math.log(10.0)  # assumed: returns ten times as strong are half as likely
_MODEL_SHARE = 0.02  # relative error of an edge's samples: shot noise, and the shape


class Edges(NamedTuple):
    """When a pulse passes levels: `rise` and `fall` (level) [samples after its peak], at even steps of the logarithm.

    The first level is the peak. `per_neper` is the number of levels in a neper.
    """

    rise: np.ndarray
    fall: np.ndarray
    per_neper: float


def tabulate_edges(matched: Matched, recovery_s: float) -> Edges:
    """Tabulate the edges of a pulse behind an amplifier that recovers slowly from saturation.

    Below a millionth of the peak the first edge is continued as a Gaussian flank, the last one as an exponential tail.
    """
    pulse = matched.pulse
    time = (pulse.from_s - pulse.peak_s + pulse.step_s * np.arange(len(pulse.table))) / matched.sample_s
    step, table = time[1] - time[0], np.maximum(pulse.table / pulse.peak, 0.0)
    if recovery_s > 0.0:
        beyond = np.arange(1, math.ceil(_DEEPEST * recovery_s / pulse.step_s) + 1)
        time, table = np.append(time, time[-1] + step * beyond), np.append(table, np.zeros(len(beyond)))
        growth = pulse.step_s / recovery_s * np.arange(len(table))
        table = np.exp(np.maximum.accumulate(np.log(np.maximum(table, 1e-30)) + growth) - growth)
    top = int(table.argmax())
    level = np.linspace(0.0, -_DEEPEST, _EDGE_POINTS)
    first = np.flatnonzero(table[:top] > _TABLE_FROM)[0]
    last = top + np.flatnonzero(table[top:] > _TABLE_FROM)[-1]
    flank, tail = slice(first, top + 1), slice(top, last + 1)
    rise = np.interp(level, np.log(table[flank]), time[flank])
    fall = np.interp(-level, -np.log(table[tail]), time[tail])
    # ln s = c − (t − m)²/2σ² on the flank, and ln s = c − t/τ in the tail, through three and two points.
    at = np.searchsorted(time, np.array([0.0, 0.15, 0.3]) * (time[top] - time[first]) + time[first])
    bend, slope, height = np.polyfit(time[at], np.log(table[at]), 2)
    deep = level < np.log(table[first])
    rise[deep] = (-slope + np.sqrt(slope**2 - 4.0 * bend * (height - level[deep]))) / (2.0 * bend)
    inner = int(np.searchsorted(time, 0.8 * time[last] + 0.2 * time[top]))
    per_neper = (time[last] - time[inner]) / np.log(table[inner] / table[last])
    deep = level < np.log(table[last])
    fall[deep] = time[last] + per_neper * (np.log(table[last]) - level[deep])
    return Edges(rise, fall, (_EDGE_POINTS - 1) / _DEEPEST)


def locate_clipped_pulses(
    samples: np.ndarray,
    clipped: np.ndarray,
    peak: np.ndarray,
    place: np.ndarray,
    matched: Matched,
    edges: Callable[[], Edges],
    sigma_counts: float,
    recovery_s: float = 0.0,
) -> np.ndarray:
    """Return the places (trace) [samples] of pulses, from their edges where they clip so far that a fit has too few samples.

    A fit needs three samples of the pulse that do not clip. Behind an amplifier that recovers slowly from saturation, the
    pulse behind the plateau has another shape: there the edges give the place of any clipped pulse.

    Parameters
    ----------
    samples : (trace, sample) [counts] above the baseline
    clipped : (trace, sample) samples at the rail
    peak : (trace) sample of the peak; the plateau around it is looked at
    place : (trace) fitted place [samples]
    edges : of its pulse, asked for where one is needed
    """
    trace = np.flatnonzero(clipped[np.arange(len(peak)), peak])
    if recovery_s <= 0.0 and len(trace):
        sample = np.rint(place[trace]).astype(np.int64)[:, None] + np.arange(-matched.half, matched.half + 1)
        inside = (sample >= 0) & (sample < samples.shape[1])
        shown = np.take_along_axis(~clipped[trace], np.clip(sample, 0, samples.shape[1] - 1), axis=1)
        trace = trace[(shown & inside & matched.in_pulse).sum(axis=1) < 3]
    corrected = np.array(place, float)
    if len(trace):
        place_by_edges(
            packed(samples, np.float32),
            packed(clipped, np.bool_),
            trace,
            peak,
            float(sigma_counts),
            *edges(),
            corrected,
        )
    return corrected


@kernel
def read_edge(edge: np.ndarray, per_neper: float, level: float) -> float:
    """Return when an edge passes a level [samples after the peak].

    Parameters
    ----------
    edge, per_neper : one of those of `Edges`, and the number of levels in a neper
    """
    at = min(max(-level * per_neper, 0.0), edge.shape[0] - 1.000001)
    k = int(at)
    passed: float = edge[k] + (at - k) * (edge[k + 1] - edge[k])
    return passed


@kernel
def read_level(edge: np.ndarray, per_neper: float, time: float) -> float:
    """Return the logarithm of the level over the peak of a rising edge at a time [samples after the peak].

    Parameters
    ----------
    edge, per_neper : `rise` of `Edges`, and the number of levels in a neper
    time : [samples after the peak]
    """
    low, high = 0, edge.shape[0] - 1  # the edge at `low` is later
    place: float = high
    if time <= edge[high]:
        return -place / per_neper
    while high - low > 1:
        middle = (low + high) // 2
        if edge[middle] > time:
            low = middle
        else:
            high = middle
    share = (edge[low] - time) / max(edge[low] - edge[high], 1e-12)
    place = low + min(max(share, 0.0), 1.0)
    return -place / per_neper


@kernel
def place_by_edges(
    samples: np.ndarray,
    clipped: np.ndarray,
    traces: np.ndarray,
    peak: np.ndarray,
    sigma: float,
    rise: np.ndarray,
    fall: np.ndarray,
    per_neper: float,
    place: np.ndarray,
) -> None:
    """Write the places of clipped pulses.

    Parameters
    ----------
    samples, clipped : (trace, sample)
    traces : numbers of the traces to work on
    peak : (trace) a sample of the plateau
    sigma : rms of the noise [counts]
    rise, fall, per_neper : those of `Edges`
    place : (trace) [samples], written for `traces`; unchanged where the trace begins on the plateau
    """
    n, clear = samples.shape[1], _CLEAR * sigma
    for trace in traces:
        low, high = find_plateau(clipped, trace, peak[trace])
        if low == 0:
            continue
        level = np.float64(samples[trace, peak[trace]])
        before = math.log(min(max(np.float64(samples[trace, low - 1]), clear), level) / level)
        if high < n - 1:
            after = math.log(min(max(np.float64(samples[trace, high + 1]), clear), level) / level)
            least, most = _LEAST_HEIGHT, _MOST_HEIGHT
            for _ in range(40):
                height = 0.5 * (least + most)
                first = low - 1 - read_edge(rise, per_neper, before - height)
                last = high + 1 - read_edge(fall, per_neper, after - height)
                if first < last:  # higher pulses are wider
                    least = height
                else:
                    most = height
            place[trace] = 0.5 * (first + last)
            continue
        total, moment, farthest = 0.0, 0.0, np.nan
        for k in range(_HEIGHTS):
            height = _LEAST_HEIGHT + (_MOST_HEIGHT - _LEAST_HEIGHT) * k / (_HEIGHTS - 1)
            at = low - 1 - read_edge(rise, per_neper, before - height)
            farthest = at
            if at + read_edge(fall, per_neper, -height) < n - 1 or low < 2:
                continue
            expected = level * math.exp(min(height + read_level(rise, per_neper, low - 2 - at), 0.0))
            off = samples[trace, low - 2] - expected
            variance = sigma * sigma + 1.0 / 12.0 + (_MODEL_SHARE * expected) ** 2
            weight = math.exp(-_RARER * height - 0.5 * off * off / variance)
            total += weight
            moment += weight * at
        place[trace] = moment / total if total > 0.0 else farthest
