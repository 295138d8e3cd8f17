"""The style as defaults of matplotlib, for plots that are not drawn by this package."""

from __future__ import annotations

from typing import Any

from rso_lidar.picture.style.colour_maps import RANGE_RAMP
from rso_lidar.picture.style.figures import HAIR_PT, HEADING_PT, LINE_PT, SMALL_PT, TEXT_PT, THIN_PT, TITLE_PT
from rso_lidar.picture.style.palette import LIGHT, Scheme

MARKER_PT = 4.0  # size of a marker on a curve [points]


def make_rc_params(scheme: Scheme = LIGHT) -> dict[str, Any]:
    """Make the settings of matplotlib (`matplotlib.rcParams`) that draw a plain plot in the style.

    Figures of `rso_lidar.picture` state their own sizes and colours, and look the same with these settings. A grid stays
    off, because matplotlib draws it over images; ``axes.grid()`` draws one in the style. Lines that matplotlib does not
    count among the curves, such as those of ``axes.axhline``, have the colour of axes.

    Parameters
    ----------
    scheme : colours, light or dark

    Returns
    -------
    dict
        Values by the names of matplotlib's settings.

    >>> make_rc_params()["image.cmap"]
    'viridis'
    """
    from matplotlib.rcsetup import cycler

    ticks = {
        f"{axis}tick.{name}": value
        for axis in "xy"
        for name, value in (("color", scheme.rule), ("labelcolor", scheme.quiet), ("labelsize", SMALL_PT))
    }
    return {
        **ticks,
        "axes.edgecolor": scheme.rule,
        "axes.facecolor": scheme.paper,
        "axes.labelcolor": scheme.quiet,
        "axes.labelsize": TEXT_PT,
        "axes.linewidth": THIN_PT,
        "axes.prop_cycle": cycler(color=scheme.lines),
        "axes.spines.right": False,
        "axes.spines.top": False,
        "axes.titlecolor": scheme.ink,
        "axes.titlelocation": "left",
        "axes.titlesize": HEADING_PT,
        "figure.facecolor": scheme.paper,
        "figure.titlesize": TITLE_PT,
        "font.family": ["sans-serif"],
        "font.size": TEXT_PT,
        "grid.color": scheme.grid,
        "grid.linewidth": HAIR_PT,
        "image.cmap": RANGE_RAMP,
        "image.interpolation": "nearest",
        "legend.fontsize": SMALL_PT,
        "legend.frameon": False,
        "legend.labelcolor": scheme.quiet,
        "lines.color": scheme.rule,
        "lines.linewidth": LINE_PT,
        "lines.markersize": MARKER_PT,
        "savefig.facecolor": "auto",
        "text.color": scheme.ink,
    }
