"""The page that all figures share: an Agg canvas, a heading, and axes in quiet ink."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from rso_lidar.picture.style.palette import GRID, INK, LINES, QUIET, RULE

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.axis import Axis
    from matplotlib.colorbar import Colorbar
    from matplotlib.figure import Figure

# Sizes of text and widths of lines, in points of a figure at full size. A figure as wide as `PAGE_IN` is printed 190 mm wide
# and one of `LANDSCAPE_IN` 240 mm wide, at about 78 % of full size. The smallest text is then 7 pt high.
PAGE_IN = 9.6
LANDSCAPE_IN = 12.0
TITLE_PT = 14.0
HEADING_PT = 11.0
TEXT_PT = 9.5  # labels of axes, and words in a plot
SMALL_PT = 9.0  # numbers on axes, legends and notes: nothing is smaller
HAIR_PT, THIN_PT, LINE_PT, THICK_PT, WIDE_PT = 0.5, 0.8, 1.2, 1.8, 3.5
SCREEN_DPI = 100
FILE_DPI = 150
PAGE_DPI = 120  # of figures in web pages

STYLES = ("-", (0, (5, 1.5)), (0, (1.5, 1.2)))  # of lines beyond as many as there are colours

ROUND = (1.0, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0)  # leading digits of the ends of scales
HEADROOM = 1.06  # top of an axis from zero on, over the greatest value
LINE_IN = 0.17  # height of a line of small print [inches]


def new_figure(
    width_in: float, height_in: float, title: str, note: str = "", small_print: tuple[str, ...] = ()
) -> Figure:
    """Make an empty figure with its own Agg canvas, a heading, and small print at the foot.

    Parameters
    ----------
    width_in, height_in : size of the figure [inches]
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure
    from matplotlib.layout_engine import ConstrainedLayoutEngine

    head_in = 0.42 + (0.24 if note else 0.0)
    foot_in = 0.12 + LINE_IN * len(small_print) if small_print else 0.05
    rect = (0.0, foot_in / height_in, 1.0, 1.0 - (head_in + foot_in) / height_in)
    figure = Figure(figsize=(width_in, height_in), dpi=SCREEN_DPI, layout=ConstrainedLayoutEngine(rect=rect))
    FigureCanvasAgg(figure)
    title = shorten(title, int((width_in - 0.24) * 8.2))  # letters that fit
    left, top = 0.12 / width_in, 1.0 - 0.13 / height_in
    figure.text(left, top, title, fontsize=TITLE_PT, weight="bold", color=INK, va="top", in_layout=False)
    figure.text(left, top - 0.31 / height_in, note, fontsize=TEXT_PT, color=QUIET, va="top", in_layout=False)
    for k, line in enumerate(reversed(small_print)):
        y = (0.07 + LINE_IN * k) / height_in
        figure.text(left, y, line, fontsize=SMALL_PT, color=QUIET, va="bottom", in_layout=False)
    return figure


def style_axes(axes: Axes, title: str = "", x: str = "", y: str = "", note: str = "") -> None:
    """Give a plot its title, labels, a faint grid and grey axes.

    Parameters
    ----------
    title : at the left, above
    x, y : labels of the axes
    note : at the right, above
    """
    axes.set_title(title, loc="left", fontsize=HEADING_PT, color=INK)
    axes.set_title(note, loc="right", fontsize=SMALL_PT, color=QUIET)
    axes.set_xlabel(x, fontsize=TEXT_PT, color=QUIET)
    axes.set_ylabel(y, fontsize=TEXT_PT, color=QUIET)
    axes.tick_params(which="both", labelsize=SMALL_PT, color=RULE, labelcolor=QUIET)
    axes.grid(color=GRID, lw=HAIR_PT)
    for side, spine in axes.spines.items():
        spine.set_visible(side in ("left", "bottom"))
        spine.set_color(RULE)


def style_bar(bar: Colorbar, label: str = "") -> None:
    """Give a colour bar its label and quiet numbers.

    Parameters
    ----------
    label : with the unit
    """
    bar.ax.tick_params(which="both", labelsize=SMALL_PT, color=RULE, labelcolor=QUIET)
    bar.outline.set_edgecolor(RULE)
    bar.set_label(label, fontsize=TEXT_PT, color=QUIET)


def colour_axis(axes: Axes, side: Literal["left", "right"], colour: str) -> None:
    """Draw the axis of values at a side in the colour of its curve, where two curves have an axis each."""
    axes.spines[side].set(visible=True, color=colour, linewidth=THICK_PT)
    axes.tick_params(axis="y", which="both", color=colour)


