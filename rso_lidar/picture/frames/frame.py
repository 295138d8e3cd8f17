"""One frame as a figure: range, intensity, parts, and range minus truth."""

from __future__ import annotations

import io
import math
import textwrap
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from rso_lidar import units
from rso_lidar.files import check_writable
from rso_lidar.picture.frames.panels import draw_camera, draw_error, draw_intensity, draw_parts, draw_range
from rso_lidar.picture.frames.part_colours import PartKey
from rso_lidar.picture.selection.sequence import (
    choose_window,
    find_target_returns,
    format_start,
    pixel_rad,
    target_ranges_m,
)
from rso_lidar.picture.style.figures import PAGE_DPI, SMALL_PT, TEXT_PT, new_figure, use_minus_sign
from rso_lidar.picture.style.output import FIGURE_SUFFIXES, save_figure
from rso_lidar.picture.style.palette import LIGHT, QUIET, Scheme
from rso_lidar.picture.style.recolour import recolour
from rso_lidar.records import Frame

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from PIL import Image

WIDTH_IN, ROW_IN = 11.6, 4.5  # of the figure, and of a row of two panels
LETTERS = 156  # letters in a line of small print
MOST_TARGETS = 3  # most targets whose geometry is described


def save_frame(frame: Frame, path: str | Path, scheme: Scheme = LIGHT) -> Path:
    """Draw `frame_figure(frame)` and write it as PNG, PDF or SVG, by the suffix; return its path.

    Parameters
    ----------
    frame : to be drawn
    path : of the picture; an existing file is replaced
    scheme : `LIGHT` or `DARK`

    Returns
    -------
    Path
    """
    place = check_writable(path, FIGURE_SUFFIXES, overwrite=True)
    return save_figure(frame_figure(frame), place, scheme=scheme)


def draw(frame: Frame, scheme: Scheme = LIGHT) -> Image.Image:
    """Draw `frame_figure(frame)` as an image, which a notebook shows; `.show()` opens it, `.save(path)` writes it.

    Parameters
    ----------
    frame : to be drawn
    scheme : `LIGHT` or `DARK`

    Returns
    -------
    PIL.Image.Image
    """
    from PIL import Image

    figure = frame_figure(frame)
    recolour(figure, scheme)
    with io.BytesIO() as held:
        figure.savefig(held, format="png", dpi=PAGE_DPI)
        return Image.open(held).convert("RGB")


def frame_figure(frame: Frame, parts: Sequence[PartKey] = ()) -> Figure:
    """Draw a figure of one frame: measured range, intensity, the true parts, range minus truth, and images of cameras.

    The first four show the same square around the target, or the whole field where the target fills it; rows and columns are
    numbered as in the arrays. Limits of colour leave out one per cent at either end.

    Parameters
    ----------
    frame : what is drawn
    parts : which parts get a colour of their own where there are more parts than colours, the first first (none:
        those with most pixels); `rank_parts` of all frames of a series gives a part one colour in all

    Returns
    -------
    Figure
    """
    window = choose_window(frame)
    rows = 2 + math.ceil(len(frame.camera) / 2)
    figure = new_figure(
        WIDTH_IN, ROW_IN * rows, frame.source.title, summarize_frame(frame), tuple(_describe_geometry(frame))
    )
    panels = figure.subplots(rows, 2, squeeze=True)
    draw_range(panels[0, 0], frame, window)
    draw_intensity(panels[0, 1], frame, window)
    draw_parts(panels[1, 0], frame, window, parts)
    draw_error(panels[1, 1], frame, window)
    of_cameras = panels.flat[4:]
    for axes, camera in zip(of_cameras, frame.camera, strict=False):
        draw_camera(axes, frame, camera)
    for axes in of_cameras[len(frame.camera) :]:
        axes.remove()
    for axes in panels.flat[: 4 + len(frame.camera)]:
        axes.set_xlabel("col", fontsize=TEXT_PT, color=QUIET)
        axes.set_ylabel("row", fontsize=TEXT_PT, color=QUIET)
        axes.tick_params(labelsize=SMALL_PT, colors=QUIET)
        for spine in axes.spines.values():
            spine.set(visible=True, color=QUIET)
    return figure


def summarize_frame(frame: Frame) -> str:
    """Describe a frame in one line: number, instant, mean range of the targets' returns, returns and expected photons.

    Parameters
    ----------
    frame : of a run or a recording

    Returns
    -------
    str
    """
    words = [f"frame {frame.index}", f"{frame.time_s:,.3f} s after {format_start(frame)}"]
    returned = find_target_returns(frame)
    if returned.any():
        words.append(f"mean range {float(np.mean(frame.range_m[returned], dtype=float)):,.2f} m")
    words.append(f"{int(frame.valid.sum()):,} returns")
    words.append(f"{float(np.sum(frame.labels.photons, dtype=float)):,.0f} photons expected")
    return "   ·   ".join(words)


def _describe_geometry(frame: Frame) -> list[str]:
    """Return lines on the positions of the targets and the pointing of the lidar."""
    lines = []
    ranges_m = target_ranges_m(frame)
    for name, range_m in list(ranges_m.items())[:MOST_TARGETS]:
        lidar_from_target = frame.truth.pose("lidar", name)
        right, down, ahead = lidar_from_target.translation
        off_deg = float(np.arctan2(np.hypot(right, down), ahead)) / units.DEG
        velocity_m_s, _ = frame.truth.rates("lidar", name)
        speed = float(lidar_from_target.translation @ velocity_m_s) / range_m if range_m > 0 else 0.0
        rate = use_minus_sign(f"{speed:+.3f}")
        about = f"{name}: {range_m:,.2f} m, range rate {rate} m/s, {off_deg:.3f}° off the boresight;  "
        if f"{name}.rtn" in frame.truth.poses:
            place = frame.truth.pose(f"{name}.rtn", "lidar").translation
            radial, along, cross = (use_minus_sign(f"{value:,.1f}") for value in place)
            about += f"in its rtn axes the lidar is at radial {radial}, along-track {along}, cross-track {cross} m"
        else:
            turn = ", ".join(f"{value:.4f}" for value in lidar_from_target.rotation.as_quat(canonical=True))
            about += f"lidar_from_{name} x, y, z, w = {use_minus_sign(turn)}"
        lines += textwrap.wrap(about, LETTERS)
    pitch_rad = pixel_rad(frame)
    n_rows, n_cols = frame.valid.shape
    words = [f"{len(ranges_m) - MOST_TARGETS} more targets"] if len(ranges_m) > MOST_TARGETS else []
    words += [f"{n_rows} × {n_cols} pixels of {pitch_rad * 1e3:.4f} mrad"]
    if ranges_m:
        words.append(f"{pitch_rad * min(ranges_m.values()):.3g} m at the target")
    if frame.observation.pan_tilt_rad is not None:
        pan_deg, tilt_deg = frame.observation.pan_tilt_rad / units.DEG
        words.append(use_minus_sign(f"measured pan {pan_deg:+.3f}°, tilt {tilt_deg:+.3f}°"))
    return [*lines, ",  ".join(words)]
