"""Colours, stated once: the ramps of range and intensity, what no return looks like, and the colours of parts."""

from __future__ import annotations

from functools import cache

import numpy as np

Rgb = tuple[int, int, int]

PAPER: Rgb = (255, 255, 255)
INK: Rgb = (28, 30, 34)
QUIET: Rgb = (112, 116, 124)
LINE: Rgb = (206, 209, 214)
NO_RETURN: Rgb = (46, 48, 54)  # dark grey, off the viridis ramp
BLACK: Rgb = (0, 0, 0)
MARK: Rgb = (255, 122, 24)  # crop in the locator, now in a time line
FALSE: Rgb = (236, 40, 200)  # a return from nothing
MISSED: Rgb = (104, 110, 122)  # a target that sent no return

RANGE_RAMP = "viridis"
INTENSITY_RAMP = "gray"
FAINTEST = 36  # grey level of the faintest return
ERROR_RAMP = "RdBu_r"

# Okabe and Ito (2008), colours that the colour-blind tell apart, and four lighter ones of the same hues.
PARTS = (
    "#0072B2",
    "#E69F00",
    "#009E73",
    "#CC79A7",
    "#56B4E9",
    "#D55E00",
    "#F0E442",
    "#8FC3E8",
    "#F6CF7A",
    "#7FD6BC",
)
OTHER_PART = "#B9BCC2"


def hex_colour(colour: Rgb) -> str:
    """Format a colour as matplotlib reads it.

    >>> hex_colour((255, 122, 24))
    '#ff7a18'
    """
    return "#{:02x}{:02x}{:02x}".format(*colour)


@cache
def ramp(name: str) -> np.ndarray:
    """Return a ramp of 256 colours (step, rgb), as bytes, from matplotlib's maps.

    The greys of intensity begin above black, so that the faintest return stands out from none.
    """
    import matplotlib

    start = FAINTEST if name == INTENSITY_RAMP else 0
    steps = np.linspace(start, 255, 256).round().astype(int)
    colours: np.ndarray = matplotlib.colormaps[name](steps, bytes=True)[:, :3].copy()
    colours.flags.writeable = False
    return colours


def apply_ramp(fraction: np.ndarray, name: str, empty: Rgb) -> np.ndarray:
    """Return the colours (…, rgb), as bytes, of fractions along a ramp.

    Parameters
    ----------
    fraction : (…) values, clipped to 0 to 1.
    name : of the ramp.
    empty : colour of NaN.
    """
    known = np.isfinite(fraction)
    step = np.clip(np.where(known, fraction, 0.0) * 255 + 0.5, 0, 255).astype(np.uint8)
    colours = ramp(name)[step]
    colours[~known] = empty
    return colours


@cache
def fixed_palette() -> tuple[int, ...]:
    """Return 256 colours, flat, for animations: 128 of the range ramp, 110 greys, and the marks.

    One palette for all pictures of an animation: nothing flickers, and a file holds it once.
    """
    colours = [tuple(int(v) for v in ramp(RANGE_RAMP)[k]) for k in np.linspace(0, 255, 128).round().astype(int)]
    colours += [(int(v), int(v), int(v)) for v in np.linspace(0, 246, 110).round()]
    colours += [PAPER, INK, QUIET, LINE, NO_RETURN, MARK]
    faint = [tuple(round(m + (255 - m) * share) for m in MARK) for share in (0.25, 0.5, 0.75)]
    colours += faint  # edges of the mark on white paper
    colours += [BLACK] * (256 - len(colours))
    return tuple(value for colour in colours for value in colour)
