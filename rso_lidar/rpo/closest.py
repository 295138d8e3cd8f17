"""The least distance to the origin along a path: sampled, then refined about each place where it may be least."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

_FINER = 21  # samples of one round of refinement
_ROUNDS = 12


def closest(
    path: Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]],
    begin_s: float,
    from_s: float,
    to_s: float,
    step_s: float,
) -> tuple[float, float]:
    """Return the least distance [m] of a path from the origin, and `begin_s` plus the path's own time of it [s].

    `path` gives position [m] and velocity [m/s] (time, 3); it is looked at every `step_s` from `from_s` to `to_s`, and
    about each local minimum finer and finer, down to a millionth of the step.
    """
    times = (
        np.linspace(from_s, to_s, max(2, int(np.ceil((to_s - from_s) / step_s)) + 1))
        if to_s > from_s
        else np.array([from_s])
    )
    distance = _distance(path, times)
    fenced = np.concatenate([[np.inf], distance, [np.inf]])
    least = np.flatnonzero((distance <= fenced[:-2]) & (distance <= fenced[2:]))
    if len(least) > 64:  # a path that stands still is nearest everywhere
        least = least[np.argsort(distance[least], kind="stable")[:64]]
    best = min((float(distance[k]), float(times[k])) for k in least)
    if len(times) > 1:
        width, centre = np.full(len(least), times[1] - times[0]), times[least]
        for _ in range(_ROUNDS):
            finer = np.clip(centre[:, None] + width[:, None] * np.linspace(-1.0, 1.0, _FINER), from_s, to_s)
            values = _distance(path, finer.ravel()).reshape(finer.shape)
            chosen = np.argmin(values, axis=1)
            rows = np.arange(len(least))
            centre, width = finer[rows, chosen], width * 2.0 / (_FINER - 1)
            best = min(best, *zip(values[rows, chosen].tolist(), centre.tolist(), strict=True))
            if width[0] < 1e-6 * step_s:
                break
    return best[0], begin_s + best[1]


def _distance(path: Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]], times: np.ndarray) -> np.ndarray:
    position, _ = path(times)
    distance: np.ndarray = np.sqrt(np.sum(position * position, axis=-1))
    return distance
