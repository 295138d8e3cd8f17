"""Changes of figures of merit between two algorithms, each with its interval."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from rso_lidar.picture import figures, palette

if TYPE_CHECKING:
    from matplotlib.figure import Figure

COLOURS = {"better": palette.GREEN, "worse": palette.RED}
_ROW_IN = 0.36
_SPAN = 4.0  # half-widths of an interval that the axis shows


@dataclass(frozen=True)
class ChangeRow:
    """A row of the figure: what changed and by how much, in words, and the gain with its interval in its own unit.

    `gain` is positive where the new algorithm is better.
    """

    name: str
    words: str
    gain: float
    low: float
    high: float
    verdict: str


def change_figure(rows: Sequence[ChangeRow], title: str, note: str = "") -> Figure:
    """Draw the gain of each figure of merit with its interval, in half-widths of that interval.

    Returns
    -------
    Figure
    """
    figure = figures.new_figure(10.0, 1.5 + _ROW_IN * len(rows), title, note)
    axes = figure.subplots()
    axes.axvline(0.0, color=palette.INK, lw=figures.THIN_PT)
    for place, row in enumerate(rows):
        half = 0.5 * (row.high - row.low)
        if not np.isfinite(half) or half <= 0:
            centre, ends = float(np.sign(row.gain)) if np.isfinite(row.gain) else 0.0, (0.0, 0.0)
        else:
            centre, ends = row.gain / half, ((row.gain - row.low) / half, (row.high - row.gain) / half)
        centre = float(np.clip(centre, -_SPAN, _SPAN))
        colour = COLOURS.get(row.verdict, palette.RULE)
        axes.errorbar(
            [centre], [place], xerr=[[max(ends[0], 0.0)], [max(ends[1], 0.0)]], fmt="o", ms=6, color=colour,
            lw=figures.THICK_PT, capsize=3,
        )  # fmt: skip
        axes.annotate(
            f"{row.words}   {row.verdict}", (1.01, place), xycoords=("axes fraction", "data"), va="center",
            fontsize=figures.SMALL_PT, color=palette.INK if row.verdict in COLOURS else palette.QUIET, annotation_clip=False,
        )  # fmt: skip
    axes.set_ylim(len(rows) - 0.5, -0.5)
    axes.set_xlim(-_SPAN - 1.2, _SPAN + 1.2)
    figures.style_axes(axes, x="worse   ←   gain, in half-widths of its interval   →   better")
    axes.set_yticks(range(len(rows)), [row.name for row in rows])
    axes.tick_params(axis="y", length=0)
    axes.grid(axis="y", color=palette.GRID, lw=figures.HAIR_PT)
    return figure
