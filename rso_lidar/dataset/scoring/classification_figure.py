"""A classifier judged: precision over recall by class (Fuller et al., fig. 16), confusion matrices, and detection curves."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from rso_lidar.picture import colour_maps, figures, palette

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Trace = tuple[np.ndarray, np.ndarray]  # values along x and along y
_SIDE_IN, _LEGEND_IN = 5.2, 3.0
_CELL_IN = 0.52  # of a large matrix
_NAME_LETTERS = 16


def precision_recall_figure(
    curves: Mapping[str, Sequence[Trace]], labels: Mapping[str, str], title: str, note: str = ""
) -> Figure:
    """Draw precision over recall by class."""
    figure = figures.new_figure(_SIDE_IN + _LEGEND_IN, _SIDE_IN + 0.5, title, note)
    axes = figure.subplots()
    for number, (name, runs) in enumerate(curves.items()):
        _draw_traces(axes, number, runs, labels.get(name, name))
    _frame_unit_square(axes, "Recall", "Precision")
    return figure


def presence_figure(
    precision: Sequence[Trace], detections: Sequence[Trace], labels: Sequence[str], title: str, note: str = ""
) -> Figure:
    """Draw the curves of a detector: precision over recall, and recall over the rate of false alarms."""
    figure = figures.new_figure(2.0 * _SIDE_IN, _SIDE_IN + 0.9, title, note)
    left, right = figure.subplots(1, 2)
    _draw_traces(left, 0, precision, labels[0])
    _draw_traces(right, 0, detections, labels[1])
    _frame_unit_square(left, "Recall", "Precision", inside=True)
    _frame_unit_square(right, "False-alarm rate", "Recall", inside=True)
    return figure


def confusion_figure(
    names: Sequence[str], matrices: Sequence[tuple[str, np.ndarray]], title: str, note: str = ""
) -> Figure:
    """Draw confusion matrices, the first one large.

    Parameters
    ----------
    matrices : words and counts (true class, predicted class) of each; a last column beyond the classes counts missing
        predictions. Shares are of the frames of the true class
    """
    size = len(names)
    large_in = max(3.4, 1.5 + _CELL_IN * (size + 1))
    others = len(matrices) - 1
    columns = max(1, min(3, others))
    rows = -(-others // columns) if others else 0
    small_in = large_in * 0.62
    width_in = max(large_in + 1.2, columns * small_in)
    figure = figures.new_figure(width_in, 0.7 + large_in + rows * small_in, title, note)
    grid = figure.add_gridspec(1 + rows, columns, height_ratios=[large_in] + [small_in] * rows)
    _draw_matrix(figure.add_subplot(grid[0, :]), names, *matrices[0], is_large=True)
    for number, (words, counts) in enumerate(matrices[1:]):
        axes = figure.add_subplot(grid[1 + number // columns, number % columns])
        _draw_matrix(axes, names, words, counts, is_large=False)
    return figure


def _draw_traces(axes: Axes, number: int, runs: Sequence[Trace], label: str) -> None:
    """Draw the curves of the runs of one class."""
    colour, style = figures.colour_of(number)
    for run, (x, y) in enumerate(runs):
        alone = len(runs) == 1
        width, alpha = (figures.THICK_PT, 1.0) if alone else (figures.THIN_PT, 0.65)
        axes.plot(x, y, color=colour, ls=style, lw=width, alpha=alpha, label=label if run == 0 else None)


def _frame_unit_square(axes: Axes, x: str, y: str, inside: bool = False) -> None:
    """Give a panel axes from 0 to 1 and its legend, which may stand inside."""
    axes.set_xlim(-0.01, 1.01)
    axes.set_ylim(-0.01, 1.02)
    axes.set_aspect("equal")
    figures.style_axes(axes, x=x, y=y)
    place = {"loc": "lower right"} if inside else {"loc": "upper left", "bbox_to_anchor": (1.02, 1.0)}
    axes.legend(fontsize=figures.SMALL_PT, frameon=False, labelcolor=palette.INK, borderaxespad=0.3, **place)


def _draw_matrix(axes: Axes, names: Sequence[str], words: str, counts: np.ndarray, is_large: bool) -> None:
    """Draw one confusion matrix (true class, predicted class) in shares of its rows; names and numbers if large."""
    import matplotlib

    if counts.shape[1] > len(names) and not counts[:, -1].any():
        counts = counts[:, :-1]
    called = [*names, "missing"][: counts.shape[1]]
    total = counts.sum(axis=1, keepdims=True)
    share = np.where(total > 0, counts / np.maximum(total, 1), np.nan)
    colours = matplotlib.colormaps[colour_maps.AMOUNT_RAMP]
    axes.imshow(np.where(total > 0, share, 0.0), cmap=colours, vmin=0.0, vmax=1.0)
    frames = int(counts.sum())
    figures.style_axes(axes, words, note=f"{frames:,} frames" if is_large else "")
    axes.grid(False)
    letters = _NAME_LETTERS if is_large else _NAME_LETTERS // 2
    axes.set_xticks(range(len(called)), [figures.shorten(name, letters) for name in called], rotation=45, ha="right")
    axes.set_yticks(range(len(names)), [figures.shorten(name, letters) for name in names])
    axes.tick_params(labelsize=figures.SMALL_PT, length=0)
    axes.set_xlabel("Predicted", fontsize=figures.TEXT_PT, color=palette.QUIET)
    axes.set_ylabel("True", fontsize=figures.TEXT_PT, color=palette.QUIET)
    if not is_large:
        axes.title.set_fontsize(figures.SMALL_PT)
        axes.set_title(words, loc="left", fontsize=figures.SMALL_PT, color=palette.INK)
    for row, col in np.argwhere(np.nan_to_num(share) >= (0.005 if is_large else 0.05)).tolist():
        value = float(share[row, col])
        axes.text(
            col, row, f"{100.0 * value:.0f}", ha="center", va="center", fontsize=figures.SMALL_PT,
            color=palette.choose_ink(colours(value)),
        )  # fmt: skip
