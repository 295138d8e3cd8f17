"""Reference trackers against truth in one picture: errors of centroid and filters, NIS with its bounds, and ICP's errors."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from rso_lidar.picture import figures, palette
from rso_lidar.units import DEG

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

TRACKED_QUANTITIES = {"cv": "constant velocity", "cw": "Clohessy-Wiltshire"}
COLOURS = {"cv": palette.ORANGE, "cw": palette.BLUE}
_NIS_95 = (0.2158, 9.3484)  # chi-square of three degrees of freedom, two-sided
_CUT = (1.0, 99.0)  # percentiles of errors that an axis spans, with margin
_PANEL_IN = 1.6  # height of a panel with the legend above it [inches]
_APART_IN = 0.08  # between panels


def tracking_figure(
    table: Mapping[str, np.ndarray], kinds: Sequence[str], target: str, title: str = "", note: str = ""
) -> Figure:
    """Draw the results of reference trackers on a recording over time.

    Parameters
    ----------
    table : columns (time) by name, as `study.tracking` makes them
    kinds : filters in the table, ``cv`` or ``cw``
    """
    time_s = table["time_s"]
    poses = "icp_error_rad" in table
    panels = 5 + 2 * poses
    words = (
        f"{target}   ·   {time_s.size:,} frames   ·   errors: estimate − truth of the target's origin, in lidar axes"
    )
    height_in = 1.1 + _PANEL_IN * panels
    figure = figures.new_figure(9.6, height_in, title or "Tracking", words, (note,) if note else ())
    rows = list(figure.subplots(panels, 1, sharex=True))
    _draw_range(rows[0], table)
    for axes, axis in zip(rows[1:4], ("right", "down", "ahead"), strict=True):
        _draw_errors(axes, table, kinds, axis)
    _draw_legend(rows[1], *rows[1].get_legend_handles_labels())
    _draw_nis(rows[4], table, kinds)
    if poses:
        turn, place = rows[5:]
        _draw_on_log(
            turn,
            table,
            (("icp_error_rad", "turn", palette.RED), ("icp_long_axis_error_rad", "long axis", palette.BLUE)),
            1.0 / DEG,
        )
        figures.style_axes(turn, y="ICP, turn [deg]")
        _draw_on_log(
            place,
            table,
            (("icp_error_m", "place", palette.RED), ("icp_rms_m", "rms of points to facets", palette.GREEN)),
            1.0,
        )
        figures.style_axes(place, y="ICP, place [m]")
        for axes in (turn, place):
            _draw_legend(axes, *axes.get_legend_handles_labels())
    rows[-1].set_xlabel("Time [s]", fontsize=figures.TEXT_PT, color=palette.QUIET)
    figures.format_thousands(rows[-1].xaxis)
    rows[-1].set_xlim(time_s[0], time_s[-1] if time_s.size > 1 else time_s[0] + 1.0)
    for axes in rows:
        _set_few_ticks(axes)
    figure.get_layout_engine().set(h_pad=_APART_IN)  # type: ignore[union-attr, call-arg]
    figure.align_ylabels(rows)
    return figure


def _draw_legend(axes: Axes, handles: Sequence[Artist], words: Sequence[str]) -> None:
    """Draw a legend on one line above a panel, where it covers no point."""
    axes.legend(
        handles, words, fontsize=figures.SMALL_PT, frameon=False, loc="lower right", bbox_to_anchor=(1.0, 1.0),
        ncols=len(words), labelcolor=palette.QUIET, borderaxespad=0.0,
    )  # fmt: skip


def _set_few_ticks(axes: Axes) -> None:
    """Set few ticks on the values of a panel, none at its ends, where they meet those of its neighbours."""
    from matplotlib.ticker import LogLocator, MaxNLocator, NullLocator

    low, high = axes.get_ylim()
    if axes.get_yscale() != "log":
        axes.yaxis.set_major_locator(MaxNLocator(4, prune="both", steps=[1, 2, 2.5, 5, 10]))
    elif high / low >= 100.0:
        axes.yaxis.set_major_locator(LogLocator(numticks=5))
        axes.yaxis.set_minor_locator(NullLocator())
    else:
        figures.log_ticks(axes.yaxis, low, high)


def _draw_range(axes: Axes, table: Mapping[str, np.ndarray]) -> None:
    axes.plot(table["time_s"], table["true_range_m"], color=palette.RULE, lw=figures.WIDE_PT, label="true range")
    axes.plot(table["time_s"], table["centroid_range_m"], ".", color=palette.BLUE, ms=3, label="range of the centroid")
    figures.style_axes(axes, y="Range [m]")
    figures.colour_axis(axes, "left", palette.BLUE)
    figures.format_thousands(axes.yaxis)
    points = axes.twinx()
    points.plot(table["time_s"], table["points"], color=palette.ORANGE, lw=figures.LINE_PT, label="points (right)")
    figures.style_axes(points, y="Points")
    points.grid(False)
    points.set_ylim(bottom=0.0)
    figures.format_thousands(points.yaxis)
    figures.colour_axis(points, "right", palette.ORANGE)
    entries = [panel.get_legend_handles_labels() for panel in (axes, points)]
    _draw_legend(axes, [*entries[0][0], *entries[1][0]], [*entries[0][1], *entries[1][1]])


def _draw_errors(axes: Axes, table: Mapping[str, np.ndarray], kinds: Sequence[str], axis: str) -> None:
    """Draw position errors along one axis."""
    shown = [table[f"centroid_error_{axis}_m"]]
    axes.axhline(0, color=palette.RULE, lw=figures.THIN_PT)
    axes.plot(table["time_s"], shown[0], ".", color=palette.QUIET, ms=3, label="centroid")
    for kind in kinds:
        shown.append(table[f"{kind}_error_{axis}_m"])
        axes.plot(table["time_s"], shown[-1], color=COLOURS[kind], lw=figures.LINE_PT, label=TRACKED_QUANTITIES[kind])
    figures.style_axes(axes, y=f"Error {axis} [m]")
    values = np.concatenate(shown)
    values = values[np.isfinite(values)]
    if values.size:
        low, high = np.percentile(values, _CUT)
        room = 0.35 * (high - low) + 1e-3
        axes.set_ylim(low - room, high + room)


def _draw_nis(axes: Axes, table: Mapping[str, np.ndarray], kinds: Sequence[str]) -> None:
    """Draw the normalised innovation squared with its 95 % bounds."""
    low, high = _NIS_95
    axes.axhspan(low, high, color=palette.SHADE, lw=0, label="95 % bounds, chi-square", zorder=0)
    axes.axhline(3.0, color=palette.INK, lw=figures.THIN_PT, ls=(0, (4, 3)), label="expected mean")
    for kind in kinds:
        axes.plot(table["time_s"], table[f"{kind}_nis"], ".", color=COLOURS[kind], ms=3, label=TRACKED_QUANTITIES[kind])
    figures.style_axes(axes, y="NIS")
    axes.set_yscale("log")
    axes.set_ylim(bottom=max(axes.get_ylim()[0], 1e-3))
    _draw_legend(axes, *axes.get_legend_handles_labels())


def _draw_on_log(
    axes: Axes, table: Mapping[str, np.ndarray], lines: Sequence[tuple[str, str, str]], scale: float
) -> None:
    """Draw columns on a logarithmic axis, times `scale`."""
    for name, word, colour in lines:
        axes.plot(table["time_s"], table[name] * scale, ".-", color=colour, ms=3, lw=figures.THIN_PT, label=word)
    axes.set_yscale("log")
