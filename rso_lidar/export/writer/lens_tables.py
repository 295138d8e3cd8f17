"""The tables of lines of sight of a recording whose lens changes: each stored once, whenever it is in force."""

from __future__ import annotations

import hashlib
from typing import Any

import numpy as np


class LensTables:
    """The growing /line_of_sight (lens_number, row, col, xyz) of an h5py file, with the numbers that /lens refers to."""

    def __init__(self, file: Any) -> None:
        self._tables, self._numbers = file["line_of_sight"], file["lens_number"]
        self._known: dict[bytes, int] = {}
        self._last: tuple[np.ndarray | None, int] = (None, -1)

    def number(self, line_of_sight: np.ndarray) -> int:
        """Return the number of a table, which is written if it is a new one."""
        if line_of_sight is not self._last[0]:
            table = np.ascontiguousarray(line_of_sight, dtype=self._tables.dtype)
            digest = hashlib.sha256(table.tobytes()).digest()
            if digest not in self._known:
                self._known[digest] = self._append(table)
            self._last = line_of_sight, self._known[digest]
        return self._last[1]

    def _append(self, table: np.ndarray) -> int:
        count = len(self._known)
        for dataset, entry in ((self._tables, table), (self._numbers, count)):
            dataset.resize(count + 1, axis=0)
            dataset[count] = entry
        return count

    def __len__(self) -> int:
        return len(self._known)
