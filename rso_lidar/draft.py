"""Files that are written whole or not at all."""

from __future__ import annotations

import csv
import itertools
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from rso_lidar.errors import RecordingError, RunError, did_you_mean


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


def free(place: Path, suffixes: Sequence[str], *, overwrite: bool = False) -> Path:
    """Return a path once it is sure that a file of one of these suffixes may be written there."""
    suffix = place.suffix.lower()
    if suffix not in suffixes:
        what = f"unknown suffix '{place.suffix}'" if suffix else "the name has no suffix"
        raise RecordingError(f"{place}: {what}{did_you_mean(suffix, suffixes)} (known: {', '.join(suffixes)})")
    if place.is_dir():
        raise RecordingError(f"{place}: is a folder; name a file in it")
    if place.exists() and not overwrite:
        raise RecordingError(f"{place}: exists already; give --overwrite or another name")
    if not place.parent.is_dir():
        raise RecordingError(f"{place}: there is no folder {place.parent}; make it first")
    return place


def write_columns(place: Path, table: Mapping[str, Any]) -> Path:
    """Return the path of a CSV of columns by name (arrays of one length), written whole or not at all."""
    with beside(place) as draft, draft.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(table)
        writer.writerows(zip(*(values.tolist() for values in table.values()), strict=True))
    return place


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
