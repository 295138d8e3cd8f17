"""A data sheet drawn: detection, range scatter, range bias and signal over noise against light."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from rso_lidar import units
from rso_lidar.detector import CameraFigure, LightCurve
from rso_lidar.mission_analysis.camera.figure_text import format_photons
from rso_lidar.picture import figures, palette

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

NORMAL_95 = 1.959963984540054  # half the width of a 95 % interval, over a normal law's standard deviation
_MARKED = (50, 95)  # per cent of detection


def data_sheet_figure(camera: str, about: str, quantities: Sequence[CameraFigure], curve: LightCurve) -> Figure:
    """Draw detection, scatter and bias of range, and signal over noise against light.

    Lines are closed forms, points are trials with their 95 % intervals.

    Parameters
    ----------
    camera, about : name of the camera, and what it is in a line
    quantities, curve : of the data sheet, and its curve over light
    """
    small = (
        about.partition("; ")[0],
        f"Lines: closed form. Points: {curve.trials:,} trials of each level, 95 % intervals",
    )
    figure = figures.new_figure(
        11.0, 7.8, f"Data sheet of {camera}", "of a facing surface that fills the pixel, in the dark", small
    )
    (detection, scatter), (bias, ratio) = figure.subplots(2, 2, sharex=True)
    x, colour = curve.photons, palette.BLUE
    _draw_detection(detection, quantities, curve)
    scatter.plot(x, curve.closed_form_sigma_m / units.CM, color=colour, lw=figures.LINE_PT)
    _draw_points(scatter, x, curve.range_sigma_m / units.CM, curve.range_sigma_error_m / units.CM)
    _draw_points(bias, x, curve.range_bias_m / units.CM, curve.range_bias_error_m / units.CM)
    bias.axhline(0.0, color=palette.RULE, lw=figures.THIN_PT, zorder=0)
    ratio.plot(
        x, np.where(curve.snr > 0.0, curve.snr, np.nan), color=colour, lw=figures.LINE_PT, label="signal, closed form"
    )
    with np.errstate(divide="ignore", invalid="ignore"):
        counts = np.where(
            curve.intensity_sigma_counts > 0.0, curve.intensity_counts / curve.intensity_sigma_counts, np.nan
        )
    ratio.plot(x, counts, "o", color=palette.ORANGE, ms=4, label="reported intensity, trials")
    for axes, title, note in (
        (detection, "Probability of detection", "marked: 50 and 95 %"),
        (scatter, "Range sigma [cm]", "of a single range"),
        (bias, "Range bias [cm]", "mean error"),
        (ratio, "Signal over noise", "as amplitudes"),
    ):
        axes.set_xscale("log")
        figures.style_axes(axes, title, note=note)
        axes.tick_params(labelbottom=True)
    for axes in (scatter, ratio):
        if _has_positive(axes):
            axes.set_yscale("log")
            figures.log_ticks(axes.yaxis, *axes.get_ylim())
    _mark_saturation((detection, scatter, bias, ratio), quantities, x)
    for axes in (detection, scatter, bias, ratio):
        figures.log_ticks(axes.xaxis, *axes.get_xlim())
    for axes in (bias, ratio):
        axes.set_xlabel("Photons on the pixel", fontsize=figures.TEXT_PT, color=palette.QUIET)
    figures.draw_legend(ratio)
    figure.align_ylabels()
    return figure


def _draw_detection(axes: Axes, quantities: Sequence[CameraFigure], curve: LightCurve) -> None:
    """Draw the probability of detection, and mark the light of 50 and 95 %."""
    axes.plot(curve.photons, curve.closed_form_probability, color=palette.BLUE, lw=figures.LINE_PT)
    share = curve.detected_fraction
    reach = np.abs(np.stack([share - curve.detected_low, curve.detected_high - share]))
    axes.errorbar(curve.photons, share, reach, fmt="o", color=palette.BLUE, ms=4, lw=figures.THIN_PT)
    by_name = {quantity.name: quantity.value for quantity in quantities}
    for percent in _MARKED:
        light = by_name.get(f"photons_at_{percent}_percent", math.inf)
        if math.isfinite(light):
            axes.plot([light], [percent / 100.0], "o", color=palette.ORANGE, ms=6, mec=palette.PAPER, mew=0.8, zorder=5)
            axes.annotate(
                f"{percent} %: {format_photons(light)}",
                (light, percent / 100.0),
                xytext=(9, -9),
                textcoords="offset points",
                fontsize=figures.SMALL_PT,
                color=palette.INK,
            )
    axes.set_ylim(-0.02, 1.04)


def _draw_points(axes: Axes, x: np.ndarray, y: np.ndarray, error: np.ndarray) -> None:
    """Draw values with their 95 % intervals, from standard errors."""
    axes.errorbar(x, y, NORMAL_95 * error, fmt="o", color=palette.BLUE, ms=4, lw=figures.THIN_PT)


def _has_positive(axes: Axes) -> bool:
    """Return whether a plot has a value above zero, which a logarithmic axis needs."""
    values = [np.asarray(line.get_ydata(), dtype=float) for line in axes.get_lines()]
    return bool(np.any(np.concatenate(values) > 0.0)) if values else False


def _mark_saturation(plots: Sequence[Axes], quantities: Sequence[CameraFigure], x: np.ndarray) -> None:
    """Mark the light that saturates in all plots, where it is on the axis."""
    full = next((quantity.value for quantity in quantities if quantity.name == "saturation_photons"), math.inf)
    if not x[0] < full < x[-1]:
        return
    for axes in plots:
        axes.axvline(full, color=palette.QUIET, lw=figures.THIN_PT, ls=(0, (2, 3)), zorder=0)
    place: dict[str, Any] = {"rotation": 90, "ha": "right", "va": "bottom", "fontsize": figures.SMALL_PT}
    plots[0].text(full, 0.05, "saturation ", color=palette.QUIET, **place)
