"""Colours of all pictures, stated once: two schemes, the colours of lines and parts, and marks on images.

Everything is drawn in the colours of the light scheme; `rso_lidar.picture.style.recolour` exchanges them for the dark ones.
Images keep their colours in both schemes.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

Rgb = tuple[int, int, int]


@dataclass(frozen=True)
class Scheme:
    """Colours of a figure that depend on its background.

    Parameters
    ----------
    paper : background
    ink : titles, and lines that are neither measured nor simulated
    quiet : labels, numbers and notes; at least 4.5 : 1 against the background (WCAG 2.2, 1.4.3)
    rule : axes, and lines that mark a level; at least 3 : 1 (WCAG 2.2, 1.4.11)
    grid : lines of the grid, fainter on purpose
    shade, alarm_shade : a span of time behind curves, such as a shadow, and one that is out of bounds
    mark : what the reader is to look at, such as the present instant
    lines : blue, orange, green, pink, sky blue and red of curves and categories; at least 3 : 1
    """

    paper: str
    ink: str
    quiet: str
    rule: str
    grid: str
    shade: str
    alarm_shade: str
    mark: str
    lines: tuple[str, str, str, str, str, str]

    @property
    def all(self) -> tuple[str, ...]:
        """All colours in order, those of lines last."""
        roles = (self.paper, self.ink, self.quiet, self.rule, self.grid, self.shade, self.alarm_shade, self.mark)
        return (*roles, *self.lines)


# Hues of Okabe and Ito (2008), "Color Universal Design", which people with colour blindness tell apart. On a dark page
# the colours are theirs. On white, orange and sky blue would have less than 3 : 1, so all but pink are darkened.
OKABE_ITO = ("#0072b2", "#e69f00", "#009e73", "#cc79a7", "#56b4e9", "#d55e00")
LIGHT = Scheme(
    paper="#ffffff", ink="#1c1e22", quiet="#5f636b", rule="#868a92", grid="#dcdee2", shade="#ececee",
    alarm_shade="#f7dbd6", mark="#d95300", lines=("#004f86", "#b88000", "#00815e", "#c66fa0", "#3d99d2", "#a83200"),
)  # fmt: skip
DARK = Scheme(
    paper="#14181e", ink="#e6e8ec", quiet="#aeb3bc", rule="#7a808a", grid="#343a43", shade="#272d36",
    alarm_shade="#4a2724", mark="#ff7a18", lines=OKABE_ITO,
)  # fmt: skip

PAPER, INK, QUIET, RULE, GRID, SHADE, ALARM_SHADE, MARK = LIGHT.all[:8]
BLUE, ORANGE, GREEN, PINK, SKY, RED = LINES = LIGHT.lines

# On images, which look the same in both schemes.
IMAGE_BLACK = "#010101"  # off matplotlib's black, which a scheme exchanges
IMAGE_WHITE = "#fefefe"
IMAGE_MARK = "#ff7a18"  # the part of the field that a panel shows
IMAGE_GREY = "#5b5e66"  # grid of a dark panel
IMAGE_EDGE = "#5f86b3"  # edges of a true mesh, in no colour map
NO_RETURN = "#2e3036"  # NaN: dark grey, off the maps of range and of amounts
NO_LIGHT = "#000000"  # no intensity; the map of intensity begins above it
FALSE = "#ec28c8"  # a return from nothing
MISSED = "#687a7a"  # a target that sent no return
NIGHT, DAY = "#687690", "#b0d0ec"  # the two sides of the Earth
# Parts and classes as areas of an image: Okabe and Ito's, their yellow, and three lighter ones of the same hues.
PARTS = (*OKABE_ITO, "#f0e442", "#8fc3e8", "#f6cf7a", "#7fd6bc")
OTHER_PART = "#b9bcc2"


def split_rgb(colour: str) -> Rgb:
    """Return red, green and blue of a colour as bytes.

    Parameters
    ----------
    colour : such as ``"#ff7a18"``

    Examples
    --------
    >>> split_rgb("#ff7a18")
    (255, 122, 24)
    """
    return int(colour[1:3], 16), int(colour[3:5], 16), int(colour[5:7], 16)


def dim(rgb: np.ndarray, towards: str) -> np.ndarray:
    """Mix colours with that of their background, so that what they show stands back.

    Parameters
    ----------
    rgb : (…, rgb) u1
    towards : colour of the background, such as ``"#2e3036"``

    Returns
    -------
    ndarray
        (…, rgb) u1, of which a third is the colour.
    """
    mixed: np.ndarray = ((np.asarray(rgb, float) + 2.0 * np.array(split_rgb(towards))) / 3.0).round().astype(np.uint8)
    return mixed


def choose_ink(area: str | tuple[float, ...]) -> str:
    """Return black or white, whichever can be read better on an area of a colour.

    Parameters
    ----------
    area : colour, as text or as shares of red, green and blue
    """
    red, green, blue = (value / 255 for value in split_rgb(area)) if isinstance(area, str) else area[:3]
    light = 0.2126 * red**2.2 + 0.7152 * green**2.2 + 0.0722 * blue**2.2  # relative luminance, about (WCAG 2.2)
    return IMAGE_BLACK if light > 0.18 else IMAGE_WHITE
