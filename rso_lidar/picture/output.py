"""Where pictures go: paths checked before anything is drawn, and figures written."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from rso_lidar.draft import beside
from rso_lidar.errors import RecordingError

if TYPE_CHECKING:
    from matplotlib.figure import Figure

FIGURE_SUFFIXES = (".png", ".pdf", ".svg")


def checked(path: str | Path, known: tuple[str, ...]) -> Path:
    """Return `path` as a Path, once its suffix is among `known` and its folder is there."""
    place = Path(path).expanduser()
    suffix = place.suffix.lower()
    if suffix not in known:
        said = f"unknown suffix '{suffix}'" if suffix else "a picture's name needs a suffix"
        raise RecordingError(f"{place}: {said} (known: {', '.join(known)})")
    if place.is_dir():
        raise RecordingError(f"{place}: is a folder; give a file name in it")
    if not place.parent.is_dir():
        raise RecordingError(f"{place}: there is no folder {place.parent}; make it first")
    return place


def save_figure(figure: Figure, path: str | Path, dpi: int = 150) -> Path:
    """Return the path of a figure written as PNG, PDF or SVG, by its suffix; `dpi` [dots per inch] counts for PNG."""
    place = checked(path, FIGURE_SUFFIXES)
    undated = {".pdf": {"CreationDate": None}, ".svg": {"Date": None}}
    with beside(place) as draft:
        figure.savefig(draft, dpi=dpi, metadata=undated.get(place.suffix.lower()))
    return place
