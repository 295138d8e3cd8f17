"""Pictures of fitted maps: measured beside fitted ones with a histogram of residuals, and the constants of the pixels."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from rso_lidar.detector import FittedMap, MapFit, MapGroup
from rso_lidar.picture import colour_maps, figures, palette

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_TABLES = {
    "counts_mean": ("Mean intensity [counts]", 1.0),
    "range_mean": ("Mean error of range [cm]", 100.0),
    "detection_rate": ("Detection rate", 1.0),
    "dark_counts": ("Triggers in the dark", 1.0),
}  # heading, and factor from SI
_MAPS = {
    "gain_factor": "Gain factor",
    "offset_counts": "Offset [counts]",
    "t0_ns": "Time origin [ns]",
    "threshold_factor": "Threshold factor",
    "dark_current_na": "Dark current [nA]",
}
_COLUMNS = 3
_BINS = np.linspace(-5.0, 5.0, 41)
_EXTREMES = (0.5, 99.5)  # percentiles that end a scale of colours, so that a hot pixel does not hide the others


def draw_map_fit(fit: MapFit, name: str) -> Figure:
    """Draw each measured map beside that of the fitted pixels, and a histogram of the residuals.

    Parameters
    ----------
    name : of the camera
    """
    n = len(fit.tables)
    note = f"{fit.dead.size:,} pixels, {int(fit.dead.sum()):,} dead and {int(fit.hot.sum()):,} hot"
    small = (
        "Dark grey: dead, or unknown. Residuals: measured less fitted over the standard error.",
        "Line: normal law of the degrees of freedom that are left, on average over maps that tell the same constants.",
    )
    figure = figures.new_figure(figures.PAGE_IN, 1.1 + 2.9 * n, f"Maps of {name}", note, small)
    grid = iter(figure.subplots(n, _COLUMNS, squeeze=False))
    for group in fit.groups:
        for table in group.tables:
            _draw_table(figure, next(grid), table, group)
    return figure


def draw_pixel_maps(fit: MapFit, name: str) -> Figure:
    """Draw the fitted constants of the pixels.

    Parameters
    ----------
    name : of the camera
    """
    rows = math.ceil(len(fit.maps) / _COLUMNS)
    figure = figures.new_figure(figures.PAGE_IN, 0.8 + 3.2 * rows, f"Pixels of {name}")
    grid = figure.subplots(rows, _COLUMNS, squeeze=False).ravel()
    for axes, (key, values) in zip(grid, fit.maps.items(), strict=False):
        known = np.where(fit.dead, np.nan, values)
        error = float(np.nanmedian(fit.errors[key]))
        _draw_image(figure, [axes], [known], _MAPS[key], [f"error of a pixel {error:.2g}"])
    for axes in grid[len(fit.maps) :]:
        axes.set_axis_off()
    return figure


def _draw_table(figure: Figure, row: np.ndarray, table: FittedMap, group: MapGroup) -> None:
    """Draw a measured map, the fitted one, and the histogram of the residuals."""
    label, factor = _TABLES[table.map.quantity]
    measured = table.map.value
    if table.map.quantity == "detection_rate":
        measured = measured / table.map.trials
    planes = [factor * np.where(np.isfinite(table.expected), plane, np.nan) for plane in (measured, table.expected)]
    light = f"{table.map.photons:.4g} photons" if table.map.photons else "in the dark"
    _draw_image(figure, list(row[:2]), planes, label, ["measured", "fitted"])
    axes = row[2]
    figures.style_axes(axes, light, "Residual [sigma]", "Pixels")
    if group.freedom == 0.0:
        axes.text(0.5, 0.5, "nothing is left\nto judge by", ha="center", va="center", color=palette.QUIET,
                  fontsize=figures.TEXT_PT, transform=axes.transAxes)  # fmt: skip
        axes.set(xticks=[], yticks=[])
        return
    residuals = table.residuals[np.isfinite(table.residuals)]
    axes.hist(np.clip(residuals, _BINS[0], _BINS[-1]), _BINS, color=palette.ORANGE)
    points = sum(int(np.isfinite(other.residuals).sum()) for other in group.tables)
    sigma = math.sqrt(group.freedom / points)
    law = np.exp(-0.5 * (_BINS / sigma) ** 2) / (math.sqrt(2.0 * math.pi) * sigma)
    axes.plot(_BINS, law * len(residuals) * (_BINS[1] - _BINS[0]), color=palette.BLUE, lw=figures.LINE_PT)


def _draw_image(figure: Figure, row: list[Axes], planes: list[np.ndarray], label: str, notes: list[str]) -> None:
    """Draw planes (row, col) on one scale of colours, with a bar beside the last."""
    import matplotlib

    low, high = np.nanpercentile(np.stack(planes), _EXTREMES)
    if high - low < 1e-6 * abs(high):  # all but a few pixels are equal
        low, high = np.nanmin(planes), np.nanmax(planes)
    colours = matplotlib.colormaps[colour_maps.AMOUNT_RAMP].with_extremes(bad=palette.NO_RETURN)
    for axes, plane, note in zip(row, planes, notes, strict=True):
        drawn = axes.imshow(
            np.ma.masked_invalid(plane), vmin=low, vmax=max(high, low + 1e-9), cmap=colours, interpolation="nearest"
        )
        figures.style_axes(axes, label if axes is row[0] else "", note)
        axes.grid(False)
        axes.set(xticks=[], yticks=[])
    figures.style_bar(figure.colorbar(drawn, ax=row, shrink=0.8, aspect=25, pad=0.02))
