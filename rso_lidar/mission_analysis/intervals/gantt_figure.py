"""Events as bars over time, a line for each expression and pair of objects."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from rso_lidar.picture import figures

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_MOST = 40  # lines of one figure
_LINE_IN = 0.4  # height of a line
_LEAST = 0.0015  # width of the shortest bar, as a share of the span
_NAME_LETTERS, _NOTE_LETTERS = 44, 140


def gantt_figure(
    lines: Sequence[tuple[str, Sequence[tuple[float, float]], int]],
    start_utc: np.datetime64,
    duration_s: float,
    title: str,
    note: str = "",
) -> Figure:
    """Draw spans of time as bars.

    Parameters
    ----------
    lines : name, spans [s since the start] and number of the colour of each line
    start_utc, duration_s : span of the time axis
    note : below the title
    """
    from matplotlib.dates import AutoDateLocator, ConciseDateFormatter, date2num

    shown = lines[:_MOST]
    figure = figures.new_figure(10.5, 2.6 + _LINE_IN * max(len(shown), 1), title, figures.shorten(note, _NOTE_LETTERS))
    axes = figure.subplots()
    begin = float(date2num(start_utc))  # type: ignore[no-untyped-call]
    days = duration_s / 86400.0
    for row, (_, spans, colour) in enumerate(shown):
        bars = [(begin + from_s / 86400.0, max((to_s - from_s) / 86400.0, _LEAST * days)) for from_s, to_s in spans]
        drawn = axes.broken_barh(bars, (row - 0.36, 0.72), facecolors=figures.colour_of(colour)[0], lw=0)
        drawn.set_snap(False)  # short bars of equal length look alike, where whole pixels would alternate by one
    axes.set_axisbelow(True)  # the grid, below the bars
    axes.set_ylim(max(len(shown), 1) - 0.4, -0.6)
    axes.set_yticks(range(len(shown)), [figures.shorten(name, _NAME_LETTERS) for name, *_ in shown])
    axes.set_xlim(begin, begin + days)
    locator = AutoDateLocator()  # type: ignore[no-untyped-call]
    axes.xaxis.set_major_locator(locator)
    axes.xaxis.set_major_formatter(ConciseDateFormatter(locator, show_offset=False))  # type: ignore[no-untyped-call]
    last = start_utc + np.timedelta64(round(1e3 * duration_s) - 1, "ms")
    dates = dict.fromkeys(str(at.astype("datetime64[D]")) for at in (start_utc, last))
    more = f"{len(lines) - len(shown)} more lines are not drawn" if len(lines) > len(shown) else ""
    figures.style_axes(axes, "" if lines else "no event found", f"UTC, {' to '.join(dates)}", "", more)
    return figure
