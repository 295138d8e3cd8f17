"""Figures written as files."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from rso_lidar.files import check_writable, write_atomically

if TYPE_CHECKING:
    from matplotlib.figure import Figure

FIGURE_SUFFIXES = (".png", ".pdf", ".svg")


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
