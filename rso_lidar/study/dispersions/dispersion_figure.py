"""Dispersed flights in one picture: tubes of the path in rtn axes, range, nearest approach, and detection over time."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from rso_lidar.picture import figures, palette

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_NAMES = {"radial": "Radial", "along": "Along-track", "cross": "Cross-track"}
_MUCH = 20.0  # times the usual deviation
_TWO_SIGMA = 1.96  # half width of the linear tube that holds 95 % of a normal distribution
_STATES = 6  # of the filter, which is the mean NEES if it is consistent
Table = Mapping[str, np.ndarray]


def dispersion_figure(
    tubes: Table, table: Table, target: str, title: str, keep_out_m: float = 0.0, hard_body_radius_m: float = 0.0
) -> Figure:
    """Draw dispersed flights: deviations in three axes, range, least distances, and detection.

    Parameters
    ----------
    tubes, table : columns over time and over runs, as `rso_lidar.study.disperse` makes them
    keep_out_m, hard_body_radius_m : marked where they are above 0 [m]
    """
    count = len(table["run"])
    note = f"{count:,} runs about {target}   ·   shaded: 95 % of the runs   ·   dashed: 95 % by linear covariance"
    note += "   ·   orange: 95 % of the filter's errors" if "nees" in tubes else ""
    has_filter = "nees" in tubes
    figure = figures.new_figure(9.6, 12.0 if has_filter else 9.2, title or "Dispersions", note)
    plots = figure.subplots(4 if has_filter else 3, 2)
    unit, word = (3600.0, "h") if tubes["time_s"][-1] > 20_000.0 else (1.0, "s")
    time = tubes["time_s"] / unit
    for axes, (axis, name) in zip(plots.flat, _NAMES.items(), strict=False):
        middle = tubes[f"{axis}_m"]
        low, high = (tubes[f"{axis}_p{level}_m"] - middle for level in ("2.5", "97.5"))
        axes.fill_between(time, low, high, color=palette.BLUE, alpha=0.25, lw=0)
        for sign in (-1.0, 1.0):
            axes.plot(
                time,
                sign * _TWO_SIGMA * tubes[f"{axis}_linear_sigma_m"],
                color=palette.INK,
                lw=figures.THIN_PT,
                ls=(0, (4, 3)),
            )
        _draw_knowledge(axes, time, tubes, axis)
        _spread_scale(axes, tubes[f"{axis}_linear_sigma_m"])
        figures.style_axes(axes, x=f"Time [{word}]", y=f"{name} deviation [m]")
    axes = plots.flat[3]
    axes.fill_between(time, tubes["range_p2.5_m"], tubes["range_p97.5_m"], color=palette.BLUE, alpha=0.25, lw=0)
    axes.plot(time, tubes["range_p50_m"], color=palette.BLUE, lw=figures.LINE_PT)
    axes.set_yscale("log")
    figures.style_axes(axes, x=f"Time [{word}]", y="Range [m]")
    figures.log_ticks(axes.yaxis, *axes.get_ylim())
    _draw_nearest(plots.flat[4], table, keep_out_m, hard_body_radius_m)
    axes = plots.flat[5]
    axes.plot(time, tubes["detected_probability"], color=palette.GREEN, lw=figures.THICK_PT)
    axes.set_ylim(-0.03, 1.03)
    figures.style_axes(axes, x=f"Time [{word}]", y="P(detected by then)")
    if has_filter:
        _draw_filter(plots.flat[6], time, tubes, word)
        _draw_nees(plots.flat[7], time, tubes, word)
    for axes in plots.flat:
        figures.format_thousands(axes.xaxis)
    figure.align_ylabels(plots)
    return figure


def _draw_knowledge(axes: Axes, time: np.ndarray, tubes: Table, axis: str) -> None:
    """Draw the errors of the navigation filter, by runs and as it states them."""
    if "nees" not in tubes:
        return
    for sign in (-1.0, 1.0):
        axes.plot(
            time, sign * _TWO_SIGMA * tubes[f"{axis}_knowledge_sigma_m"], color=palette.ORANGE, lw=figures.LINE_PT
        )
        stated = sign * _TWO_SIGMA * tubes[f"{axis}_filter_sigma_m"]
        axes.plot(time, stated, color=palette.ORANGE, lw=figures.THIN_PT, ls=(0, (1, 2)))


def _draw_filter(axes: Axes, time: np.ndarray, tubes: Table, word: str) -> None:
    """Draw the standard deviations of the filter's error in three axes, by runs and as it states them."""
    for (axis, name), colour in zip(_NAMES.items(), (palette.BLUE, palette.ORANGE, palette.GREEN), strict=True):
        axes.plot(time, tubes[f"{axis}_knowledge_sigma_m"], color=colour, lw=figures.LINE_PT, label=name)
        axes.plot(time, tubes[f"{axis}_filter_sigma_m"], color=colour, lw=figures.THIN_PT, ls=(0, (1, 2)))
    axes.set_yscale("log")
    figures.log_ticks(axes.yaxis, *axes.get_ylim())
    axes.legend(fontsize=figures.TEXT_PT, frameon=False, labelcolor=palette.QUIET, loc="upper right")
    figures.style_axes(axes, x=f"Time [{word}]", y="Filter's error, one sigma [m]")


def _draw_nees(axes: Axes, time: np.ndarray, tubes: Table, word: str) -> None:
    """Draw the mean NEES of the runs, 6 for consistent filters."""
    axes.axhline(_STATES, color=palette.INK, lw=figures.THIN_PT, ls=(0, (4, 3)))
    axes.plot(time, tubes["nees"], color=palette.BLUE, lw=figures.LINE_PT)
    axes.set_ylim(0.0, max(2.0 * _STATES, 1.1 * float(tubes["nees"].max())))
    figures.style_axes(axes, x=f"Time [{word}]", y="Mean NEES of the filters")


def _spread_scale(axes: Axes, sigma_m: np.ndarray) -> None:
    """Make the scale linear near zero and logarithmic beyond, where the greatest deviation hides the usual ones."""
    usual = float(np.median(sigma_m))
    if 0.0 < usual * _MUCH < float(sigma_m.max()):
        axes.set_yscale("symlog", linthresh=10.0 ** np.ceil(np.log10(_TWO_SIGMA * usual)))


def _draw_nearest(axes: Axes, table: Table, keep_out_m: float, hard_body_radius_m: float) -> None:
    """Draw the distribution of the nearest approach over runs, with the two radii [m] that are above 0."""
    nearest = np.sort(table["nearest_m"])
    share = (np.arange(len(nearest)) + 1.0) / len(nearest)
    axes.step(nearest, share, where="post", color=palette.BLUE, lw=figures.THICK_PT)
    for limit_m, colour, word in (
        (hard_body_radius_m, palette.RED, "collision"),
        (keep_out_m, palette.ORANGE, "keep-out"),
    ):
        if limit_m > 0.0:
            axes.axvline(limit_m, color=colour, lw=figures.LINE_PT)
            axes.text(limit_m, 0.97, word, color=colour, fontsize=figures.TEXT_PT, va="top", rotation=90, ha="left")
    axes.set_xlim(left=0.0)
    axes.set_ylim(-0.03, 1.03)
    axes.set_facecolor("none")
    axes.grid(color=palette.SHADE)
    figures.style_axes(axes, x="Nearest approach [m]", y="Share of the runs")
    axes.tick_params(colors=palette.QUIET)
