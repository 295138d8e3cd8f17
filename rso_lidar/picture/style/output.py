"""Figures and tables written as files."""

from __future__ import annotations

import io
from abc import ABC, abstractmethod
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rso_lidar.files import check_writable, write_atomically, write_columns
from rso_lidar.picture.style.figures import FILE_DPI, PAGE_DPI
from rso_lidar.picture.style.palette import LIGHT, Scheme
from rso_lidar.picture.style.recolour import recolour

if TYPE_CHECKING:
    from matplotlib.figure import Figure

FIGURE_SUFFIXES = (".png", ".pdf", ".svg")
_LARGE_BYTES = 60_000  # of a PNG, above which its colours are reduced
RESULT_SUFFIXES = (*FIGURE_SUFFIXES, ".csv")  # of results that are a figure and a table


def save_figure(figure: Figure, path: str | Path, dpi: int = FILE_DPI, scheme: Scheme = LIGHT) -> Path:
    """Write a figure as PNG, PDF or SVG, by the suffix.

    Parameters
    ----------
    figure : what to write
    path : of the file; an existing one is replaced
    dpi : dots per inch of a PNG
    scheme : `LIGHT` or `DARK`; the figure keeps the dark colours

    Returns
    -------
    The path of the file.
    """
    place = check_writable(path, FIGURE_SUFFIXES, overwrite=True)
    undated = {".pdf": {"CreationDate": None}, ".svg": {"Date": None}}
    recolour(figure, scheme)
    with write_atomically(place) as draft:
        figure.savefig(draft, dpi=dpi, metadata=undated.get(place.suffix.lower()))
    return place


def save_small_figure(
    figure: Figure, path: Path, scheme: Scheme = LIGHT, metadata: Mapping[str, str] | None = None
) -> Path:
    """Write a figure for a web page as a PNG; a large one gets 256 colours, which is about a third of the bytes.

    Parameters
    ----------
    path : of the file; an existing one is replaced
    scheme : `LIGHT` or `DARK`; the figure keeps the dark colours
    metadata : texts of the PNG by keyword, such as ``{"Description": "…"}``
    """
    from PIL import Image
    from PIL.PngImagePlugin import PngInfo

    recolour(figure, scheme)
    with io.BytesIO() as held:
        figure.savefig(held, format="png", dpi=PAGE_DPI)
        picture = Image.open(held).convert("RGB")
        if held.getbuffer().nbytes > _LARGE_BYTES:
            picture = picture.quantize(256, dither=Image.Dither.NONE, kmeans=2)
    texts = PngInfo()
    for keyword, text in (metadata or {}).items():
        texts.add_text(keyword, text)
    with write_atomically(path) as draft:
        picture.save(draft, format="png", optimize=True, pnginfo=texts)
    return path


class SavedResult(ABC):
    """Base of results that are saved as a figure, or as a table of columns, by the suffix of a path."""

    @abstractmethod
    def figure(self) -> Any:
        """Return the figure of matplotlib."""

    @abstractmethod
    def columns(self) -> Mapping[str, Any]:
        """Return the columns of the table by name."""

    def save(self, path: str | Path, scheme: Scheme = LIGHT) -> Path:
        """Write the table or the picture; an existing file is replaced.

        Parameters
        ----------
        path : of the output, .csv, .png, .pdf or .svg
        scheme : of a picture, `LIGHT` or `DARK`

        Returns
        -------
        Path

        Raises
        ------
        RecordingError
            For another suffix, or a path that cannot be written.
        """
        place = check_writable(path, RESULT_SUFFIXES, overwrite=True)
        if place.suffix.lower() == ".csv":
            return write_columns(place, self.columns())
        return save_figure(self.figure(), place, scheme=scheme)
