"""Images of single frames as PNG: range and intensity side by side, in the colours of the package's own pictures."""

from __future__ import annotations

import io
import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from rso_lidar.picture import (
    LIGHT,
    Scale,
    Scheme,
    Thumbnail,
    Window,
    choose_window,
    colour_maps,
    draw_panel,
    draw_text,
    figures,
    find_target_returns,
    palette,
)
from rso_lidar.records import Frame

if TYPE_CHECKING:
    from PIL.ImageDraw import ImageDraw

_SIDE, _LEFT, _TOP, _GAP, _FOOT, _TEXT = 440, 44, 30, 60, 66, 17  # of a panel, and about it [pixels]
IMAGE_SIZE = (2 * _SIDE + 2 * _LEFT + _GAP - 16, _TOP + _SIDE + _FOOT)


def draw_image(frame: Frame, scheme: Scheme = LIGHT, *, whole: bool = False, beside: Frame | None = None) -> bytes:
    """Draw range and intensity of a frame side by side, with axes, colour bars and a scale bar, as PNG.

    Parameters
    ----------
    scheme : `LIGHT` or `DARK`
    beside : a frame to compare with; the part of the field and the colours span both, whichever is drawn
    """
    spanned = (frame,) if beside is None else (frame, beside)
    window, scale = choose_window(*spanned, whole=whole), Scale.of_frames(*spanned)
    saturated = int(frame.saturated.sum())
    kind, low, high = scale.intensity_words
    counts = scale.intensity_rgb(frame.intensity_counts)
    false = np.asarray(frame.valid) & ~find_target_returns(frame)
    counts[false] = palette.dim(counts[false], palette.NO_LIGHT)
    panels = (
        draw_range_panel(frame, window, scale),
        Panel(
            kind,
            f"{saturated:,} saturated" if saturated else "",
            colour_maps.INTENSITY_RAMP,
            counts,
            palette.NO_LIGHT,
            (low, high),
            window,
        ),
    )
    return draw_panels(panels, measure_width_m(frame, window), scheme)


def draw_range_panel(frame: Frame, window: Window, scale: Scale) -> Panel:
    """Return the panel of the range of a frame; false returns are dim."""
    ranges = scale.range_rgb(frame.range_m, 0.0)
    false = np.asarray(frame.valid) & ~find_target_returns(frame)
    ranges[false] = palette.dim(ranges[false], palette.NO_RETURN)
    ends_m = (f"{scale.low_m:,.2f}", f"{scale.high_m:,.2f} m")
    note = "dark: no return, dim: false"
    return Panel("Range", note, colour_maps.RANGE_RAMP, ranges, palette.NO_RETURN, ends_m, window)


def measure_width_m(frame: Frame, window: Window) -> float:
    """Return the width [m] at the target of a panel with a part of the lidar's field."""
    return Thumbnail.of(frame).pixel_m * max(window.width, window.height)


def draw_difference(first: Frame, other: Frame, scheme: Scheme = LIGHT) -> bytes:
    """Draw the differences of range and of intensity of two frames, where both report, as PNG; zero is white.

    The colours end at the 99th percentile of the magnitude, over returns from targets. Where one of the two is false, the
    difference is dim.

    Parameters
    ----------
    first, other : the frames; what is shown is the second minus the first
    scheme : `LIGHT` or `DARK`
    """
    window, both = choose_window(first, other), np.asarray(first.valid & other.valid)
    true = both & find_target_returns(first) & find_target_returns(other)
    counted = true if true.any() else both
    panels = []
    for title, unit, differences in (
        ("Range B − A", "m", np.asarray(other.range_m, float) - first.range_m),
        ("Intensity B − A", "counts", np.asarray(other.intensity_counts, float) - first.intensity_counts),
    ):
        known = np.where(both, differences, np.nan)
        size = np.abs(known[counted])
        limit = figures.round_up(float(np.percentile(size, 99))) if size.size and size.max() > 0.0 else 1.0
        step = np.clip(np.nan_to_num(known) / limit * 127.5 + 127.5, 0, 255).round().astype(int)
        rgb = colour_maps.ramp(colour_maps.ERROR_RAMP)[step]
        rgb[both & ~true] = palette.dim(rgb[both & ~true], palette.NO_RETURN)
        rgb[~both] = palette.split_rgb(palette.NO_RETURN)
        panels.append(
            Panel(
                title,
                "dark: not in both",
                colour_maps.ERROR_RAMP,
                rgb,
                palette.NO_RETURN,
                (f"−{limit:g}", f"{limit:g} {unit}"),
                window,
            )
        )
    return draw_panels(tuple(panels), math.nan, scheme)


@dataclass(frozen=True, eq=False)
class Panel:
    """One of two panels: title, note, colours (row, col, rgb), the words at the ends of its colour bar, and its window."""

    title: str
    note: str
    ramp: str
    rgb: np.ndarray
    empty: str
    ends: tuple[str, str]
    window: Window


