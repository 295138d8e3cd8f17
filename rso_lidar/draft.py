"""Files that are written whole or not at all."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from rso_lidar.errors import RecordingError, RunError


@contextmanager
def beside(place: Path) -> Iterator[Path]:
    """Return, as a context, a new file beside `place` to write to; it takes the name `place` when all went well.

    So a run that is stopped half way leaves no half file, and an older one stays until the new one is whole. The new
    file is nobody else's: its name is the first of x.part.png, x.part1.png, ... that is free.
    """
    draft: Path | None = None
    try:
        draft = _new(place)
        yield draft
        draft.replace(place)
    except (FileNotFoundError, NotADirectoryError):
        raise RecordingError(f"{place}: there is no folder {place.parent}; make it first") from None
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
