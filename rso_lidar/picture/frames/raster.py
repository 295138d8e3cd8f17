"""Quick drawing on a canvas of pixels with Pillow: panels, locators, colour bars and text."""

from __future__ import annotations

import math
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from rso_lidar.picture.selection.scale import Scale
from rso_lidar.picture.selection.sequence import Thumbnail
from rso_lidar.picture.selection.window import Window
from rso_lidar.picture.style.colour_maps import INTENSITY_RAMP, RANGE_RAMP, ramp
from rso_lidar.picture.style.figures import round_down
from rso_lidar.picture.style.palette import (
    IMAGE_MARK,
    IMAGE_WHITE,
    INK,
    LIGHT,
    NO_LIGHT,
    NO_RETURN,
    Scheme,
)

if TYPE_CHECKING:
    from PIL.Image import Image
    from PIL.ImageDraw import ImageDraw
    from PIL.ImageFont import FreeTypeFont

GAP = 4  # pixels between the two panels of a pair
_SHORTEST_BAR, _SMALLEST_LETTERS = 40, 9  # of a legend [pixels]


@cache
def load_font(size: int, bold: bool = False) -> FreeTypeFont:
    """Load DejaVu Sans, which matplotlib ships, at `size` [pixels]."""
    import matplotlib
    from PIL import ImageFont

    name = "DejaVuSans-Bold.ttf" if bold else "DejaVuSans.ttf"
    return ImageFont.truetype(Path(matplotlib.get_data_path()) / "fonts" / "ttf" / name, size)


def draw_text(
    draw: ImageDraw,
    x: float,
    y: float,
    text: str,
    size: int = 12,
    colour: str = INK,
    anchor: str = "la",
    bold: bool = False,
) -> float:
    """Draw a line of text on a canvas of pixels.

    Parameters
    ----------
    draw : the canvas, Pillow's drawing of an image
    x, y : position [pixels], right and down
    text : the line
    size : height of the font [pixels]
    colour : such as ``"#1c1e22"``
    anchor : Pillow's anchor of the position; ``"la"`` is the upper left corner
    bold : whether the letters are bold

    Returns
    -------
    float
        Where the line ends, if it is anchored at the left [pixels from the left].
    """
    draw.text((x, y), text, fill=colour, font=load_font(size, bold), anchor=anchor)
    return x + float(draw.textlength(text, font=load_font(size, bold)))


def shorten(draw: ImageDraw, text: str, size: int, width: float, bold: bool = False) -> str:
    """Shorten a line of text at its end to fit `width` [pixels]."""
    if draw.textlength(text, font=load_font(size, bold)) <= width:
        return text
    while text and draw.textlength(text + "…", font=load_font(size, bold)) > width:
        text = text[:-1]
    return text.rstrip() + "…"


