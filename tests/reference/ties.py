"""Choices in groups among numbers that are equal to rounding, in NumPy: for the oracles of kernels that choose."""

import numpy as np

from rso_lidar.ties import EQUAL


def find_first_greatest_of_each(values: np.ndarray, starts: np.ndarray) -> np.ndarray:
    """Return the index of the first greatest value, equal ones to rounding, in each group.

    Parameters
    ----------
    values : (n), none below zero, group after group.
    starts : (group), where each group begins in `values`.

    Returns
    -------
    (group), indices in `values`.
    """
    sizes = np.diff(starts, append=len(values))
    enough = np.repeat(np.maximum.reduceat(values, starts) * (1.0 - EQUAL), sizes)
    where = np.flatnonzero(values >= enough)
    group = np.repeat(np.arange(len(starts)), sizes)[where]
    chosen: np.ndarray = where[np.flatnonzero(np.diff(group, prepend=-1))]
    return chosen