def draw_panels(panels: tuple[Panel, ...], across_m: float, scheme: Scheme) -> bytes:
    """Draw two panels side by side, with axes, colour bars and a scale bar, as PNG.

    Parameters
    ----------
    across_m : width of the second panel at the target, NaN for no scale bar
    scheme : `LIGHT` or `DARK`
    """
    from PIL import Image, ImageDraw

    image = Image.new("RGB", IMAGE_SIZE, scheme.paper)
    draw = ImageDraw.Draw(image)
    for number, panel in enumerate(panels):
        left = _LEFT + number * (_SIDE + _GAP)
        image.paste(draw_panel(panel.window.cut(panel.rgb), _SIDE, panel.empty), (left, _TOP))
        draw_text(draw, left, 6, panel.title, _TEXT, scheme.ink, bold=True)
        draw_text(draw, left + _SIDE, 6, panel.note, _TEXT - 2, scheme.quiet, "ra")
        _draw_axes(draw, left, panel.window, scheme)
        bar = Image.fromarray(colour_maps.ramp(panel.ramp)[None]).resize((_SIDE // 2, 14))
        image.paste(bar, (left + _SIDE // 4, _TOP + _SIDE + 38))
        draw_text(draw, left + _SIDE // 4 - 8, _TOP + _SIDE + 36, panel.ends[0], _TEXT - 1, scheme.quiet, "ra")
        draw_text(draw, left + 3 * _SIDE // 4 + 8, _TOP + _SIDE + 36, panel.ends[1], _TEXT - 1, scheme.quiet)
    _draw_scale_bar(draw, across_m)
    with io.BytesIO() as held:
        image.save(held, "PNG", compress_level=1)
        return held.getvalue()


def _box(window: Window) -> tuple[float, float, float]:
    """Return offset right and down of a window inside its square panel, and the size of a pixel of the lidar."""
    step = _SIDE / max(window.width, window.height)
    return 0.5 * (_SIDE - step * window.width), 0.5 * (_SIDE - step * window.height), step


def find_pixel(window: Window, x: float, y: float) -> tuple[int, int] | None:
    """Find the pixel (row, col) of the lidar at a point of an image; None beside the panels.

    Parameters
    ----------
    x, y : point [pixels of the image], right and down
    """
    return next((pixel for number in (0, 1) if (pixel := find_pixel_of_panel(window, x, y, number))), None)


def find_pixel_of_panel(window: Window, x: float, y: float, number: int) -> tuple[int, int] | None:
    """Find the pixel (row, col) at a point of one of the two panels of an image; None beside it.

    Parameters
    ----------
    window : that the panel shows
    x, y : point [pixels of the image], right and down
    number : 0 for the panel at the left, 1 for that at the right
    """
    right, down, step = _box(window)
    left = _LEFT + number * (_SIDE + _GAP)
    col, row = math.floor((x - left - right) / step), math.floor((y - _TOP - down) / step)
    if 0 <= col < window.width and 0 <= row < window.height:
        return window.top + row, window.left + col
    return None


def mark_pixel(window: Window, row: int, col: int) -> list[tuple[float, float, float]]:
    """Return left, top and side [pixels of the image] of a pixel in each panel; nothing if the window lacks it."""
    if not (window.top <= row < window.bottom and window.left <= col < window.right):
        return []
    right, down, step = _box(window)
    x, y = right + step * (col - window.left), _TOP + down + step * (row - window.top)
    return [(left + x, y, step) for left in (_LEFT, _LEFT + _SIDE + _GAP)]


def outline_pixel(window: Window, row: int, col: int) -> str:
    """Return the outline of a pixel in each panel, as SVG over the image."""
    return "".join(
        f'<rect x="{x}" y="{y}" width="{side}" height="{side}" fill="none" stroke="{palette.IMAGE_MARK}" stroke-width="3"/>'
        for x, y, side in mark_pixel(window, row, col)
    )


def _draw_axes(draw: ImageDraw, left: int, window: Window, scheme: Scheme) -> None:
    """Draw the numbers of the first, middle and last rows and columns of a panel.

    Parameters
    ----------
    left, window, scheme : left edge of the panel [pixels], what it shows, and the colours
    """
    right, down, step = _box(window)
    for k in sorted({0, window.width // 2, window.width - 1}):
        x = left + right + (k + 0.5) * step
        draw.line((x, _TOP + _SIDE, x, _TOP + _SIDE + 4), fill=scheme.rule)
        draw_text(draw, x, _TOP + _SIDE + 6, str(window.left + k), _TEXT - 2, scheme.quiet, "ma")
    for k in sorted({0, window.height // 2, window.height - 1}):
        y = _TOP + down + (k + 0.5) * step
        draw.line((left - 4, y, left, y), fill=scheme.rule)
        draw_text(draw, left - 6, y, str(window.top + k), _TEXT - 2, scheme.quiet, "rm")
    draw_text(draw, left + _SIDE // 4, _TOP + _SIDE + 6, "col", _TEXT - 2, scheme.quiet, "ma")
    draw_text(draw, left - 6, _TOP + _SIDE // 4, "row", _TEXT - 2, scheme.quiet, "rm")


def _draw_scale_bar(draw: ImageDraw, across_m: float) -> None:
    """Draw a bar of a round length in the panel of intensity, which is `across_m` wide at the target."""
    if not (math.isfinite(across_m) and across_m > 0.0):
        return
    length_m = figures.round_down(0.3 * across_m)
    x, y, long = _LEFT + _SIDE + _GAP + 12, _TOP + _SIDE - 12, _SIDE * length_m / across_m
    draw.rectangle((x - 3, y - 25, x + max(long, 10 * len(f"{length_m:g} m")) + 3, y + 5), fill=palette.IMAGE_BLACK)
    draw.rectangle((x, y - 1, x + long, y + 2), fill=palette.IMAGE_WHITE)
    draw_text(draw, x, y - 3, f"{length_m:g} m", _TEXT, palette.IMAGE_WHITE, anchor="ld")
