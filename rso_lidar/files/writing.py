"""Files written whole or not at all: beside their place, then renamed to it."""

from __future__ import annotations

import csv
import errno
import io
import itertools
import os
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import IO, Any

from rso_lidar.errors import RecordingError, RsoLidarError, RunError, did_you_mean, rephrase
from rso_lidar.interruption import defer_signals, remove_on_signal

REFUSED = (errno.EACCES, errno.EPERM, errno.EROFS)
_LONGEST_NAME = 255  # bytes of a name on the usual file systems
_drafts: dict[Path, os.stat_result] = {}  # temporary files of this process, as they were made
_CURES = {
    **dict.fromkeys((errno.ENOSPC, errno.EDQUOT, errno.EFBIG), "make room"),
    **dict.fromkeys(REFUSED, "allow writing there"),
    **dict.fromkeys((errno.ENOENT, errno.ENOTDIR, errno.ESTALE), "create its folder again"),
    **dict.fromkeys((errno.ENAMETOOLONG, errno.EINVAL, errno.EILSEQ), "give another name"),
    errno.ELOOP: "mend the links in its path",
}


def advise_on_write(number: int | None) -> str:
    """Return what to do about a failed write.

    Parameters
    ----------
    number : error number of the system; None if it is not known

    >>> advise_on_write(errno.ENOSPC), advise_on_write(errno.EROFS), advise_on_write(errno.EIO)
    ('make room', 'allow writing there', 'check the disk')
    """
    return _CURES.get(number or 0, "check the disk")


@contextmanager
def write_atomically(place: Path, *, keep_suffix: bool = True) -> Iterator[Path]:
    """Create a file beside `place` to write to, and rename it to `place` when the context ends without an error.

    A run that stops half way leaves no partial file, and an older file stays until the new one is complete. The
    temporary name is the first free one of x.part.png, x.part1.png, and so on, or of x.png.part, x.png.part1, and so on.
    If another program replaces that file, nothing is renamed.

    Parameters
    ----------
    place : of the output
    keep_suffix : whether the temporary name has the suffix of the output, from which some libraries take the format.
        Without it, no pattern such as ``*.h5`` matches what a killed run leaves

    Yields
    ------
    Path
        The file to write to.

    Raises
    ------
    RecordingError
        If the output may not be written there.
    RunError
        If writing fails, or another program replaces the file.
    """
    draft: Path | None = None
    held = ExitStack()

    def remove() -> None:
        if draft in _drafts and is_same(draft, _drafts.pop(draft)):
            with suppress(OSError):
                draft.unlink()

    try:
        with remove_on_signal(remove):
            with defer_signals():
                draft, stream = _new(place, keep_suffix)
                _drafts[draft] = os.fstat(stream.fileno())
                held.enter_context(stream)
                if os.name != "posix":  # an open file cannot be renamed
                    held.close()
            yield draft
            check_draft(draft, _drafts[draft], place)
            draft.replace(place)
            if place in _drafts:  # the draft of another context, which this one wrote
                _drafts[place] = _drafts[draft]
    except RsoLidarError as error:
        raise _name_output(error, draft, place) from error.__cause__
    except PermissionError as error:
        raise RecordingError(f"{place}: may not be written ({error.strerror}); choose another folder") from None
    except (FileNotFoundError, NotADirectoryError) as error:
        if draft is not None:
            raise _name_output(make_write_error(place, error), draft, place) from None
        if place.parent.is_dir():  # such as /proc
            raise RecordingError(f"{place}: its folder takes no new files; choose another folder") from None
        raise RecordingError(f"{place}: there is no folder {place.parent}; create it first") from None
    except OSError as error:
        raise _name_output(make_write_error(place, error), draft, place) from None
    finally:
        remove()
        held.close()  # while it is open, no other file can get its inode


