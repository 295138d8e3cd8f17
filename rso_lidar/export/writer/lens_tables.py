"""Lines of sight of a recording whose lens changes, each stored once."""

from __future__ import annotations

import hashlib
from typing import Any

import numpy as np


class LensNumbers:
    """Numbers of lines of sight, in the order of their first use."""

    def __init__(self) -> None:
        self._known: dict[bytes, int] = {}
        self._last: np.ndarray | None = None
        self._number = -1

    def __len__(self) -> int:
        return len(self._known)

    def number(self, line_of_sight: np.ndarray) -> int:
        """Return the number of a line of sight, the next unused one if it is new."""
        if self._last is None or not is_same_memory(line_of_sight, self._last):
            table = np.ascontiguousarray(line_of_sight, dtype=float)
            digest = hashlib.sha256(table.tobytes()).digest()
            self._number = self._known.setdefault(digest, len(self._known))
            self._last = line_of_sight
        return self._number


class LensTables:
    """The growing /line_of_sight (lens_number, row, col, xyz) of an h5py file; /lens refers to its numbers."""

    def __init__(self, file: Any) -> None:
        self._tables, self._dimension = file["line_of_sight"], file["lens_number"]
        self._numbers = LensNumbers()

    def number(self, line_of_sight: np.ndarray) -> int:
        """Return the number of a line of sight, and write it to the file if it is new."""
        count = len(self._numbers)
        number = self._numbers.number(line_of_sight)
        if number == count:
            for dataset, entry in ((self._tables, line_of_sight), (self._dimension, count)):
                dataset.resize(count + 1, axis=0)
                dataset[count] = entry
        return number

    def __len__(self) -> int:
        return len(self._numbers)


def is_same_memory(a: np.ndarray, b: np.ndarray) -> bool:
    """Return whether two arrays are views of the same memory with the same shape, strides and dtype."""
    return a is b or a.__array_interface__ == b.__array_interface__
