"""A model on one page: four sides coloured by part, by common part class and by material, with a bar of its size."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from rso_lidar.picture import figures, palette
from rso_lidar.records import OTHER

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_DARKEST = 0.35  # brightness of a facet seen edge-on
_MOST_NAMES = 14
_TABLE_FROM, _CELL = 0.40, 0.105  # where the table of light begins, and how wide a cell is, over the page's width


@dataclass(frozen=True, eq=False)
class CardView:
    """One side of a model: numbers of part, class and material (row, col), -1 for sky, and the cosine to the viewer.

    A cell is `cell_m` [m] wide; `material_rgb` are colours from 0 to 1. Classes are numbered by `class_names`.
    """

    side: str
    part: np.ndarray
    part_class: np.ndarray
    material: np.ndarray
    cosine: np.ndarray
    cell_m: float
    part_names: tuple[str, ...]
    class_names: tuple[str, ...]
    material_names: tuple[str, ...]
    material_rgb: tuple[tuple[float, float, float], ...]


def model_card_figure(
    title: str, views: Sequence[CardView], lines: Sequence[str], light: Sequence[Sequence[str]] = ()
) -> Figure:
    """Draw the page of a model: parts, part classes and materials, each with its names, and tables at the foot.

    Parameters
    ----------
    light : rows of cells of a table, its heads first
    """
    wrapped = [part for line in lines for part in textwrap.wrap(line, 80)]
    foot = max(len(wrapped), len(light))
    tall_m = _half_height_m(views)
    first_half_m = 0.5 * views[0].cell_m * views[0].part.shape[1]
    figure = figures.new_figure(
        14.0,
        1.1 + 3.0 * max(2.95 * tall_m / first_half_m, 2.1) + figures.LINE_IN * foot,
        title,
        "",
        (*wrapped, *[""] * (foot - len(wrapped))),
    )
    _light(figure, light, foot)
    grid: Any = figure.subplots(3, len(views) + 1, width_ratios=[*([1.0] * len(views)), 0.62])
    first = views[0]
    parts, part_rgb = _colour_by_area([view.part for view in views], first.part_names)
    classes, class_rgb = _colour_by_area([view.part_class for view in views], first.class_names)
    material_rgb = np.array(first.material_rgb)
    for column, view in enumerate(views):
        coloured = (view.part, part_rgb), (view.part_class, class_rgb), (view.material, material_rgb)
        for row, (index, rgb) in enumerate(coloured):
            axes = grid[row, column]
            half_m = 0.5 * view.cell_m * index.shape[1]
            axes.imshow(
                _shade(index, rgb, view.cosine), extent=(-half_m, half_m, -half_m, half_m), interpolation="antialiased"
            )
            axes.set_ylim(-tall_m, tall_m)
            axes.set_xticks([])
            axes.set_yticks([])
            for spine in axes.spines.values():
                spine.set_visible(False)
            if row == 0:
                axes.set_title(view.side, fontsize=figures.HEADING_PT, color=palette.INK)
    _draw_bar(grid[2, 0], first, tall_m)
    for row, (title, shown, names, rgb) in enumerate(
        (
            ("parts, by what is seen of them", parts, first.part_names, part_rgb),
            ("common part classes", classes, first.class_names, class_rgb),
        )
    ):
        named = shown[: len(palette.PARTS)]
        _names(grid[row, -1], title, [names[k] for k in named], rgb[named], len(shown) - len(named))
    of_material = dict(zip(first.material_names, first.material_rgb, strict=True))
    _names(grid[2, -1], "materials", list(of_material), np.array(list(of_material.values())), 0)
    return figure


def _light(figure: Figure, rows: Sequence[Sequence[str]], foot: int) -> None:
    """Write the table of light at the right of the words at the foot, `foot` lines high."""
    height_in = float(figure.get_figheight())
    for row, cells in enumerate(rows):
        y = (0.07 + figures.LINE_IN * (foot - 1 - row)) / height_in
        for column, cell in enumerate(cells):
            x = _TABLE_FROM if column == 0 else _TABLE_FROM + 0.10 + _CELL * column
            side: Any = "left" if column == 0 else "right"
            ink = palette.QUIET if row == 0 or column == 0 else palette.INK
            figure.text(x, y, cell, fontsize=figures.SMALL_PT, color=ink, ha=side, va="bottom", in_layout=False)


def _colour_by_area(images: Sequence[np.ndarray], names: Sequence[str]) -> tuple[list[int], np.ndarray]:
    """Return the numbers that are visible in images (row, col), largest area first, and the colour of each name (name, 3).

    The largest have colours of their own. The class `other` is grey.
    """
    seen = np.asarray(sum(np.bincount(image[image >= 0], minlength=len(names)) for image in images))
    shown = [int(number) for number in np.argsort(-seen, kind="stable") if seen[number] > 0]
    rgb = np.array([_rgb(palette.OTHER_PART)] * len(names))
    for number, colour in zip((k for k in shown if names[k] != OTHER), palette.PARTS, strict=False):
        rgb[number] = _rgb(colour)
    return shown, rgb


def _shade(index: np.ndarray, rgb: np.ndarray, cosine: np.ndarray) -> np.ndarray:
    """Shade the colours of parts by their incidence.

    Parameters
    ----------
    index : (row, col) of the part or material of each pixel, -1 for the background
    rgb : (index, 3) colours, 0 to 1
    cosine : (row, col) cosine of incidence

    Returns
    -------
    (row, col, 4) colours, 0 to 1; the background is transparent.
    """
    light = (_DARKEST + (1.0 - _DARKEST) * cosine)[..., None]
    there = (index >= 0)[..., None]
    return np.concatenate([rgb[np.maximum(index, 0)] * light, there.astype(float)], axis=-1)


def _rgb(colour: str) -> tuple[float, float, float]:
    from matplotlib.colors import to_rgb

    return to_rgb(colour)


def _half_height_m(views: Sequence[CardView]) -> float:
    """Return half the height [m] that fits every view, with room for the bar."""
    tallest = 0.0
    for view in views:
        rows = np.flatnonzero((view.part >= 0).any(axis=1))
        middle = 0.5 * (view.part.shape[0] - 1)
        tallest = max(tallest, float(np.abs(rows - middle).max(initial=0.0)) * view.cell_m)
    half_m = 0.5 * views[0].cell_m * views[0].part.shape[0]
    return float(min(1.06 * tallest + 0.14 * half_m, half_m))


def _draw_bar(axes: Any, view: CardView, tall_m: float) -> None:
    """Draw a bar of a round length at the foot of a view."""
    half_m = 0.5 * view.cell_m * view.part.shape[1]
    rounded = 10.0 ** np.floor(np.log10(half_m))
    length = float(next(step * rounded for step in (5.0, 2.0, 1.0) if step * rounded <= half_m))
    left, low = -0.97 * half_m, -tall_m + 0.03 * half_m
    axes.plot([left, left + length], [low, low], color=palette.INK, lw=figures.THICK_PT, solid_capstyle="butt")
    said = f"{length:g} m" if length >= 1.0 else f"{length * 100:g} cm"
    axes.text(left, low + 0.03 * half_m, said, fontsize=figures.TEXT_PT, color=palette.INK, va="bottom")


def _names(axes: Any, title: str, names: Sequence[str], rgb: np.ndarray, others: int) -> None:
    """List names beside their colours (name, 3), 0 to 1."""
    axes.set_axis_off()
    axes.set_xlim(0.0, 1.0)
    axes.set_ylim(_MOST_NAMES + 1.0, 0.0)
    axes.text(0.0, 0.4, title, fontsize=figures.TEXT_PT, color=palette.QUIET, va="center")
    listed = list(names[:_MOST_NAMES])
    for row, (name, colour) in enumerate(zip(listed, rgb, strict=False), start=1):
        axes.plot([0.03], [row + 0.3], "s", color=colour, ms=8, mec=palette.QUIET, mew=0.3, clip_on=False)
        axes.text(0.10, row + 0.3, name, fontsize=figures.SMALL_PT, color=palette.INK, va="center")
    left = others + len(names) - len(listed)
    if left:
        axes.text(
            0.10, len(listed) + 1.3, f"and {left} more", fontsize=figures.SMALL_PT, color=palette.QUIET, va="center"
        )
