"""Rows of numbers that are appended one after the other, of which every earlier state stays valid."""

from __future__ import annotations

from typing import Any

import numpy as np

_KEPT = 2**16  # latest rows that are kept; at steps of 1 ms those of a minute
_LEAST = 64  # rows for which there is room at first; room then doubles


class _Block:
    """Memory for rows, and how many of them are in use.

    Parameters
    ----------
    first : number of the first row
    rows : (row, n), copied
    capacity : number of rows for which there is room
    """

    def __init__(self, first: int, rows: np.ndarray, capacity: int) -> None:
        self.first, self.used = first, len(rows)
        self.rows = np.empty((capacity, rows.shape[1]))
        self.rows[: len(rows)] = rows


class RowHistory:
    """Rows, of which the first has the number `first`, and the last `end` - 1. It does not change.

    Successive states share their memory. Rows are copied if they are appended to a state that was already continued.

    Parameters
    ----------
    block : memory
    count : number of its rows that belong to this state
    """

    def __init__(self, block: _Block, count: int) -> None:
        self._block, self._count = block, count

    @classmethod
    def begin(cls, row: np.ndarray) -> RowHistory:
        """Begin with one row (n,), which has the number 0."""
        return cls(_Block(0, row[None], _LEAST), 1)

    @property
    def first(self) -> int:
        """Number of the first row that is kept."""
        return self._block.first

    @property
    def end(self) -> int:
        """Number after the last row."""
        return self._block.first + self._count

    def read(self, numbers: np.ndarray) -> np.ndarray:
        """Return rows (time, n) by their numbers (time,), from `first` to `end` - 1."""
        rows: np.ndarray = self._block.rows[: self._count][numbers - self._block.first]
        return rows

    def append(self, rows: np.ndarray, *, keep_all: bool) -> RowHistory:
        """Return a history with further rows.

        Parameters
        ----------
        rows : (row, n)
        keep_all : whether early rows are kept when there are many
        """
        block, after = self._block, self._count + len(rows)
        if block.used != self._count or after > len(block.rows):
            dropped = 0 if keep_all else max(self._count - _KEPT, 0)
            kept = block.rows[dropped : self._count]
            block = _Block(block.first + dropped, kept, 2 * max(len(kept) + len(rows), _LEAST))
            after -= dropped
        block.rows[after - len(rows) : after] = rows
        block.used = after
        return RowHistory(block, after)

    def __reduce__(self) -> Any:
        """Pickle the rows of this state alone."""
        return _rebuild, (self._block.first, self._block.rows[: self._count].copy())


def _rebuild(first: int, rows: np.ndarray) -> RowHistory:
    """Return a history of rows."""
    return RowHistory(_Block(first, rows, 2 * max(len(rows), _LEAST)), len(rows))
