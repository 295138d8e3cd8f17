"""Images of one frame of a dataset as a figure: the reading, and the labels."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from rso_lidar.picture import Stretch, Window, colour_maps, figures, palette

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_TITLES = {
    "range_m": "measured range [m]",
    "intensity_counts": "measured intensity [counts]",
    "part_class_id": "part class (label)",
    "detection_probability": "detection probability (label)",
    "photons": "expected photons (label)",
    "image": "measured image",
    "true_range_m": "true range [m] (label)",
    "filled_fraction": "filled share (label)",
}
_RANGES = ("range_m", "true_range_m")  # NaN where there is none
_SHARES = ("detection_probability", "filled_fraction")  # from 0 to 1
_RAMPS = {"range_m": colour_maps.RANGE_RAMP, "intensity_counts": colour_maps.INTENSITY_RAMP}
_PANELS = 4


def label_figure(images: Mapping[str, np.ndarray], part_classes: Sequence[str], title: str, note: str) -> Figure:
    """Draw up to four images of one frame, in the square around the target.

    Parameters
    ----------
    images : arrays (row, col) of the reading and labels by name, with ``part_class_id``, -1 for sky. ``image`` is that of a
        camera (row, col, band)
    """
    on_target = images["part_class_id"] >= 0
    window = Window.about(on_target)
    figure = figures.new_figure(10.6, 3.4, title, note)
    for axes, name in zip(figure.subplots(1, _PANELS).flat, images, strict=False):
        if name == "part_class_id":
            _draw_classes(axes, images[name], part_classes, window)
        elif name == "image":
            _draw_image(axes, images[name].astype(float), window)
        else:
            _draw_values(axes, name, images[name].astype(float), on_target, window)
        axes.set_title(_TITLES[name], loc="left", fontsize=figures.TEXT_PT, color=palette.INK)
        axes.tick_params(labelsize=figures.SMALL_PT, colors=palette.QUIET)
    return figure


def _extent(window: Window) -> tuple[float, float, float, float]:
    """Return the edges of a window in columns and rows, for matplotlib."""
    return window.left - 0.5, window.right - 0.5, window.bottom - 0.5, window.top - 0.5


def _draw_values(axes: Axes, name: str, values: np.ndarray, on_target: np.ndarray, window: Window) -> None:
    """Draw an image of numbers with its colour bar; zero and absent values are dark.

    Colours span the 2nd to the 98th percentile of the pixels on targets, so that a false alarm far behind them does not
    stretch the scale. Those of a probability span 0 to 1.

    Parameters
    ----------
    values : (row, col)
    on_target : (row, col) bool, pixels of targets
    """
    from matplotlib import colormaps
    from matplotlib.colors import LogNorm, Normalize
    from matplotlib.ticker import LogLocator, StrMethodFormatter

    shown = window.cut(values)
    absent = ~np.isfinite(shown) if name in _RANGES else shown <= 0.0
    seen = shown[~absent & window.cut(on_target)]
    low, high = np.percentile(seen, [2, 98]) if seen.size and name not in _SHARES else (0.0, 1.0)
    colours = colormaps[_RAMPS.get(name, colour_maps.RANGE_RAMP)].with_extremes(bad=palette.NO_RETURN)
    pad = 0.05 if high - low < 0.1 else 0.0  # a flat target: its noise does not fill the ramp
    is_light = name in ("intensity_counts", "photons")  # a few glints outshine the rest
    norm = LogNorm(low, high) if is_light and 0.0 < low < high else Normalize(low - pad, high + pad)
    masked = np.ma.masked_array(shown, absent)
    drawn = axes.imshow(masked, cmap=colours, norm=norm, extent=_extent(window), interpolation="nearest")
    bar = axes.figure.colorbar(drawn, ax=axes, shrink=0.8)
    bar.ax.tick_params(which="both", labelsize=figures.SMALL_PT, colors=palette.QUIET)
    if isinstance(norm, LogNorm):
        bar.locator, bar.formatter = LogLocator(subs=(1.0, 2.0, 5.0)), StrMethodFormatter("{x:,.0f}")
        bar.minorticks_off()
    else:
        bar.ax.ticklabel_format(useOffset=False, style="plain")


def _draw_image(axes: Axes, counts: np.ndarray, window: Window) -> None:
    """Draw the image of a camera: three bands as colours, of other numbers the first as grey.

    Parameters
    ----------
    counts : (row, col, band)
    """
    shown = window.cut(counts)
    low, high = float(np.percentile(counts, 2)), float(np.percentile(shown, 99.5))  # dark sky; all but a few glints
    colours = Stretch(low, max(high, low + 1.0)).paint(shown)
    axes.imshow(colours, extent=_extent(window), interpolation="nearest")


def _draw_classes(axes: Axes, classes: np.ndarray, names: Sequence[str], window: Window) -> None:
    """Draw the part classes (row, col) of pixels, -1 for sky, with a legend of those that are there."""
    from matplotlib.colors import ListedColormap
    from matplotlib.patches import Patch

    shown = window.cut(classes)
    colours = [palette.PARTS[k % len(palette.PARTS)] for k in range(len(names))]
    ramp = ListedColormap([palette.NO_RETURN, *colours])
    limits: dict[str, Any] = {"vmin": -1.5, "vmax": len(names) - 0.5}
    axes.imshow(shown, cmap=ramp, extent=_extent(window), interpolation="nearest", **limits)
    there = [k for k in range(len(names)) if (shown == k).any()]
    if there:
        keys = [Patch(color=colours[k], label=names[k]) for k in there]
        axes.legend(
            handles=keys,
            fontsize=figures.SMALL_PT,
            loc="upper center",
            bbox_to_anchor=(0.5, -0.12),
            ncols=2,
            frameon=False,
        )
