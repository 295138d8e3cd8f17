"""Curves over a recording: range, detections, photons and range errors, frame by frame."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from rso_lidar import units
from rso_lidar.picture.selection.sequence import find_target_returns, format_start, pick, target_ranges_m
from rso_lidar.picture.style.figures import (
    HEADROOM,
    LINE_PT,
    THIN_PT,
    WIDE_PT,
    colour_axis,
    draw_legend,
    format_thousands,
    log_ticks,
    new_figure,
    style_axes,
)
from rso_lidar.picture.style.palette import BLUE, GREEN, ORANGE, RED, RULE
from rso_lidar.records import Frame

if TYPE_CHECKING:
    from matplotlib.figure import Figure

DRAWN = 600  # most frames read
NONE = float("nan")


@dataclass(frozen=True)
class FrameStatistics:
    """Contribution of one frame to the curves; NaN where it has none."""

    time_s: float
    true_range_m: float
    measured_m: float
    lit: int
    detected: int
    false: int
    photons_10: float
    photons_50: float
    photons_90: float
    error_16_m: float
    error_50_m: float
    error_84_m: float

    @staticmethod
    def of(frame: Frame) -> FrameStatistics:
        """Compute the numbers of a frame; errors are those of pixels with one cluster."""
        labels = frame.labels
        there = labels.target >= 0
        returned = find_target_returns(frame)
        photons = np.percentile(labels.photons[there], [10, 50, 90]) if there.any() else (NONE, NONE, NONE)
        judged = returned & (labels.cluster_count == 1)
        error_m = frame.range_m[judged].astype(float) - labels.range_m[judged]
        errors_m = np.percentile(error_m, [15.87, 50, 84.13]) if error_m.size else (NONE, NONE, NONE)
        return FrameStatistics(
            time_s=frame.time_s,
            true_range_m=min(target_ranges_m(frame).values(), default=NONE),
            measured_m=float(np.mean(frame.range_m[returned], dtype=float)) if returned.any() else NONE,
            lit=int(there.sum()),
            detected=int((frame.valid & there).sum()),
            false=int((frame.valid & ~there).sum()),
            photons_10=float(photons[0]),
            photons_50=float(photons[1]),
            photons_90=float(photons[2]),
            error_16_m=float(errors_m[0]),
            error_50_m=float(errors_m[1]),
            error_84_m=float(errors_m[2]),
        )


def curve_figure(frames: Iterable[Frame]) -> Figure:
    """Draw range, share of the target's pixels detected, photons per pixel and range error over time.

    The band of photons is the 10th to 90th percentile of pixels on a target. The band of errors is the 16th to 84th
    percentile of pixels with one cluster.

    Parameters
    ----------
    frames : a sequence, a recording or an iterator; thinned to 600

    Returns
    -------
    Figure
    """
    points, total = pick(
        frames, DRAWN, lambda frame: (FrameStatistics.of(frame), frame.source.title, format_start(frame))
    )
    table = {
        name: np.array([getattr(point, name) for point, _, _ in points])
        for name in FrameStatistics.__dataclass_fields__
    }
    time_s = table["time_s"]
    _, title, start = points[0]
    count = f"{total:,} frame{'s' * (total != 1)}" if total == len(points) else f"{len(points):,} of {total:,} frames"
    figure = new_figure(8.4, 9.2, title, f"{count}   ·   time since {start}")
    ranges, share, photons, errors = figure.subplots(4, 1, sharex=True)

    ranges.plot(time_s, table["true_range_m"], color=RULE, lw=WIDE_PT, label="truth, to the target's origin")
    ranges.plot(time_s, table["measured_m"], ".", color=BLUE, ms=4, label="mean of the returns")
    style_axes(ranges, y="Range [m]")
    format_thousands(ranges.yaxis)
    farthest_m = np.nanmax([table["true_range_m"], table["measured_m"]], initial=0.0)
    ranges.set_ylim(0.0, HEADROOM * float(farthest_m) or 1.0)
    draw_legend(ranges)

    lit = table["lit"]
    share.plot(
        time_s, np.where(lit > 0, table["detected"] / np.maximum(lit, 1), NONE), ".-", color=GREEN, ms=4, lw=THIN_PT
    )
    share.set_ylim(-0.03, 1.03)
    style_axes(share, y="Detected share of\nthe target's pixels")
    pixels = share.twinx()
    pixels.plot(time_s, table["lit"], color=ORANGE, lw=LINE_PT, alpha=0.9)
    pixels.set_ylim(0.0, HEADROOM * float(lit.max()) or 1.0)
    style_axes(pixels, y="Pixels on the target")
    pixels.grid(False)
    format_thousands(pixels.yaxis)
    colour_axis(pixels, "right", ORANGE)
    colour_axis(share, "left", GREEN)

    photons.fill_between(
        time_s, table["photons_10"], table["photons_90"], color=BLUE, alpha=0.18, lw=0, label="10 to 90 %"
    )
    photons.plot(time_s, table["photons_50"], color=BLUE, lw=LINE_PT, label="median")
    if np.nanmax(table["photons_50"], initial=0.0) > 0:
        photons.set_yscale("log")
    style_axes(photons, y="Expected photons\nper pixel on the target")
    draw_legend(photons)

    low_cm, middle_cm, high_cm = (table[f"error_{rank}_m"] / units.CM for rank in (16, 50, 84))
    errors.axhline(0, color=RULE, lw=THIN_PT)
    errors.fill_between(time_s, low_cm, high_cm, color=ORANGE, alpha=0.25, lw=0, label="16 to 84 %")
    errors.plot(time_s, middle_cm, ".", color=RED, ms=4, label="median, pixels of one cluster")
    style_axes(errors, x="Time [s]", y="Range minus truth [cm]")
    format_thousands(errors.xaxis)
    draw_legend(errors)
    if len(points) == 1:  # a line of one point is invisible
        for axes in (ranges, pixels, photons):
            axes.get_lines()[0].set(marker="_", ms=14, mew=axes.get_lines()[0].get_linewidth())
    if photons.get_yscale() == "log":
        photons.set_ylim(*_widen_to_decade(*photons.get_ylim()))
        log_ticks(photons.yaxis, *photons.get_ylim())
    figure.align_ylabels([ranges, share, photons, errors])
    return figure


def _widen_to_decade(low: float, high: float) -> tuple[float, float]:
    """Return limits of a log axis that span at least a decade, so that rounding does not look like change."""
    wider = max(1.0, math.sqrt(10.0 * low / high))
    return low / wider, high * wider
