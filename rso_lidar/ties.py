"""Choices among numbers that are equal to rounding: the first of them is chosen, on every processor."""

import numpy as np

# Numbers closer than this share of the greater are equal where one of them is chosen. A pixel's light is a sum with rounding
# of 1e-13, and inputs off by 1e-12 change a cosine of 0.001 by 1e-9 of itself. No measurement tells such numbers apart.
EQUAL = 1e-9


def find_first_greatest(values: np.ndarray) -> int:
    """Return the index of the greatest of some values (n); of those that are equal to rounding, the first."""
    most = values.max()
    return int(np.argmax(values >= most - EQUAL * abs(most)))


def find_first_least(values: np.ndarray) -> int:
    """Return the index of the least of some values (n); of those that are equal to rounding, the first."""
    return find_first_greatest(-values)
