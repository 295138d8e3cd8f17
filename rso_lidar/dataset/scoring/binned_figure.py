"""Figures of merit with intervals in bins of a quantity, such as recall against lit pixels (Fuller et al., fig. 17)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from rso_lidar.picture import figures, palette

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_PANEL_IN = 3.3  # height
_LEGEND_IN = 2.1  # width
_SHOWN = 0.02  # share of an axis beyond 0 and 1


@dataclass(frozen=True, eq=False)
class BinnedPanel:
    """One panel: series of values with intervals in bins of a quantity.

    `x` and `y` are the labels of its axes, `edges` (bin + 1) those of the bins, `series` the value and the ends of its
    interval (bin, 3) by name, the first one drawn heavily, and `frames` (bin) how many frames each bin has. `level` is a
    value to reach, and `mark` the quantity at which it is reached, with its interval.
    """

    x: str
    y: str
    edges: np.ndarray
    series: Mapping[str, np.ndarray]
    frames: np.ndarray
    is_log: bool = False
    is_share: bool = True
    level: float | None = None
    mark: tuple[float, float, float] | None = None


def binned_figure(panels: Sequence[BinnedPanel], title: str, note: str = "") -> Figure:
    """Draw panels of series in bins, one below the other, with one legend.

    Parameters
    ----------
    panels : what to draw; those with series of the same names share their colours
    """
    figure = figures.new_figure(7.4 + _LEGEND_IN, 1.0 + _PANEL_IN * len(panels), title, note)
    for axes, panel in zip(np.atleast_1d(figure.subplots(len(panels), 1)), panels, strict=True):
        _draw_panel(axes, panel)
    return figure


def _draw_panel(axes: Axes, panel: BinnedPanel) -> None:
    """Draw the series of one panel over bars of its frames."""
    low, high = panel.edges[:-1], panel.edges[1:]
    middle = np.sqrt(low * high) if panel.is_log else 0.5 * (low + high)
    names = list(panel.series)
    for number, (name, values) in enumerate(panel.series.items()):
        is_first = number == 0
        colour, style = (
            (palette.INK, "-") if is_first and len(names) > 1 else figures.colour_of(number - (len(names) > 1))
        )
        value, lower, upper = values.T
        known = np.isfinite(value)
        if is_first:
            axes.fill_between(
                middle, np.where(known, lower, np.nan), np.where(known, upper, np.nan), color=colour, alpha=0.13, lw=0
            )
        axes.plot(
            middle, np.where(known, value, np.nan), marker="o", ms=4.5 if is_first else 3,
            lw=figures.THICK_PT if is_first else figures.LINE_PT,
            color=colour, ls=style, label=name, zorder=4 if is_first else 3,
        )  # fmt: skip
    _set_values(axes, panel)
    if panel.level is not None:
        axes.axhline(panel.level, color=palette.QUIET, lw=figures.THIN_PT, ls=(0, (4, 3)))
    if panel.mark is not None and np.isfinite(panel.mark[0]):
        _draw_mark(axes, panel)
    if panel.is_log:
        axes.set_xscale("log")
        axes.set_xlim(panel.edges[0], panel.edges[-1])
        figures.log_ticks(axes.xaxis, *axes.get_xlim())
    else:
        axes.set_xlim(panel.edges[0], panel.edges[-1])
        figures.format_thousands(axes.xaxis)
    figures.style_axes(axes, x=panel.x, y=panel.y)
    _write_counts(axes, middle, panel.frames)
    axes.legend(
        fontsize=figures.SMALL_PT, frameon=False, loc="upper left", bbox_to_anchor=(1.01, 1.0), labelcolor=palette.QUIET,
        borderaxespad=0.0,
    )  # fmt: skip


def _set_values(axes: Axes, panel: BinnedPanel) -> None:
    """Set the axis of the values: shares from 0 to 1, errors on a log axis."""
    if panel.is_share:
        axes.set_ylim(-_SHOWN, 1.0 + _SHOWN)
        return
    values = np.concatenate([values.ravel() for values in panel.series.values()])
    values = values[np.isfinite(values) & (values > 0)]
    if len(values):
        axes.set_yscale("log")
        low, high = float(values.min()), float(values.max())
        room = max(1.15, float(np.sqrt(max(1.0, 4.0 * low / high))))  # at least a factor of four
        axes.set_ylim(low / room, high * room)
        figures.log_ticks(axes.yaxis, *axes.get_ylim())


def _draw_mark(axes: Axes, panel: BinnedPanel) -> None:
    """Mark where a level is reached, with its interval."""
    assert panel.mark is not None
    at, low, high = panel.mark
    last = float(panel.edges[-1])
    axes.axvspan(max(low, float(panel.edges[0])), min(high, last), color=palette.SHADE, lw=0, zorder=0)
    axes.axvline(at, color=palette.INK, lw=figures.LINE_PT, ls=(0, (4, 3)), zorder=1)
    upper = f"{high:,.0f}" if np.isfinite(high) else "never"
    between = f" ({low:,.0f} to {upper})" if np.isfinite(low) else ""
    axes.annotate(
        f"{panel.level:.0%} from {at:,.0f}{between}", (at, 0.04), xycoords=("data", "axes fraction"), xytext=(5, 0),
        textcoords="offset points", fontsize=figures.SMALL_PT, color=palette.INK,
    )  # fmt: skip


def _write_counts(axes: Axes, middle: np.ndarray, frames: np.ndarray) -> None:
    """Write the number of frames of each bin above the panel."""
    for at, count in zip(middle.tolist(), frames.tolist(), strict=True):
        axes.annotate(
            f"{count:,}", (at, 1.0), xycoords=("data", "axes fraction"), xytext=(0, 3), textcoords="offset points",
            ha="center", fontsize=figures.SMALL_PT, color=palette.QUIET, annotation_clip=False,
        )  # fmt: skip
    axes.annotate(
        "frames", (1.01, 1.0), xycoords="axes fraction", xytext=(0, 3), textcoords="offset points",
        fontsize=figures.SMALL_PT, color=palette.QUIET, annotation_clip=False,
    )  # fmt: skip
