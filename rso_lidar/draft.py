"""Files that are written whole or not at all, and by one process at a time."""

from __future__ import annotations

import csv
import errno
import itertools
import os
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import IO, Any

from rso_lidar.errors import RecordingError, RunError, did_you_mean
from rso_lidar.interruption import removing, uninterrupted

_LOOK_S = 0.1  # is_locked holds a lock for microseconds; another process waits up to this long for it
_POLL_S = 0.02  # between two attempts to take a lock
_REFUSED = (errno.EACCES, errno.EPERM, errno.EROFS)
_drafts: dict[Path, os.stat_result] = {}  # temporary files of this process, as they were made
_CURES = {
    **dict.fromkeys((errno.ENOSPC, errno.EDQUOT, errno.EFBIG), "make room"),
    **dict.fromkeys(_REFUSED, "allow writing there"),
    **dict.fromkeys((errno.ENOENT, errno.ENOTDIR, errno.ESTALE), "make its folder again"),
}


def write_cure(number: int | None) -> str:
    """Return what to do about a write that the system refused with an error number; None where it gave none.

    >>> write_cure(errno.ENOSPC), write_cure(errno.EROFS), write_cure(errno.EIO)
    ('make room', 'allow writing there', 'check the disk')
    """
    return _CURES.get(number or 0, "check the disk")


@contextmanager
def beside(place: Path) -> Iterator[Path]:
    """Return, as a context, a new file beside `place` to write to; it takes the name `place` when all went well.

    So a run that is stopped half way leaves no half file, and an older one stays until the new one is whole. The new
    file is nobody else's: its name is the first of x.part.png, x.part1.png, ... that is free. Where another program
    replaces it meanwhile, nothing is published.
    """
    draft: Path | None = None
    held = ExitStack()

    def remove() -> None:
        if draft in _drafts and is_same(draft, _drafts.pop(draft)):
            with suppress(OSError):
                draft.unlink()

    try:
        with removing(remove):
            with uninterrupted():
                draft, stream = _new(place)
                _drafts[draft] = os.fstat(stream.fileno())
                held.enter_context(stream)
                if os.name != "posix":  # an open file cannot be renamed
                    held.close()
            yield draft
            check_draft(draft, _drafts[draft], place)
            draft.replace(place)
            if place in _drafts:  # the draft of another context, which this one wrote
                _drafts[place] = _drafts[draft]
    except PermissionError as error:
        raise RecordingError(f"{place}: may not be written ({error.strerror}); choose another folder") from None
    except (FileNotFoundError, NotADirectoryError) as error:
        if draft is not None:
            raise write_error(place, error) from None
        raise RecordingError(f"{place}: there is no folder {place.parent}; make it first") from None
    except OSError as error:
        raise write_error(place, error) from None
    finally:
        remove()
        held.close()  # as long as it is open, no other file gets its inode


def write_error(place: Path, error: OSError) -> RunError:
    """Return the error for a file or folder that could not be written to its end, with advice that fits the reason."""
    if not place.parent.is_dir():
        return RunError(
            f"{place}: could not be written: its folder was removed or renamed; make it again and run again"
        )
    why = error.strerror or error
    return RunError(f"{place}: could not be written: {why}; {write_cure(error.errno)} and run again")


def is_same(path: Path, made: os.stat_result) -> bool:
    """Return whether what lies at a path, links not followed, is the file or folder of an earlier look."""
    with suppress(OSError):
        return os.path.samestat(path.lstat(), made)
    return False


def check_draft(draft: Path, made: os.stat_result, place: Path) -> None:
    """Raise a `RunError` where a temporary file or folder is no longer what was made there, or is empty.

    Parameters
    ----------
    draft : of the temporary file or folder.
    made : what it was when it was made.
    place : the output, for the message.
    """
    if not draft.parent.is_dir():
        raise FileNotFoundError(errno.ENOENT, os.strerror(errno.ENOENT))
    if not is_same(draft, made):
        what = "replaced" if os.path.lexists(draft) else "removed or renamed"
    elif draft.is_dir() or draft.stat().st_size:
        return
    else:
        what = "emptied"
    raise RunError(f"{place}: is not written, for another program {what} its temporary file {draft.name}; run again")


def check_stream(stream: IO[Any], draft: Path, place: Path) -> None:
    """Raise a `RunError` where a temporary file, open and written from its beginning, was replaced or cut short.

    Parameters
    ----------
    stream : the open file; it is flushed.
    draft : path of the file.
    place : the output, for the message.
    """
    stream.flush()
    held = os.fstat(stream.fileno())
    if held.st_size:
        check_draft(draft, held, place)
    if held.st_size != os.lseek(stream.fileno(), 0, os.SEEK_CUR):
        raise RunError(
            f"{place}: is not written, for another program cut short its temporary file {draft.name}; run again"
        )