def _name_output(error: RsoLidarError, draft: Path | None, place: Path) -> RsoLidarError:
    """Return an error that names the output where its message has the name of the temporary file.

    Parameters
    ----------
    error : as it was raised within `write_atomically`
    draft : path of the temporary file; None if there is none yet
    """
    message = str(error)
    if draft is None or draft.name not in message:
        return error
    return rephrase(error, message.replace(str(draft), str(place)).replace(draft.name, place.name))


def make_write_error(place: Path, error: OSError) -> RunError:
    """Make the error for an output that could not be written completely, with advice that fits the reason.

    Parameters
    ----------
    place : of the output, a file or a folder
    error : what the system reported

    Returns
    -------
    RunError
    """
    if not place.parent.is_dir():
        return RunError(
            f"{place}: could not be written: its folder was removed or renamed; create it again, then run again"
        )
    why = error.strerror or error
    return RunError(f"{place}: could not be written: {why}; {advise_on_write(error.errno)} and run again")


def is_same(path: Path, status: os.stat_result) -> bool:
    """Return whether a path still leads to the same file or folder; links are not followed.

    Parameters
    ----------
    path : of the file or folder
    status : its earlier status
    """
    with suppress(OSError):
        return os.path.samestat(path.lstat(), status)
    return False


def check_draft(draft: Path, status: os.stat_result, place: Path) -> None:
    """Check that a temporary file or folder is still the one that this process made, and is not empty.

    Parameters
    ----------
    draft : path of the temporary file or folder
    status : its status when it was made
    place : the output, for the message

    Raises
    ------
    RunError
        If another program removed, replaced or emptied it.
    """
    if not draft.parent.is_dir():
        raise FileNotFoundError(errno.ENOENT, os.strerror(errno.ENOENT))
    if not is_same(draft, status):
        what = "replaced" if os.path.lexists(draft) else "removed or renamed"
    elif draft.is_dir() or draft.stat().st_size:
        return
    else:
        what = "emptied"
    raise RunError(f"{place}: not written: another program {what} its temporary file; run again")


def check_stream(stream: IO[Any], draft: Path, place: Path) -> None:
    """Flush an open temporary file, and check that it was not replaced or truncated since it was opened.

    Parameters
    ----------
    stream : the open file, written from its beginning
    draft : path of the file
    place : the output, for the message

    Raises
    ------
    RunError
        If another program replaced or truncated it.
    """
    stream.flush()
    held = os.fstat(stream.fileno())
    if held.st_size:
        check_draft(draft, held, place)
    if held.st_size != os.lseek(stream.fileno(), 0, os.SEEK_CUR):
        raise RunError(f"{place}: not written: another program truncated its temporary file; run again")


def check_writable(path: str | os.PathLike[str], suffixes: Sequence[str] = (), *, overwrite: bool = False) -> Path:
    """Check that a file may be written at a path, and expand its leading ``~``.

    Every command and function that writes a file calls this first, so that all of them refuse in the same way.

    Parameters
    ----------
    path : of the file to write
    suffixes : allowed suffixes, in lower case; empty to allow any
    overwrite : whether an existing file may be replaced

    Returns
    -------
    Path
        The expanded path.

    Raises
    ------
    RecordingError
        For another suffix, an existing file, a folder, a device, and a folder that is missing or read-only.
    """
    try:
        place = Path(path).expanduser()
        check_suffix(place, suffixes)
        with suppress(FileNotFoundError, NotADirectoryError):
            place.lstat()  # unlike `exists`, it raises the reason why a name cannot be looked up
        if place.is_dir():
            raise RecordingError(f"{place}: is a folder; name a file in it")
        if place.exists() and not place.is_file():
            raise RecordingError(f"{place}: is not a regular file; give another name")
        if os.path.lexists(place) and not overwrite:  # also a link to nothing, which would be replaced
            raise RecordingError(f"{place}: exists already; give --overwrite (overwrite=True) or another name")
        if not place.parent.is_dir():
            raise RecordingError(f"{place}: there is no folder {place.parent}; create it first")
        if not can_write_in(place.parent):
            raise RecordingError(f"{place}: the folder may not be written to; choose another")
    except (OSError, RuntimeError, ValueError) as error:  # a name too long, no such user, a NUL character
        if isinstance(error, RecordingError):
            raise
        what = getattr(error, "strerror", None) or error
        raise RecordingError(f"{os.fspath(path)}: cannot be written here ({what}); choose another place") from None
    return place


