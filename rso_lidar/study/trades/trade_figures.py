"""A trade study drawn: each figure of merit along each axis, over pairs of axes, and against the others."""

from __future__ import annotations

import math
import re
import textwrap
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from rso_lidar.picture import colour_maps, figures, palette

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_PAGE_IN, _ONE_IN = 11.8, 8.8  # width of a figure of several panels, as the report's page is wide, and of one panel
_COLUMNS = 3
_BINS = 8  # most bins of an axis with many values
_OF_A_BIN, _FEWEST_BINS = 5, 3  # fewest values in a bin, and fewest bins, for a line
_MOST_LEVELS = 24  # most distinct values of an axis that are treated as levels
_HEAD_IN = 0.75
_HOLLOW: dict[str, Any] = {"mfc": "none", "mec": palette.QUIET, "ms": 4.0, "mew": 0.7}


@dataclass(frozen=True, eq=False)
class Quantity:
    """Column of a trade (row): its name, its values (numbers or texts), and whether it spans decades.

    `drawn` is how many points were drawn, where the axes' values were drawn and not a grid's. `unranked` (row) marks values
    that are shown and ranked no point, such as a range error of the few pixels that reported at all.
    """

    name: str
    values: np.ndarray
    log: bool = False
    drawn: int = 0
    unranked: np.ndarray | None = None

    @property
    def ranked(self) -> np.ndarray:
        """Mask of the rows whose value ranks them."""
        known: np.ndarray = np.isfinite(self.values)
        return known if self.unranked is None else known & ~self.unranked

    @property
    def numeric(self) -> bool:
        """Whether the values are numbers."""
        return self.values.dtype.kind in "fiu"

    def levels(self) -> tuple[np.ndarray, np.ndarray]:
        """Return the distinct values in order (texts: of appearance) and the index of each row's value."""
        levels, first, which = np.unique(self.values, return_index=True, return_inverse=True)
        if self.numeric:
            return levels, which
        order = np.argsort(first)
        return levels[order], np.argsort(order)[which]


def effects_figure(merit: Quantity, along: Sequence[Quantity], better: str) -> Figure:
    """Draw one figure of merit along each axis: one dot for each run, and a line for each value or bin.

    The line is the mean for each value of a grid. For values drawn at random it is the median of bins with enough values.
    With few bins there is no line, since a line from dot to dot would show noise as shape.

    Parameters
    ----------
    along : the axes
    better : ``more`` or ``less``
    """
    columns = _columns(len(along))
    rows = math.ceil(len(along) / columns)
    lines = [_find_line(axis, merit) for axis in along]
    line = f", the line their {'median, in stretches' if along[0].drawn else 'mean'}" if any(map(len, lines)) else ""
    held = (
        "   ·   hollow: too little detected to be ranked" if np.any(np.isfinite(merit.values) & ~merit.ranked) else ""
    )
    note = f"{better} is better   ·   one dot per run{line}; the spread comes from the other axes{held}"
    figure = figures.new_figure(_width_in(columns), _HEAD_IN + 2.9 * rows, merit.name, note)
    panels = figure.subplots(rows, columns, squeeze=False, sharey=True)
    for axes, axis, points in zip(panels.flat, along, lines, strict=False):
        _draw_effect(axes, axis, merit, points)
    for axes in panels.flat[len(along) :]:
        axes.set_axis_off()
    for row in panels:
        row[0].set_ylabel(merit.name, fontsize=figures.TEXT_PT, color=palette.QUIET)
    return figure


def _draw_effect(axes: Axes, axis: Quantity, merit: Quantity, points: np.ndarray) -> None:
    """Draw a merit over one axis of a trade, with medians (point, 2) at its levels."""
    known, held = merit.ranked, np.isfinite(merit.values) & ~merit.ranked
    levels, which = axis.levels()
    place = axis.values if axis.numeric else which.astype(float)
    if held.any():
        axes.plot(place[held], merit.values[held], "o", **_HOLLOW)
    axes.plot(place[known], merit.values[known], "o", color=palette.SKY, ms=4.5, alpha=0.6, mew=0)
    if len(points):
        axes.plot(*points.T, "o-", color=palette.BLUE, lw=figures.THICK_PT, ms=4)
    figures.style_axes(axes, x=_wrap(axis.name))
    _scale_axis(axes, axis, levels)
    if np.isfinite(merit.values).any():
        _set_limits(axes, merit)