def free(path: str | os.PathLike[str], suffixes: Sequence[str] = (), *, overwrite: bool = False) -> Path:
    """Check that a file may be written at a path, and return the path with a leading ``~`` expanded.

    Every command and function that writes a file calls this before it begins, so that all refuse in the same way.

    Parameters
    ----------
    path : of the file to write.
    suffixes : those that it may have, in lower case; empty, any.
    overwrite : whether an older file may be replaced.

    Raises
    ------
    RecordingError
        For another suffix, an existing file, a folder, a device, and a folder that is missing or read-only.
    """
    try:
        place = Path(path).expanduser()
        check_suffix(place, suffixes)
        with suppress(FileNotFoundError, NotADirectoryError):
            place.lstat()  # which says, as `exists` does not, why a name cannot even be looked up
        if place.is_dir():
            raise RecordingError(f"{place}: is a folder; name a file in it")
        if place.exists() and not place.is_file():
            raise RecordingError(f"{place}: is not a regular file; give another name")
        if place.exists() and not overwrite:
            raise RecordingError(f"{place}: exists already; give --overwrite (overwrite=True) or another name")
        if not place.parent.is_dir():
            raise RecordingError(f"{place}: there is no folder {place.parent}; make it first")
        if not os.access(place.parent, os.W_OK | os.X_OK):
            raise RecordingError(f"{place}: the folder may not be written to; choose another")
    except (OSError, RuntimeError, ValueError) as error:  # a name too long, no such user, a NUL character
        if isinstance(error, RecordingError):
            raise
        what = getattr(error, "strerror", None) or error
        raise RecordingError(f"{os.fspath(path)}: cannot be written here ({what}); choose another place") from None
    return place


def check_suffix(place: Path, suffixes: Sequence[str]) -> None:
    """Raise an error where a path has none of these suffixes (lower case); an empty list allows all."""
    suffix = place.suffix.lower()
    if suffixes and suffix not in suffixes:
        what = f"unknown suffix '{place.suffix}'" if suffix else "the name has no suffix"
        guess = did_you_mean(suffix, suffixes)
        raise RecordingError(f"{place}: {what}{guess} (known: {', '.join(suffixes)})")


def write_text(path: str | os.PathLike[str], text: str, *, overwrite: bool = False) -> Path:
    """Write a text as UTF-8 with plain line feeds, whole or not at all, and return its path."""
    place = free(path, overwrite=overwrite)
    with beside(place) as draft:
        draft.write_text(text, encoding="utf-8", newline="\n")
    return place


@contextmanager
def hold_lock(path: Path, *, wait_s: float = _LOOK_S, busy: str | None = None) -> Iterator[None]:
    """Hold a lock file, as a context, so that no other process writes what it guards.

    The system releases the lock of a process that is killed. The file is removed when the context ends.

    Parameters
    ----------
    path : the lock's own file, ``.<name>.lock`` beside what it guards.
    wait_s : how long to wait for another process to release it [s].
    busy : the message where it was not released; by default, that another run is writing the file.

    Raises
    ------
    RecordingError : another process holds the lock, or the folder may not be written.
    RunError : the file system refuses the lock file for another reason, such as a full disk.
    """
    from filelock import FileLock, Timeout

    lock = FileLock(path, thread_local=False)
    try:
        if not path.parent.is_dir():  # FileLock would make it
            raise FileNotFoundError(errno.ENOENT, os.strerror(errno.ENOENT))
        lock.acquire(timeout=wait_s, poll_interval=_POLL_S)
    except Timeout:
        says = busy or f"{path.name[1:-5]}: another run is writing it; wait, or give another name"
        raise RecordingError(says) from None
    except OSError as error:
        if error.errno in _REFUSED:
            raise RecordingError(
                f"{path.parent}: may not be written ({error.strerror}); choose another folder"
            ) from None
        raise RunError(
            f"{path}: cannot be written ({error.strerror}); {write_cure(error.errno)} and run again"
        ) from error
    try:
        with removing(path.unlink):
            yield
    finally:
        if os.name == "posix":  # while it is held: filelock refuses a lock whose file is gone, and takes a new one
            with suppress(OSError):
                path.unlink()
        lock.release()


def is_locked(path: Path) -> bool | None:
    """Return whether a running process holds a lock file; None where that cannot be found out."""
    from filelock import lock_descriptor

    try:
        descriptor = os.open(path, os.O_RDONLY)
    except FileNotFoundError:
        return False
    except OSError:
        return None
    try:
        return not lock_descriptor(descriptor, blocking=False)
    except OSError:
        return None
    finally:
        os.close(descriptor)


def write_columns(place: Path, table: Mapping[str, Any]) -> Path:
    """Return the path of a CSV of columns by name (arrays of one length), written whole or not at all."""
    with beside(place) as draft, draft.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(table)
        writer.writerows(zip(*(values.tolist() for values in table.values()), strict=True))
    return place


def _new(place: Path) -> tuple[Path, IO[bytes]]:
    """Open a file that was not there before, empty, beside `place` and with its suffix; return its path, and it."""
    for number in itertools.count():
        draft = place.with_name(f"{place.stem}.part{number or ''}{place.suffix}")
        try:
            return draft, draft.open("xb")  # never through a link
        except FileExistsError:
            continue
    raise AssertionError("counting has no end")
