"""Pictures of the gallery: a scraper for sphinx-gallery that shows the value of the last expression of a cell.

Figures of `rso_lidar.picture` are drawn on an Agg canvas and never known to pyplot, so that the scraper of sphinx-gallery
does not see them. A script ends a cell, as one in a notebook, with a `matplotlib.figure.Figure`, with a `PIL.Image.Image`
such as ``Image.open(picture.contact_sheet(frames, path))``, or with a list of them. An animated GIF is copied as it is.
"""

from __future__ import annotations

import ast
import shutil
import tempfile
from pathlib import Path
from typing import Any

import matplotlib as mpl
from matplotlib.figure import Figure
from PIL import Image
from sphinx_gallery.scrapers import figure_rst

from rso_lidar.picture import make_rc_params

DPI = 110  # of figures, which are some 10 in wide


def scrape_last_value(block: Any, block_vars: dict[str, Any], gallery_conf: dict[str, Any]) -> str:
    """Save the pictures that the last expression of a cell gives, and return their RST.

    Parameters
    ----------
    block : the cell: its type, content and line, as sphinx-gallery divides a script.
    block_vars : what sphinx-gallery knows of the script, with the variables of the cell and an iterator of free paths.
    gallery_conf : settings of sphinx-gallery.

    Returns
    -------
    str
        Empty where the last expression is no picture.
    """
    if not _ends_with_expression(block[1]):
        return ""  # the value of an earlier cell is still there
    value = block_vars["example_globals"].get("___")
    pictures = value if isinstance(value, list) else [value]
    if not pictures or not all(isinstance(one, Figure | Image.Image) for one in pictures):
        return ""
    paths = [_save(one, Path(next(block_vars["image_path_iterator"]))) for one in pictures]
    return figure_rst([str(path) for path in paths], gallery_conf["src_dir"])


def _ends_with_expression(code: str) -> bool:
    """Return whether the last statement of a cell is an expression, whose value sphinx-gallery keeps."""
    body = ast.parse(code).body
    return bool(body) and isinstance(body[-1], ast.Expr)


def _save(picture: Figure | Image.Image, path: Path) -> Path:
    """Save a picture as PNG, or as GIF where it moves, and return its path."""
    if isinstance(picture, Figure):
        picture.savefig(path, dpi=DPI)
    elif getattr(picture, "is_animated", False):
        path = path.with_suffix(".gif")
        shutil.copyfile(picture.filename, path)
    else:
        picture.save(path)
    return path


def use_style(gallery_conf: dict[str, Any], script: str) -> None:
    """Draw the plots of the next script in the style of the package.

    Parameters
    ----------
    gallery_conf : settings of sphinx-gallery.
    script : name of the script that comes next.
    """
    mpl.rcParams.update(make_rc_params())


def use_temporary_folder(gallery_conf: dict[str, Any], script: str) -> None:
    """Give the next script an empty folder for temporary files, and remove that of the script before.

    Parameters
    ----------
    gallery_conf : settings of sphinx-gallery.
    script : name of the script that comes next.
    """
    global _folder  # noqa: PLW0603 # sphinx-gallery calls a function and keeps nothing for it
    if _folder is not None:
        _folder.cleanup()
    tempfile.tempdir = None
    _folder = tempfile.TemporaryDirectory(prefix="gallery-")
    tempfile.tempdir = _folder.name


_folder: tempfile.TemporaryDirectory[str] | None = None
