"""Fit of the matched filter to one pulse of one trace, by Gauss-Newton iterations.

`samples` (sample) are those of one trace; `clipped` (trace, sample) marks samples at the rail, and is empty without any.
"""

import numpy as np

from rso_lidar.detector.ranging.matched_filter import CODE, CODES_BEFORE, IS_IN_PULSE, PHASES
from rso_lidar.kernels import kernel


@kernel
def find_key(clipped: np.ndarray, trace: int, window: int, low: int, high: int, codes: np.ndarray) -> np.int64:
    """Return the key of the samples that are not clipped, or of all where fewer than three of the others are in the pulse.

    Parameters
    ----------
    codes : those of `fitting.Filter`
    """
    key, shown = np.int64(0), 0
    if clipped.shape[0]:
        for sample in range(low, high):
            if not clipped[trace, sample]:
                key ^= codes[CODE, sample - window + 1]
                shown += codes[IS_IN_PULSE, sample - window + 1]
    return key if shown >= 3 else codes[CODES_BEFORE, high - window] ^ codes[CODES_BEFORE, low - window]


@kernel
def iterate_fit(
    samples: np.ndarray,
    clipped: np.ndarray,
    trace: int,
    guess: float,
    rounds: int,
    half: int,
    codes: np.ndarray,
    keys: np.ndarray,
    weights: np.ndarray,
) -> tuple[float, float, np.int64]:
    """Fit one pulse by Gauss-Newton iterations.

    Parameters
    ----------
    guess : place to begin at [samples]
    rounds, half, codes : those of `fitting.Filter`

    Returns
    -------
    Place [samples], height and 0; or, in place of 0, the key of a pattern whose weights are not known at this place.
    """
    n, last = samples.shape[0], keys.shape[0] - 1
    place, height, before = guess, 0.0, np.int64(-1) << 40
    for _ in range(rounds):
        step = np.int64(np.rint(place * PHASES)) + PHASES // 2
        if step == before:  # and so would all that follows be
            break
        before = step
        middle = min(max(step // PHASES, 0), n - 1)
        phase = min(max(step - middle * PHASES, 0), PHASES - 1)
        low, high, window = max(middle - half, 0), min(middle + half + 1, n), middle - half
        key = find_key(clipped, trace, window, low, high, codes)
        pattern = last if keys[last] <= key else np.searchsorted(keys, key)
        if keys[pattern] != key:
            return place, height, key
        height, moment = 0.0, 0.0
        for sample in range(low, high):
            value = np.float64(samples[sample])
            height += value * weights[pattern, phase, 0, sample - window]
            moment += value * weights[pattern, phase, 1, sample - window]
        shift = moment / height if height > 0.0 else 0.0
        here = middle + (phase - PHASES // 2) / PHASES
        place = min(max(here + min(max(shift, -0.75), 0.75), -0.5), n - 0.5)
    return place, height, np.int64(0)


@kernel
def fit_pulse(
    samples: np.ndarray,
    clipped: np.ndarray,
    trace: int,
    guess: float,
    rounds: int,
    half: int,
    fwhm: float,
    codes: np.ndarray,
    keys: np.ndarray,
    weights: np.ndarray,
) -> tuple[float, float, np.int64]:
    """Fit the pulse nearest to a guess; keep the guess where the fit diverges.

    Parameters
    ----------
    samples, clipped, trace, guess, rounds, half, codes : as for `iterate_fit`

    Returns
    -------
    Place [samples], height, and the key of a pattern that is not known, or 0.
    """
    place, height, unknown = iterate_fit(samples, clipped, trace, guess, rounds, half, codes, keys, weights)
    if unknown == 0 and not (height > 0.0 and abs(place - guess) <= max(1.0, fwhm)):
        nearest = min(max(np.int64(np.rint(guess)), 0), samples.shape[0] - 1)
        return guess, np.float64(samples[nearest]), unknown
    return place, height, unknown
