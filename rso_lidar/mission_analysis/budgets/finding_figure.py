"""The probability that a body is found, drawn against range."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from rso_lidar.picture import figures, palette

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_SHOWN = 0.002  # probabilities closer to 0 or 1 than this are not drawn at the ends
_HIGH = 0.8  # level whose line a legend at the top would cover


def finding_figure(
    range_m: np.ndarray,
    found_probability: np.ndarray,
    worst_found: np.ndarray,
    *,
    title: str,
    note: str,
    probability: float,
    max_range_m: float,
    worst: str | None,
    small_print: Sequence[str] = (),
) -> Figure:
    """Draw the probability that a body is found against range, with the range of the wanted probability marked.

    Parameters
    ----------
    range_m : (range) [m]
    found_probability, worst_found : (range) probabilities over all attitudes, and in the worst one
    probability, max_range_m : wanted probability, and the greatest range that has it [m], NaN where none has
    worst : description of the worst attitude, None without one
    """
    figure = figures.new_figure(8.4, 4.8, title, note, tuple(small_print))
    axes = figure.subplots()
    colour, other = palette.BLUE, palette.ORANGE
    axes.plot(range_m, found_probability, color=colour, lw=figures.THICK_PT, label="over all attitudes")
    if worst is not None:
        axes.plot(
            range_m, worst_found, color=other, lw=figures.THICK_PT, ls=(0, (5, 2)), label=f"worst attitude: {worst}"
        )
    axes.axhline(probability, color=palette.RULE, lw=figures.THIN_PT, zorder=0)
    if np.isfinite(max_range_m):
        axes.plot([max_range_m], [probability], "o", color=colour, ms=6, mec=palette.PAPER, mew=0.8, zorder=5)
        axes.annotate(
            f"{max_range_m:,.0f} m",
            (max_range_m, probability),
            xytext=(8, 6),
            textcoords="offset points",
            fontsize=figures.TEXT_PT,
            color=palette.INK,
        )
    axes.set_xscale("log")
    figures.style_axes(axes, "Probability that the body is found", note=f"marked: P = {probability:g}")
    shown = np.flatnonzero(
        (found_probability > _SHOWN) & (worst_found < 1.0 - _SHOWN)
        | (found_probability < 1.0 - _SHOWN) & (found_probability > _SHOWN)
    )
    if shown.size > 1:
        first, last = max(int(shown[0]) - 1, 0), min(int(shown[-1]) + 1, len(range_m) - 1)
        axes.set_xlim(range_m[first], range_m[last])
    low, high = -0.02, 1.04
    axes.set_ylim(low, high)
    figures.log_ticks(axes.xaxis, *axes.get_xlim())
    axes.set_xlabel("Range [m]", fontsize=figures.TEXT_PT, color=palette.QUIET)
    top = (probability - low) / (high - low) - 0.01 if probability > _HIGH else 1.0  # below the line of a high level
    axes.legend(
        fontsize=figures.SMALL_PT,
        frameon=False,
        labelcolor=palette.INK,
        loc="upper right",
        bbox_to_anchor=(1.0, top),
        borderaxespad=0.2,
    )
    return figure
