"""Figures and tables written as files."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rso_lidar.files import check_writable, write_atomically, write_columns

if TYPE_CHECKING:
    from matplotlib.figure import Figure

FIGURE_SUFFIXES = (".png", ".pdf", ".svg")
RESULT_SUFFIXES = (*FIGURE_SUFFIXES, ".csv")  # of results that are a figure and a table


def save_figure(figure: Figure, path: str | Path, dpi: int = 150) -> Path:
    """Write a figure as PNG, PDF or SVG, by the suffix.

    Parameters
    ----------
    figure : what to write.
    path : of the file; an existing one is replaced.
    dpi : dots per inch of a PNG.

    Returns
    -------
    The path of the file.
    """
    place = check_writable(path, FIGURE_SUFFIXES, overwrite=True)
    undated = {".pdf": {"CreationDate": None}, ".svg": {"Date": None}}
    with write_atomically(place) as draft:
        figure.savefig(draft, dpi=dpi, metadata=undated.get(place.suffix.lower()))
    return place


def save_figure_or_table(path: str | Path, draw: Callable[[], Figure], table: Mapping[str, Any]) -> Path:
    """Write a result as a figure or as a CSV table, by the suffix.

    Parameters
    ----------
    path : of the file; an existing one is replaced.
    draw : makes the figure; called only where one is written.
    table : columns by name.

    Returns
    -------
    The path of the file.
    """
    place = check_writable(path, RESULT_SUFFIXES, overwrite=True)
    return save_figure(draw(), place) if place.suffix.lower() in FIGURE_SUFFIXES else write_columns(place, table)
