"""The part of the field that is drawn: a square crop around the target, from a ladder of sizes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

LADDER = (8, 10, 12, 16, 20, 24, 32, 40, 48, 64, 80, 96, 128, 160, 192, 256, 384, 512, 768, 1024)
MARGIN = 1.15  # a crop is at least this much larger than what it shows


@dataclass(frozen=True)
class Window:
    """Rows `top` to `bottom` and columns `left` to `right`, ends excluded, of a field of `n_rows` by `n_cols`.

    Parameters
    ----------
    top, bottom : first row, and one past the last
    left, right : first column, and one past the last
    n_rows, n_cols : size of the field [pixels]
    """

    top: int
    bottom: int
    left: int
    right: int
    n_rows: int
    n_cols: int

    @staticmethod
    def about(mask: np.ndarray) -> Window:
        """Return the square about the True pixels of a mask, with a margin, or the whole field if they fill it.

        Parameters
        ----------
        mask : (row, col) bool; without a True pixel the window is the whole field
        """
        return crop(bounding_window(mask))

    @property
    def height(self) -> int:
        """Number of rows."""
        return self.bottom - self.top

    @property
    def width(self) -> int:
        """Number of columns."""
        return self.right - self.left

    @property
    def whole(self) -> bool:
        """Whether the window is the whole field."""
        return self.height == self.n_rows and self.width == self.n_cols

    @property
    def size_text(self) -> str:
        """Size in words, such as ``24 × 24 px``."""
        return f"{self.height} × {self.width} px"

    def cut(self, array: np.ndarray) -> np.ndarray:
        """Return the part of an array inside the window.

        Parameters
        ----------
        array : (row, col, …) of the field
        """
        return array[self.top : self.bottom, self.left : self.right]


def bounding_window(mask: np.ndarray) -> Window:
    """Return the smallest window around the true pixels of a mask (row, col); the whole field if there are none."""
    n_rows, n_cols = mask.shape
    rows, cols = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
    if not rows.size:
        return Window(0, n_rows, 0, n_cols, n_rows, n_cols)
    return Window(int(rows[0]), int(rows[-1]) + 1, int(cols[0]), int(cols[-1]) + 1, n_rows, n_cols)


def grow(inner: Window, outer: Window) -> Window:
    """Grow `inner` about its middle to at least half the height and half the width of `outer`."""
    height, width = max(inner.height, -(-outer.height // 2)), max(inner.width, -(-outer.width // 2))
    top, height = _span(inner.top, inner.bottom, height, inner.n_rows)
    left, width = _span(inner.left, inner.right, width, inner.n_cols)
    return Window(top, top + height, left, left + width, inner.n_rows, inner.n_cols)


def crop(bounds: Window, previous: Window | None = None) -> Window:
    """Return the square crop that shows `bounds` with a margin, of the next size of the ladder, or the whole field.

    The size of a `previous` crop is kept while it fits and is at most three times too large. An animation therefore does
    not alternate between two sizes.
    """
    field = max(bounds.n_rows, bounds.n_cols)
    needed = MARGIN * max(bounds.height, bounds.width) + 1
    size = next((step for step in LADDER if step >= needed), field)
    if previous is not None:
        held = max(previous.height, previous.width)
        if max(bounds.height, bounds.width) + 2 <= held <= 3 * needed:
            size = held
    if size >= field:
        return Window(0, bounds.n_rows, 0, bounds.n_cols, bounds.n_rows, bounds.n_cols)
    top, height = _span(bounds.top, bounds.bottom, size, bounds.n_rows)
    left, width = _span(bounds.left, bounds.right, size, bounds.n_cols)
    return Window(top, top + height, left, left + width, bounds.n_rows, bounds.n_cols)


def _span(low: int, high: int, size: int, limit: int) -> tuple[int, int]:
    """Return start and length of `size` pixels centred on low to high, moved inside 0 to `limit`.

    Parameters
    ----------
    size : pixels wanted
    limit : pixels there are
    """
    length = min(size, limit)
    start = (low + high - length + 1) // 2
    return min(max(start, 0), limit - length), length
