"""Minima of a sampled range that are no rounding: those between which the range rises by more than it is known."""

from __future__ import annotations

import numpy as np

EQUAL_M = (
    1e-4  # minima that differ by less are equal: rounding in SGP4 alone moves a position by some 1e-7 m after days
)


def select_distinct_minima(range_m: np.ndarray, at: np.ndarray) -> np.ndarray:
    """Return the minima that a rise of more than `EQUAL_M` separates from the one before; of others the first least one.

    Two bodies on one circle have a constant distance, and many minima of rounding, of which one is left.

    Parameters
    ----------
    range_m : (node,) range at ascending instants [m]
    at : (minimum,) ascending indices of its minima, one or more
    """
    kept = [int(at[0])]
    for one in at[1:].tolist():
        rise_m = range_m[kept[-1] : one + 1].max() - max(range_m[kept[-1]], range_m[one])
        if rise_m > EQUAL_M:
            kept.append(one)
        elif range_m[one] < range_m[kept[-1]] - EQUAL_M:
            kept[-1] = one
    return np.array(kept)