def draw_panel(rgb: np.ndarray, side: int, background: str) -> Image:
    """Draw colours (row, col, rgb) enlarged to a square of `side` pixels, with sharp edges.

    Parameters
    ----------
    rgb : (row, col, rgb) bytes
    side : of the square [pixels]
    background : colour where the array is not square

    Returns
    -------
    PIL.Image.Image
    """
    from PIL import Image

    n_rows, n_cols = rgb.shape[:2]
    longest = max(n_rows, n_cols)
    times = -(-side // longest)
    big = Image.fromarray(np.repeat(np.repeat(rgb, times, axis=0), times, axis=1))
    width, height = max(1, round(side * n_cols / longest)), max(1, round(side * n_rows / longest))
    if big.size != (width, height):
        big = big.resize((width, height), Image.Resampling.BOX)
    if (width, height) == (side, side):
        return big
    square = Image.new("RGB", (side, side), background)
    square.paste(big, ((side - width) // 2, (side - height) // 2))
    return square


def draw_pair(thumbnail: Thumbnail, scale: Scale, window: Window, side: int, scheme: Scheme = LIGHT) -> Image:
    """Draw range and intensity of one frame side by side, with the locator of the crop.

    Parameters
    ----------
    side : of each panel [pixels]
    """
    from PIL import Image, ImageDraw

    both = Image.new("RGB", (2 * side + GAP, side), scheme.paper)
    both.paste(draw_panel(scale.range_rgb(window.cut(thumbnail.range_m), thumbnail.median_m), side, NO_RETURN), (0, 0))
    both.paste(draw_panel(scale.intensity_rgb(window.cut(thumbnail.intensity_counts)), side, NO_LIGHT), (side + GAP, 0))
    draw = ImageDraw.Draw(both)
    if not window.whole:
        small = max(26, side // 7)
        right, top = _free_corner(np.isfinite(window.cut(thumbnail.range_m)), small / side)
        _draw_locator(draw, side - 4 if right else small + 3, 3 if top else side - small - 4, small, window)
    _draw_scale_bar(draw, side + GAP + 8, side - 9, side, thumbnail.pixel_m * max(window.width, window.height))
    return both


def _free_corner(returns: np.ndarray, share: float) -> tuple[bool, bool]:
    """Return whether the corner with fewest returns is right and whether it is at the top; in a tie, the top right."""
    rows, cols = (int(np.ceil(size * share)) + 1 for size in returns.shape)
    corners = {
        (True, True): returns[:rows, -cols:],
        (False, True): returns[:rows, :cols],
        (True, False): returns[-rows:, -cols:],
        (False, False): returns[-rows:, :cols],
    }
    return min(corners, key=lambda corner: int(corners[corner].sum()))


def _draw_scale_bar(draw: ImageDraw, x: float, y: float, side: int, across_m: float) -> None:
    """Draw a bar of a round length, on black.

    Parameters
    ----------
    x, y : lower left corner of the bar [pixels]
    side : of the panel [pixels]
    """
    if not (math.isfinite(across_m) and across_m > 0):
        return
    length_m = round_down(0.34 * across_m)
    long = side * length_m / across_m
    text, size = f"{length_m:g} m", max(10, side // 28)
    left, top, right, _ = draw.textbbox((x, y - 3), text, font=load_font(size), anchor="ld")
    draw.rectangle((left - 2, top - 1, right + 2, y), fill=NO_LIGHT)  # saturated pixels are as white as the text
    draw.rectangle((x - 2, y - 2, x + long + 2, y + 4), fill=NO_LIGHT)
    draw.rectangle((x, y, x + long, y + 2), fill=IMAGE_WHITE)
    draw_text(draw, x, y - 3, text, size, IMAGE_WHITE, anchor="ld")


def _draw_locator(draw: ImageDraw, right: int, top: int, side: int, window: Window) -> None:
    """Draw the whole field small, with the crop marked in it.

    Parameters
    ----------
    right, top : its upper right corner [pixels]
    side : its longer side [pixels]
    """
    longest = max(window.n_rows, window.n_cols)
    wide, high = side * window.n_cols / longest, side * window.n_rows / longest
    left = right - wide
    draw.rectangle((left, top, right, top + high), fill=NO_LIGHT, outline=IMAGE_WHITE)
    scale = side / longest
    x, y = left + window.left * scale, top + window.top * scale
    draw.rectangle(
        (x, y, max(left + window.right * scale, x + 2), max(top + window.bottom * scale, y + 2)), fill=IMAGE_MARK
    )


def _draw_bar(draw: ImageDraw, x: float, y: float, width: int, height: int, name: str, outline: str) -> None:
    """Draw a colour bar.

    Parameters
    ----------
    x, y : left upper corner [pixels]
    width, height : of the bar [pixels]
    """
    colours = ramp(name)
    for k in range(width):
        colour = tuple(int(v) for v in colours[k * 255 // (width - 1)])
        draw.line((x + k, y, x + k, y + height - 1), fill=colour)
    draw.rectangle((x - 1, y - 1, x + width, y + height), outline=outline)


def draw_legend(
    draw: ImageDraw, x: float, y: float, scale: Scale, width: int, size: int = 12, scheme: Scheme = LIGHT
) -> None:
    """Draw the meaning of the colours in one row.

    Parameters
    ----------
    x, y : upper left corner [pixels]
    width : most pixels that the row may take
    size : of the letters [pixels], smaller where the row is short
    """
    rows = ((scale.range_words, RANGE_RAMP), (scale.intensity_words, INTENSITY_RAMP))
    texts = [draw.textlength("".join(words), font=load_font(size)) for words, _ in rows]
    swatch = draw.textlength("no return", font=load_font(size)) + size + 8
    room = width - sum(texts) - swatch - 2 * 26 - 2 * 24
    if room < 2 * _SHORTEST_BAR and size > _SMALLEST_LETTERS:
        draw_legend(draw, x, y, scale, width, size - 1, scheme)
        return
    long = int(min(max(room // 2, _SHORTEST_BAR), 200))
    here = x
    for (title, low, high), name in rows:
        here = draw_text(draw, here, y, title, size, scheme.ink) + 10
        here = draw_text(draw, here, y, low, size, scheme.quiet) + 6
        _draw_bar(draw, here, y + 2, long, size - 1, name, scheme.rule)
        here = draw_text(draw, here + long + 6, y, high, size, scheme.quiet) + 24
    draw.rectangle((here, y + 1, here + size, y + 1 + size), fill=NO_RETURN)
    draw_text(draw, here + size + 6, y, "no return", size, scheme.ink)