def _find_line(axis: Quantity, merit: Quantity) -> np.ndarray:
    """Return the points (point, [place, value]) of a panel's line; none where it would only join dots."""
    levels, which = axis.levels()
    if axis.drawn and axis.drawn < 3 * len(levels):  # otherwise values of a list, each drawn several times
        count = min(_BINS, len(levels) // _OF_A_BIN)
        if not axis.numeric or count < _FEWEST_BINS:
            return np.empty((0, 2))
        group, middle = _bin_values(axis, count)
    elif len(levels) <= _MOST_LEVELS or not axis.numeric:
        group, middle = which, np.asarray(levels, dtype=float) if axis.numeric else np.arange(len(levels), dtype=float)
    else:
        group, middle = _bin_values(axis, min(_BINS, len(levels) // 3))
    each = [merit.values[(group == k) & merit.ranked] for k in range(len(middle))]
    of = np.median if axis.drawn else np.mean
    return np.array([(place, of(values)) for place, values in zip(middle, each, strict=True) if values.size]).reshape(
        -1, 2
    )


def _bin_values(axis: Quantity, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the bin of each row, for bins with equally many values, and their middles."""
    levels, which = axis.levels()
    group = np.arange(len(levels)) * count // len(levels)
    shown = np.log(levels) if axis.log else levels
    mean = np.array([np.mean(shown[group == k]) for k in range(count)])
    return group[which], np.exp(mean) if axis.log else mean


def _scale_axis(axes: Axes, axis: Quantity, levels: np.ndarray) -> None:
    """Scale an axis, with its values as ticks where they are few."""
    from matplotlib.ticker import FixedLocator, FuncFormatter, LogLocator, NullFormatter, NullLocator

    if not axis.numeric:
        axes.set_xticks(
            range(len(levels)), [_label_level(str(level)) for level in levels], rotation=20 if len(levels) > 3 else 0
        )
        axes.set_xlim(-0.5, len(levels) - 0.5)
        return
    if axis.log:
        axes.set_xscale("log")
        axes.xaxis.set_minor_formatter(NullFormatter())
        axes.xaxis.set_major_locator(LogLocator(base=10, subs=(1.0, 2.0, 5.0)))
    if len(levels) <= 7:
        axes.xaxis.set_major_locator(FixedLocator(levels.astype(float).tolist()))
        axes.xaxis.set_minor_locator(NullLocator())
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: format_value(value)))


def _set_limits(axes: Axes, merit: Quantity) -> None:
    """Set the limits and the scale of the axis of a figure of merit."""
    from matplotlib.ticker import FuncFormatter

    low, high = float(np.nanmin(merit.values)), float(np.nanmax(merit.values))
    if merit.log:
        axes.set_yscale("log")
        axes.set_ylim(low / 1.3, high * 1.3)
    else:
        room = 0.06 * (high - low) or 0.06 * abs(high) or 1.0
        axes.set_ylim(low - room, high + room)
        axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: format_value(value)))


def maps_figure(merit: Quantity, along: Sequence[Quantity], better: str) -> Figure | None:
    """Draw one figure of merit over each pair of axes, the mean over all others; None without a pair.

    Parameters
    ----------
    along : the axes
    better : ``more`` or ``less``
    """
    import matplotlib
    from matplotlib.colors import LogNorm, Normalize

    few = [axis for axis in along if 2 <= len(axis.levels()[0]) <= _MOST_LEVELS]
    pairs = [(first, other) for k, first in enumerate(few) for other in few[k + 1 :]]
    if not pairs or not merit.ranked.any():
        return None
    tables = [_mean_over(merit, *pair) for pair in pairs]
    shown = np.concatenate([table.ravel() for table in tables])
    if not np.isfinite(shown).any():
        return None
    low, high = float(np.nanmin(shown)), float(np.nanmax(shown))
    columns = _columns(len(pairs))
    rows = math.ceil(len(pairs) / columns)
    note = f"{better} is better   ·   the mean of the ranked runs that share both values   ·   dark: none"
    figure = figures.new_figure(
        _width_in(columns),
        _HEAD_IN + 3.2 * rows,
        merit.name,
        note,
    )
    panels = figure.subplots(rows, columns, squeeze=False)
    norm: Any = (
        LogNorm(low, high) if merit.log and high > low > 0.0 else Normalize(low, high if high > low else low + 1.0)
    )
    colours = matplotlib.colormaps[
        colour_maps.AMOUNT_RAMP if better == "more" else f"{colour_maps.AMOUNT_RAMP}_r"
    ].with_extremes(bad=palette.NO_RETURN)
    drawn: Any = None
    for axes, (first, other), table in zip(panels.flat, pairs, tables, strict=False):
        drawn = axes.imshow(np.ma.masked_invalid(table), origin="lower", aspect="auto", norm=norm, cmap=colours)
        figures.style_axes(axes, x=_wrap(other.name), y=_wrap(first.name, 30))
        axes.grid(False)
        for put, axis in ((axes.set_xticks, other), (axes.set_yticks, first)):
            levels = axis.levels()[0]
            put(range(len(levels)), [format_value(x) if axis.numeric else _label_level(str(x)) for x in levels])
        if table.size <= 80:
            _mark_cells(axes, table, norm, colours)
    for axes in panels.flat[len(pairs) :]:
        axes.set_axis_off()
    bar = figure.colorbar(drawn, ax=panels, shrink=0.85, aspect=30, pad=0.015)
    figures.style_bar(bar)
    return figure


def _mean_over(merit: Quantity, first: Quantity, other: Quantity) -> np.ndarray:
    """Return the mean (first, other) of known values, NaN where there are none."""
    (rows, row), (cols, col) = first.levels(), other.levels()
    known = merit.ranked
    cell = (row * len(cols) + col)[known]
    count = np.bincount(cell, minlength=len(rows) * len(cols))
    total = np.bincount(cell, merit.values[known], len(rows) * len(cols))
    mean: np.ndarray = np.where(count > 0, total / np.maximum(count, 1), np.nan).reshape(len(rows), len(cols))
    return mean


def _mark_cells(axes: Axes, table: np.ndarray, norm: Any, colours: Any) -> None:
    """Write each value (row, col) into its cell, dark on light or light on dark."""
    for (row, col), value in np.ndenumerate(table):
        if np.isfinite(value):
            ink = palette.choose_ink(colours(norm(value))[:3])
            axes.text(col, row, format_value(value, 3), ha="center", va="center", fontsize=figures.SMALL_PT, color=ink)


def against_figure(merits: Sequence[Quantity], better: Sequence[str], by: Quantity, best: np.ndarray) -> Figure | None:
    """Draw the other figures of merit against the first, coloured by an axis; None where there is only one.

    `best` (row) marks with a ring those that none beats in every figure of merit.

    Parameters
    ----------
    better : of each, ``more`` or ``less``
    by : the axis that gives the colours
    best : (row) the rows marked as best
    """
    if len(merits) < 2 or not np.isfinite(merits[0].values).any():
        return None
    others = list(zip(merits[1:], better[1:], strict=True))
    columns = _columns(len(others))
    rows = math.ceil(len(others) / columns)
    hollow = any(np.any(np.isfinite(merit.values) & ~merit.ranked) for merit in merits)
    held = "   ·   hollow: not ranked" if hollow else ""
    figure = figures.new_figure(
        _width_in(columns),
        _HEAD_IN + 2.9 * rows,
        f"What {merits[0].name[0].lower()}{merits[0].name[1:]} costs",
        f"coloured by {by.name}   ·   ringed: beaten by none in all figures of merit{held}",
    )
    panels = figure.subplots(rows, columns, squeeze=False)
    levels, which = by.levels()
    shade: np.ndarray = np.asarray(by.values, dtype=float) if by.numeric else which.astype(float)
    shade = np.log10(shade) if by.log else shade
    drawn: Any = None
    for axes, (other, word) in zip(panels.flat, others, strict=False):
        ranked = merits[0].ranked & other.ranked
        if not ranked.all():
            axes.plot(merits[0].values[~ranked], other.values[~ranked], "o", **_HOLLOW)
        drawn = axes.scatter(
            merits[0].values[ranked],
            other.values[ranked],
            c=shade[ranked],
            cmap=colour_maps.AMOUNT_RAMP,
            s=20,
            lw=figures.HAIR_PT,
            edgecolors=palette.QUIET,
            vmin=shade.min(),
            vmax=shade.max(),
        )
        axes.plot(merits[0].values[best], other.values[best], "o", mfc="none", mec=palette.INK, ms=8, mew=0.9)
        figures.style_axes(axes, x=f"{merits[0].name} ({better[0]} is better)", y=f"{other.name}\n({word} is better)")
        if np.isfinite(other.values).any():
            _set_limits(axes, other)
        if merits[0].log:
            axes.set_xscale("log")
    for axes in panels.flat[len(others) :]:
        axes.set_axis_off()
    ticks = np.asarray(levels, dtype=float) if by.numeric else np.arange(len(levels), dtype=float)
    few = len(levels) <= 7
    bar = figure.colorbar(drawn, ax=panels, shrink=0.85, aspect=30, pad=0.015)
    if few:
        bar.set_ticks((np.log10(ticks) if by.log else ticks).tolist())
        bar.set_ticklabels([format_value(x) if by.numeric else _label_level(str(x)) for x in levels])
    elif by.log:
        bar.ax.yaxis.set_major_formatter(lambda value, _: format_value(10.0**value))
    figures.style_bar(bar)
    return figure


def format_value(value: float, digits: int = 4) -> str:
    """Format a number in few digits, with a comma at thousands and a true minus.

    >>> format_value(12345.678), format_value(-0.25), format_value(float("nan"))
    ('12,350', '−0.25', '–')
    """
    if not math.isfinite(value):
        return "–"
    rounded = float(f"{value:.{digits}g}")
    return figures.use_minus_sign(f"{rounded:,.{digits}g}" if abs(rounded) < 10**digits else f"{rounded:,.0f}")


def _width_in(columns: int) -> float:
    """Return the width of a figure [inches]: that of the page, or less for a single panel."""
    return _PAGE_IN if columns > 1 else _ONE_IN


def _columns(count: int) -> int:
    """Return how many panels are side by side; four are drawn as two and two."""
    return 2 if count == 4 else min(count, _COLUMNS)


def _label_level(text: str) -> str:
    """Make a tick label of a level; of a table only the values are kept."""
    if text.startswith("{"):
        text = re.sub(r"[\w-]+ = ", "", text).strip("{ }").replace('"', "").replace(",", "")
    return figures.shorten(text, 18)


def _wrap(name: str, width: int = 38) -> str:
    return "\n".join(textwrap.wrap(name, width)) or name
