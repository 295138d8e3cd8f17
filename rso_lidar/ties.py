"""The greatest or least of numbers that may differ by rounding only; of equal ones the first, on every processor."""

import numpy as np

# Relative difference below which two numbers count as equal. A pixel's light is a sum with a relative rounding error of
# 1e-13, and an input error of 1e-12 changes a cosine of 0.001 by 1e-9 of itself. Both are far below what can be measured.
EQUAL = 1e-9


def find_first_greatest(values: np.ndarray) -> int:
    """Return the index of the greatest value of an array (n); the first of those equal to within `EQUAL`."""
    most = values.max()
    return int(np.argmax(values >= most - EQUAL * abs(most)))


def find_first_least(values: np.ndarray) -> int:
    """Return the index of the least value of an array (n); the first of those equal to within `EQUAL`."""
    return find_first_greatest(-values)
