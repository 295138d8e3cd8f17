"""Colour maps, stated once, as names of matplotlib and as tables of bytes."""

from __future__ import annotations

from functools import cache

import numpy as np

from rso_lidar.picture.style.palette import IMAGE_MARK, LIGHT, NO_LIGHT, NO_RETURN, Scheme, split_rgb

RANGE_RAMP = "viridis"  # range, and time along a path
INTENSITY_RAMP = "gray"
AMOUNT_RAMP = "cividis"  # photons, shares, heights and figures of merit (Nuñez et al. 2018)
ERROR_RAMP = "RdBu_r"  # signed, zero in the middle (ColorBrewer, safe for the colour-blind)
IMAGE_RAMP = "binary_r"  # images of cameras: black to white
RAMP_COLOURS = 238  # of range and of greys, at the beginning of the palette of animations
FAINTEST = 36  # grey level of the faintest return


@cache
def ramp(name: str) -> np.ndarray:
    """Return a ramp of 256 colours (step, rgb), as bytes, from matplotlib's maps.

    The greys of intensity begin above black, so that the faintest return stands out from none.

    Parameters
    ----------
    name : of the ramp, such as `RANGE_RAMP`
    """
    import matplotlib

    start = FAINTEST if name == INTENSITY_RAMP else 0
    steps = np.linspace(start, 255, 256).round().astype(int)
    colours: np.ndarray = matplotlib.colormaps[name](steps, bytes=True)[:, :3].copy()
    colours.flags.writeable = False
    return colours


def apply_ramp(fraction: np.ndarray, name: str, empty: str) -> np.ndarray:
    """Return the colours (…, rgb), as bytes, of fractions along a ramp.

    Parameters
    ----------
    fraction : (…) values, clipped to 0 to 1
    name : of the ramp
    empty : colour of NaN
    """
    known = np.isfinite(fraction)
    step = np.clip(np.where(known, fraction, 0.0) * 255 + 0.5, 0, 255).astype(np.uint8)
    colours = ramp(name)[step]
    colours[~known] = split_rgb(empty)
    return colours


@cache
def fixed_palette(scheme: Scheme = LIGHT) -> tuple[int, ...]:
    """Return 256 colours, flat, for animations: 128 of the range ramp, 110 greys, and those of a scheme.

    One palette for all pictures of an animation: nothing flickers, and a file holds it once.

    Parameters
    ----------
    scheme : `LIGHT` or `DARK`
    """
    colours = [tuple(int(v) for v in ramp(RANGE_RAMP)[k]) for k in np.linspace(0, 255, 128).round().astype(int)]
    colours += [(int(v), int(v), int(v)) for v in np.linspace(0, 246, RAMP_COLOURS - 128).round()]
    roles = (scheme.paper, scheme.ink, scheme.quiet, scheme.rule, scheme.grid, scheme.mark, NO_RETURN, IMAGE_MARK)
    colours += [split_rgb(colour) for colour in roles]
    paper, mark = split_rgb(scheme.paper), split_rgb(scheme.mark)
    for share in (0.25, 0.5, 0.75):  # edges of the mark on the page
        colours.append(tuple(round(m + (p - m) * share) for m, p in zip(mark, paper, strict=True)))
    colours += [split_rgb(NO_LIGHT)] * (256 - len(colours))
    return tuple(value for colour in colours for value in colour)
