"""Where pictures go: paths checked before anything is drawn, and figures written."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from rso_lidar.errors import RecordingError, RunError

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


@contextmanager
def beside(place: Path) -> Iterator[Path]:
    """Return, as a context, a new file beside `place` to write to; it takes the name `place` when all went well.

    So a run that is stopped half way leaves no half picture, and an older one stays until the new one is whole. The new
    file is nobody else's: its name is the first of x.part.png, x.part1.png, ... that is free.
    """
    draft: Path | None = None
    try:
        draft = _new(place)
        yield draft
        draft.replace(place)
    except PermissionError as error:
        raise RecordingError(f"{place}: may not be written ({error.strerror}); choose another folder") from None
    except OSError as error:
        raise RunError(f"{place}: could not be written: {error.strerror or error}") from None
    finally:
        if draft is not None:
            draft.unlink(missing_ok=True)


def _new(place: Path) -> Path:
    """Return a file that was not there before, empty, beside `place` and with its suffix."""
    for number in itertools.count():
        draft = place.with_name(f"{place.stem}.part{number or ''}{place.suffix}")
        try:
            draft.open("xb").close()
        except FileExistsError:
            continue
        return draft
    raise AssertionError("counting has no end")


def save_figure(figure: Figure, path: str | Path, dpi: int = 150) -> Path:
    """Return the path of a figure written as PNG, PDF or SVG, by its suffix; `dpi` [dots per inch] counts for PNG."""
    place = checked(path, FIGURE_SUFFIXES)
    undated = {".pdf": {"CreationDate": None}, ".svg": {"Date": None}}
    with beside(place) as draft:
        figure.savefig(draft, dpi=dpi, metadata=undated.get(place.suffix.lower()))
    return place
