"""A link budget drawn: photons, signal, detection, false alarms, precision and pixels on the target against range."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from rso_lidar import units
from rso_lidar.mission_analysis.budgets.range_curve import BudgetCurve
from rso_lidar.picture import figures, palette

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_COLOURS = (palette.BLUE, palette.ORANGE, palette.GREEN, palette.PINK, palette.RED, palette.SKY)
_STYLES = ("-", (0, (5, 2)))
_DASH = 5.0  # line widths, of a curve on others
_SAME = 0.01  # a curve within this share of another is drawn on it
_LOWEST_PHOTONS = 1.0


def budget_figure(
    curves: Sequence[BudgetCurve],
    names: Sequence[str],
    title: str,
    note: str,
    probability: float,
    *,
    filled_to_m: float = math.inf,
    small_print: Sequence[str] = (),
) -> Figure:
    """Draw a link budget against range in six plots, with the greatest ranges of the wanted probability marked.

    Precision is drawn where at least a hundredth of the returns are detected: of others there is none. Photons are drawn
    broad where they saturate the pixel.

    Parameters
    ----------
    filled_to_m : range beyond which the target fills no pixel, and curves are drawn faintly [m]
    """
    figure = figures.new_figure(11.0, 11.0, title, note, tuple(small_print))
    (light, signal), (detection, alarms), (precision, pixels) = figure.subplots(3, 2, sharex=True)
    for number, (name, curve) in enumerate(zip(names, curves, strict=True)):
        look: dict[str, Any] = {
            "color": _COLOURS[number % len(_COLOURS)],
            "ls": _STYLES[number // len(_COLOURS) % 2],
            "lw": figures.LINE_PT,
        }
        ends = _ARMED if curve.armed_limits else _FILLED if curve.fill_limits else ""
        reach = ": never" if np.isnan(curve.max_range_m) else f": {_format_length(curve.max_range_m)}{ends}"
        shown = np.where(curve.detection_probability >= 0.01, curve.range_precision_m / units.CM, np.nan)
        light.plot([], [], label=f"{name}{reach}", **look)
        if np.any(curve.saturated):
            broad = np.where(curve.saturated, curve.photons, np.nan)
            light.plot(curve.range_m, broad, color=look["color"], lw=_BROAD_PT, alpha=_FAINT, solid_capstyle="butt")
        _draw_curve(alarms, curve.range_m, curve.false_alarm_probability / units.PPM, look, len(curves))
        for axes, values in (
            (light, curve.photons),
            (signal, np.where(np.isfinite(curve.snr), curve.snr, np.nan)),
            (detection, curve.detection_probability),
            (precision, shown),
        ):
            if filled_to_m < curve.range_m[-1]:
                _draw_curve(axes, curve.range_m, values, look, len(curves), alpha=_FAINT)
            near = curve.range_m <= filled_to_m
            _draw_curve(axes, curve.range_m, np.where(near, values, np.nan), look, len(curves))
        _draw_curve(pixels, curve.range_m, curve.pixels_on_target, look, len(curves))
        if curve.range_m[0] <= curve.max_range_m <= curve.range_m[-1]:
            at = np.log(curve.max_range_m)
            there = float(np.interp(at, np.log(curve.range_m), curve.detection_probability)) if ends else probability
            _mark(detection, curve.max_range_m, there, str(look["color"]))
            for axes, values in ((light, curve.photons), (pixels, curve.pixels_on_target)):
                height = np.exp(np.interp(at, np.log(curve.range_m), np.log(np.maximum(values, 1e-12))))
                _mark(axes, curve.max_range_m, float(height), str(look["color"]))
    detection.axhline(probability, color=palette.RULE, lw=figures.THIN_PT, zorder=0)
    saturates = any(np.any(curve.saturated) for curve in curves)
    _prepare_axes(
        light, "Photons on the pixel", f"expected, after the optics{'; broad: saturated' if saturates else ''}"
    )
    _prepare_axes(signal, "Signal-to-noise ratio", "of amplitudes")
    _prepare_axes(detection, "Probability of detection", f"marked: P = {probability:g}")
    _prepare_axes(alarms, "Earlier false alarms", "per million returns, in the dark")
    _prepare_axes(precision, "Range precision [cm]", "1 sigma of detected returns")
    _prepare_axes(pixels, "Pixels on the target", "lit and in the field")
    for axes in (light, signal, precision, pixels):
        _use_log_scale(axes, (1.0, 10.0))
    _use_log_scale(alarms, (1.0, 1e6))
    first, last = min(curve.range_m[0] for curve in curves), max(curve.range_m[-1] for curve in curves)
    if first < filled_to_m < last:
        for axes in (light, signal, detection, precision):
            axes.axvline(filled_to_m, color=palette.QUIET, lw=figures.THIN_PT, ls=(0, (2, 3)), zorder=0)
    low, high = light.get_ylim()
    if high > 10.0 * _LOWEST_PHOTONS:
        light.set_ylim(max(_LOWEST_PHOTONS, low), high)
    detection.set_ylim(-0.02, 1.04)
    for axes in (light, signal, alarms, precision, pixels):
        figures.log_ticks(axes.yaxis, *axes.get_ylim())
    for axes in (light, signal, detection, alarms, precision, pixels):
        figures.log_ticks(axes.xaxis, *axes.get_xlim())
    for axes in (precision, pixels):
        axes.set_xlabel("Range [m]", fontsize=figures.TEXT_PT, color=palette.QUIET)
    figure.align_ylabels()
    _draw_legend(figure, light, probability, len(small_print))
    return figure


def _draw_curve(
    axes: Axes, range_m: np.ndarray, values: np.ndarray, look: dict[str, Any], most: int, **more: Any
) -> None:
    """Draw a curve, in dashes of its own where it lies on others, so that the colours of all take turns.

    Parameters
    ----------
    range_m, values : (point,)
    """
    covered = sum(
        np.array_equal(line.get_xdata(), range_m)
        and np.allclose(np.asarray(line.get_ydata(), dtype=float), values, rtol=_SAME, atol=0.0, equal_nan=True)
        for line in axes.get_lines()
    )
    if covered:
        look = look | {"ls": (_DASH * covered, (_DASH, _DASH * max(most - 1, 1)))}
    axes.plot(range_m, values, **look, **more)


def _draw_legend(figure: Figure, axes: Axes, probability: float, printed: int) -> None:
    """Write the names of the curves between the plots and the small print, and make room for them."""
    handles, names = axes.get_legend_handles_labels()
    columns = 1 if len(names) <= 2 else 2 if len(names) <= 8 else 3
    height_in = float(figure.get_figheight())
    foot_in = 0.12 + figures.LINE_IN * printed
    legend = figure.legend(
        handles,
        names,
        title=f"Greatest range of P = {probability:g}",
        loc="lower center",
        bbox_to_anchor=(0.5, foot_in / height_in),
        ncols=columns,
        fontsize=figures.SMALL_PT,
        frameon=False,
        labelcolor=palette.INK,
        borderaxespad=0.0,
    )
    legend.set_in_layout(False)
    legend.get_title().set(fontsize=figures.SMALL_PT, color=palette.QUIET)
    room_in = float(legend.get_window_extent().height) / figure.dpi
    head_in = 0.66
    engine: Any = figure.get_layout_engine()
    engine.set(rect=(0.0, (foot_in + room_in) / height_in, 1.0, 1.0 - (foot_in + room_in + head_in) / height_in))


_ARMED = " (end of the armed window)"
_FILLED = " (fills a pixel no farther)"
_FAINT = 0.3
_BROAD_PT = 7.0
_LEAST_SPAN = 1.5  # least ratio of the ends of a log axis: a shorter axis would show rounding


def _prepare_axes(axes: Axes, title: str, note: str) -> None:
    """Prepare a panel with a logarithmic range axis."""
    axes.set_xscale("log")
    figures.style_axes(axes, title, note=note)
    axes.tick_params(labelbottom=True)


def _use_log_scale(axes: Axes, empty: tuple[float, float]) -> None:
    """Make the axis of values logarithmic; `empty` are its limits where no value is above 0."""
    values = np.concatenate([np.asarray(line.get_ydata(), dtype=float) for line in axes.get_lines()])
    if not np.any(values > 0.0):
        axes.set_ylim(*empty)
    axes.set_yscale("log")
    low, high = axes.get_ylim()
    if high < _LEAST_SPAN * low:
        middle = math.sqrt(low * high)
        axes.set_ylim(middle / math.sqrt(_LEAST_SPAN), middle * math.sqrt(_LEAST_SPAN))


def _mark(axes: Axes, x: float, y: float, colour: str) -> None:
    """Mark a point."""
    axes.plot([x], [y], "o", color=colour, ms=5, mec=palette.PAPER, mew=0.8, zorder=5)


def _format_length(metres: float) -> str:
    return f"{metres / units.KM:.3g} km" if metres >= units.KM else f"{metres:.3g} m"