def colour_of(number: int) -> tuple[str, Any]:
    """Return the colour and the line style of a curve by its number.

    Parameters
    ----------
    number : from 0; curves beyond as many as there are colours get another line style
    """
    return LINES[number % len(LINES)], STYLES[number // len(LINES) % len(STYLES)]


def draw_legend(axes: Axes, columns: int = 1) -> None:
    """Draw a frameless legend in quiet ink where it covers least."""
    axes.legend(fontsize=SMALL_PT, frameon=False, loc="best", labelcolor=QUIET, ncols=columns)


def widen_short_axis(axes: Axes, least: float) -> None:
    """Widen an axis of values that is too short, so that rounding does not look like motion.

    Parameters
    ----------
    least : span that the axis of values has at least, in its unit
    """
    low, high = axes.get_ylim()
    if high - low < least:
        middle = 0.5 * (low + high)
        axes.set_ylim(middle - 0.5 * least, middle + 0.5 * least)
    axes.ticklabel_format(axis="y", useOffset=False)


def shorten(text: str, letters: int) -> str:
    """Shorten a text to a number of letters, the last of them an ellipsis.

    Parameters
    ----------
    text : left as it is if it fits
    letters : most letters
    """
    return text if len(text) <= letters else f"{text[: letters - 1]}…"


def format_thousands(*several: Axis) -> None:
    """Format the ticks of some axes with a comma at each thousand and a true minus.

    Parameters
    ----------
    *several : such as ``axes.xaxis``
    """
    from matplotlib.ticker import FuncFormatter

    for axis in several:
        axis.set_major_formatter(FuncFormatter(lambda value, _: use_minus_sign(f"{value:,.10g}")))


def log_ticks(axis: Axis, low: float, high: float) -> None:
    """Set the ticks of a log axis, at least three of them with numbers however short the axis is."""
    from matplotlib.ticker import (
        FixedLocator,
        LogFormatterMathtext,
        LogLocator,
        MaxNLocator,
        NullFormatter,
    )

    decades = float(np.log10(high / low))
    axis.set_minor_formatter(NullFormatter())
    if decades > 5.0:
        axis.set_major_locator(LogLocator(base=10, numticks=8))
        axis.set_major_formatter(LogFormatterMathtext())
        return
    powers = 10.0 ** np.arange(np.floor(np.log10(low)), np.ceil(np.log10(high)) + 1.0)
    for steps in ((1.0,), (1.0, 2.0, 5.0), (1.0, 1.5, 2.0, 3.0, 5.0, 7.0)):
        ticks = np.outer(powers, steps).ravel()
        ticks = ticks[(ticks >= low * (1.0 - 1e-9)) & (ticks <= high * (1.0 + 1e-9))]
        if len(ticks) >= 3:
            break
    else:
        ticks = np.asarray(MaxNLocator(5, steps=(1, 2, 5, 10)).tick_values(low, high))
    axis.set_major_locator(FixedLocator(ticks.tolist()))
    format_thousands(axis)


def use_minus_sign(number: str) -> str:
    """Replace the hyphen of a number by a true minus."""
    return number.replace("-", "−")


def round_up(value: float) -> float:
    """Return the smallest round number, one of `ROUND` times a power of ten, that is at least `value`.

    Parameters
    ----------
    value : positive; 1 is returned for any other and for NaN

    Examples
    --------
    >>> [round_up(v) for v in (0.13, 2.1, 7.0)]
    [0.15, 2.5, 8.0]
    """
    if not value > 0:
        return 1.0
    power = math.floor(math.log10(value) + 1e-12)
    for step in ROUND:
        if step * 10.0**power >= value * (1 - 1e-9):
            return float(f"{step * 10.0**power:.6g}")
    return float(10.0 ** (power + 1))


def round_down(value: float) -> float:
    """Return the greatest of 1, 2 and 5 times a power of ten that is at most `value`, such as for a scale bar.

    Parameters
    ----------
    value : positive

    Examples
    --------
    >>> [round_down(v) for v in (0.13, 2.1, 7.0)]
    [0.1, 2.0, 5.0]
    """
    power = math.floor(math.log10(value) + 1e-12)
    step = max(step for step in (1.0, 2.0, 5.0) if step * 10.0**power <= value * (1 + 1e-9))
    return float(f"{step * 10.0**power:.6g}")