def can_write_in(folder: Path) -> bool:
    """Return whether the effective user of this process may create files in a folder.

    Parameters
    ----------
    folder : where the files would be
    """
    return os.access(folder, os.W_OK | os.X_OK, effective_ids=os.access in os.supports_effective_ids)


def check_suffix(place: Path, suffixes: Sequence[str]) -> None:
    """Check that a path has one of some suffixes.

    Parameters
    ----------
    place : the path
    suffixes : allowed suffixes, lower case; an empty sequence allows all

    Raises
    ------
    RecordingError
        If it has another suffix, or none.
    """
    suffix = place.suffix.lower()
    if suffixes and suffix not in suffixes:
        what = f"unknown suffix '{place.suffix}'" if suffix else "the name has no suffix"
        guess = did_you_mean(suffix, suffixes)
        raise RecordingError(f"{place}: {what}{guess} (known: {', '.join(suffixes)})")


def write_text(path: str | os.PathLike[str], text: str, *, overwrite: bool = False) -> Path:
    """Write a text file as UTF-8 with plain line feeds, completely or not at all.

    Parameters
    ----------
    path : of the file
    text : its content
    overwrite : whether an existing file may be replaced

    Returns
    -------
    Path
        Where the file is, ``~`` expanded.

    Raises
    ------
    RecordingError
        If the file exists already, or may not be written there.
    """
    place = check_writable(path, overwrite=overwrite)
    with write_atomically(place) as draft:
        draft.write_text(text, encoding="utf-8", newline="\n")
    return place


def format_csv(rows: Iterable[Iterable[Any]]) -> str:
    """Return rows as the text of a CSV file.

    Parameters
    ----------
    rows : cells of each row, the first row being that of the heads
    """
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows(rows)
    return text.getvalue()


def write_columns(place: Path, table: Mapping[str, Any]) -> Path:
    """Write a table as CSV, completely or not at all.

    Parameters
    ----------
    place : of the file
    table : columns by name, arrays of one length

    Returns
    -------
    Path
        The same place.
    """
    with write_atomically(place) as draft, draft.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(table)
        writer.writerows(zip(*(values.tolist() for values in table.values()), strict=True))
    return place


def _new(place: Path, keep_suffix: bool) -> tuple[Path, IO[bytes]]:
    """Create an empty file beside `place`, with a name that is free; return its path and the open file."""
    for number in itertools.count():
        part = f".part{number or ''}"
        stem, suffix = (place.stem, place.suffix) if keep_suffix else (place.name, "")
        if len(os.fsencode(f"{stem}{part}{suffix}")) > _LONGEST_NAME >= len(os.fsencode(place.name)):
            stem = stem[:40]
        draft = place.with_name(f"{stem}{part}{suffix}" if keep_suffix else f"{stem}{part}")
        try:
            return draft, draft.open("xb")  # never through a link
        except FileExistsError:
            continue
    raise AssertionError("unreachable: itertools.count is infinite")


def align_columns(rows: Sequence[Sequence[str]], left: Collection[int] = (0,)) -> list[str]:
    """Return rows of cells as lines with aligned columns.

    Parameters
    ----------
    rows : cells, as many in each row
    left : numbers of the columns that align to the left; others align to the right

    >>> align_columns([("name", "m"), ("a", "10")])
    ['name   m', 'a     10']
    """
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    return [
        "  ".join(
            cell.ljust(width) if k in left else cell.rjust(width)
            for k, (cell, width) in enumerate(zip(row, widths, strict=True))
        ).rstrip()
        for row in rows
    ]
