"""The least distance of a path from the origin: sampled, then refined about each local minimum."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from rso_lidar.ties import EQUAL, find_first_least

_FINER = 21  # samples of one round of refinement
_ROUNDS = 12


def find_closest_approach(
    path: Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]],
    begin_s: float,
    from_s: float,
    to_s: float,
    step_s: float,
) -> tuple[float, float]:
    """Find the least distance of a path from the origin.

    It is sampled every `step_s`, and refined about each local minimum down to a millionth of the step. Of equal minima
    the first counts.

    Parameters
    ----------
    path : function of time (time,) [s] that returns position [m] and velocity [m/s] (time, 3)
    begin_s : added to the time that is returned [s]
    from_s, to_s : first and last time of the path [s]
    step_s : step of the samples [s]

    Returns
    -------
    distance [m], and `begin_s` plus the time of it [s]
    """
    times = (
        np.linspace(from_s, to_s, max(2, int(np.ceil((to_s - from_s) / step_s)) + 1))
        if to_s > from_s
        else np.array([from_s])
    )
    distance = _distance(path, times)
    fenced = np.concatenate([[np.inf], distance, [np.inf]])
    lowered = distance * (1.0 - EQUAL)
    least = np.flatnonzero((lowered <= fenced[:-2]) & (lowered <= fenced[2:]))
    if len(least) > 64:  # on a path without motion, every sample is a minimum by rounding
        equal = np.flatnonzero(distance[least] <= distance[least].min() * (1.0 + EQUAL))
        order = np.argsort(distance[least], kind="stable")
        least = least[np.unique(np.concatenate([equal[:1], order[:63]]))]
    best_m, best_s = distance[least], times[least]
    if len(times) > 1:
        rows, width, centre = np.arange(len(least)), np.full(len(least), times[1] - times[0]), best_s
        for k in range(_ROUNDS):
            finer = np.clip(centre[:, None] + width[:, None] * np.linspace(-1.0, 1.0, _FINER), from_s, to_s)
            values = _distance(path, finer.ravel()).reshape(finer.shape)
            if k == 0:  # where the distance is constant, keep its first sample
                varies = np.ptp(values, axis=1) > EQUAL * values.max(axis=1)
            chosen = np.argmin(values, axis=1)
            centre, width = finer[rows, chosen], width * 2.0 / (_FINER - 1)
            lower = varies & (values[rows, chosen] < best_m)
            best_m, best_s = np.where(lower, values[rows, chosen], best_m), np.where(lower, centre, best_s)
            if width[0] < 1e-6 * step_s:
                break
    first = find_first_least(best_m)
    return float(best_m[first]), begin_s + float(best_s[first])


def _distance(path: Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]], times: np.ndarray) -> np.ndarray:
    position, _ = path(times)
    distance: np.ndarray = np.sqrt(np.sum(position * position, axis=-1))
    return distance
