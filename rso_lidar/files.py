"""Files: read whole and within bounds, written whole or not at all.

Reading refuses pipes, devices and files above a size limit, so that it always ends.
"""

from __future__ import annotations

import csv
import errno
import itertools
import os
import stat
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import IO, Any

from rso_lidar.errors import RecordingError, RsoLidarError, RunError, did_you_mean
from rso_lidar.interruption import defer_signals, remove_on_signal

MOST_BYTES = 256 * 2**20  # of a catalogue, a table or an image; the whole public catalogue as OMM has about 40 MiB
_MIB = 2**20
REFUSED = (errno.EACCES, errno.EPERM, errno.EROFS)
_drafts: dict[Path, os.stat_result] = {}  # temporary files of this process, as they were made
_CURES = {
    **dict.fromkeys((errno.ENOSPC, errno.EDQUOT, errno.EFBIG), "make room"),
    **dict.fromkeys(REFUSED, "allow writing there"),
    **dict.fromkeys((errno.ENOENT, errno.ENOTDIR, errno.ESTALE), "create its folder again"),
}


def convert_path(given: Any, error: type[RsoLidarError]) -> Path:
    """Convert a user's argument to a path; raise `error` if it is not one."""
    try:
        return Path(given)
    except TypeError:
        raise error(f"{given!r:.60}: not a path; give a str or a pathlib.Path") from None


def expand_user(path: str | os.PathLike[str]) -> Path:
    """Return a path with its leading ``~`` expanded; unchanged if there is no such user, so that no file is found.

    >>> expand_user("~no_such_user/a.tle").parts
    ('~no_such_user', 'a.tle')
    """
    with suppress(RuntimeError):
        return Path(path).expanduser()
    return Path(path)


def check_regular(path: Path, most_bytes: int, error: type[RsoLidarError], what: str = "file") -> os.stat_result:
    """Check that a file is regular and not larger than a limit, and return its status.

    Parameters
    ----------
    path : of the file.
    most_bytes : largest allowed size [byte].
    error : class of the error to raise.
    what : kind of file that is expected, for messages.

    Returns
    -------
    os.stat_result
        Status of the file.

    Raises
    ------
    error
        If the file is missing, is a folder, pipe, socket or device, or is too large.
    """
    try:
        status = path.stat()
    except FileNotFoundError:
        raise error(f"{path}: no such file; check the name") from None
    except (OSError, ValueError) as problem:
        raise error(f"{path}: cannot be read ({_reason(problem)}); check its name and permissions") from None
    if stat.S_ISDIR(status.st_mode):
        raise error(f"{path}: is a folder; give a {what} in it")
    if not stat.S_ISREG(status.st_mode):
        raise error(f"{path}: is a pipe, a socket or a device; save it as a regular {what} and give that")
    if status.st_size > most_bytes:
        raise error(_too_large(path, status.st_size, most_bytes, what))
    return status


def read_bytes(path: Path, most_bytes: int, error: type[RsoLidarError], what: str = "file") -> bytes:
    """Read a regular file that is not larger than a limit.

    Parameters
    ----------
    path : of the file.
    most_bytes : largest allowed size [byte].
    error : class of the error to raise.
    what : kind of file that is expected, for messages.

    Returns
    -------
    bytes
        Whole content of the file.

    Raises
    ------
    error
        If `check_regular` refuses the file, or it cannot be read.
    """
    check_regular(path, most_bytes, error, what)
    try:
        # O_NONBLOCK: a pipe that replaces the file after the check does not block.
        with os.fdopen(
            os.open(path, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0)), "rb"
        ) as file:
            # Files of /proc report no size, and a log may grow after the check. read() gives None where it would block.
            content = file.read(most_bytes + 1) or b""
    except OSError as problem:
        raise error(f"{path}: cannot be read ({_reason(problem)}); check its permissions") from None
    if len(content) > most_bytes:
        raise error(_too_large(path, len(content), most_bytes, what))
    return content


def read_text(path: Path, most_bytes: int, error: type[RsoLidarError], what: str = "text file") -> str:
    """Read a UTF-8 text file that is not larger than a limit.

    Parameters
    ----------
    path : of the file.
    most_bytes : largest allowed size [byte].
    error : class of the error to raise.
    what : kind of file that is expected, for messages.

    Returns
    -------
    str
        The text, without a byte order mark.

    Raises
    ------
    error
        If `check_regular` refuses the file, or it is not UTF-8.
    """
    try:
        return read_bytes(path, most_bytes, error, what).decode("utf-8-sig")
    except UnicodeDecodeError:
        raise error(f"{path}: is not UTF-8 text; save it as UTF-8") from None


def _too_large(path: Path, size: int, most_bytes: int, what: str) -> str:
    """Return the message about a file above its limit.

    Parameters
    ----------
    path, size : the file, and its size [byte].
    most_bytes, what : largest allowed size [byte], and the kind of the file.
    """
    limit = f"{most_bytes / _MIB:,.0f} MiB" if most_bytes >= _MIB else f"{most_bytes:,} bytes"
    return f"{path}: has {size / _MIB:,.1f} MiB or more, over the {limit} that a {what} may have; give a smaller one"


def _reason(problem: BaseException) -> str:
    return getattr(problem, "strerror", None) or " ".join(str(problem).split())


# ------------------------------------------------------------------------------------------------------- writing


def advise_on_write(number: int | None) -> str:
    """Return what to do about a failed write, by the system's error number; `number` may be None.

    >>> advise_on_write(errno.ENOSPC), advise_on_write(errno.EROFS), advise_on_write(errno.EIO)
    ('make room', 'allow writing there', 'check the disk')
    """
    return _CURES.get(number or 0, "check the disk")


@contextmanager
def write_atomically(place: Path) -> Iterator[Path]:
    """Create a file beside `place` to write to, and rename it to `place` when the context ends without an error.

    A run that stops half way leaves no partial file, and an older file stays until the new one is complete. The
    temporary name is the first free one of x.part.png, x.part1.png, and so on. If another program replaces that file,
    nothing is renamed and a `RunError` is raised.
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
            raise make_write_error(place, error) from None
        raise RecordingError(f"{place}: there is no folder {place.parent}; create it first") from None
    except OSError as error:
        raise make_write_error(place, error) from None
    finally:
        remove()
        held.close()  # while it is open, no other file can get its inode


def make_write_error(place: Path, error: OSError) -> RunError:
    """Make the error for a file or folder that could not be written completely, with advice that fits the reason."""
    if not place.parent.is_dir():
        return RunError(
            f"{place}: could not be written: its folder was removed or renamed; create it again, then run again"
        )
    why = error.strerror or error
    return RunError(f"{place}: could not be written: {why}; {advise_on_write(error.errno)} and run again")


def is_same(path: Path, made: os.stat_result) -> bool:
    """Return whether a path still leads to the file or folder with this earlier status; links are not followed."""
    with suppress(OSError):
        return os.path.samestat(path.lstat(), made)
    return False


def check_draft(draft: Path, made: os.stat_result, place: Path) -> None:
    """Check that a temporary file or folder is still the one that this process made, and is not empty.

    Parameters
    ----------
    draft : path of the temporary file or folder.
    made : its status when it was made.
    place : the output, for the message.

    Raises
    ------
    RunError
        If another program removed, replaced or emptied it.
    """
    if not draft.parent.is_dir():
        raise FileNotFoundError(errno.ENOENT, os.strerror(errno.ENOENT))
    if not is_same(draft, made):
        what = "replaced" if os.path.lexists(draft) else "removed or renamed"
    elif draft.is_dir() or draft.stat().st_size:
        return
    else:
        what = "emptied"
    raise RunError(f"{place}: not written: another program {what} its temporary file {draft.name}; run again")


def check_stream(stream: IO[Any], draft: Path, place: Path) -> None:
    """Flush an open temporary file, and check that it was not replaced or truncated since it was opened.

    Parameters
    ----------
    stream : the open file, written from its beginning.
    draft : path of the file.
    place : the output, for the message.

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
        raise RunError(f"{place}: not written: another program truncated its temporary file {draft.name}; run again")


def check_writable(path: str | os.PathLike[str], suffixes: Sequence[str] = (), *, overwrite: bool = False) -> Path:
    """Check that a file may be written at a path, and expand its leading ``~``.

    Every command and function that writes a file calls this first, so that all of them refuse in the same way.

    Parameters
    ----------
    path : of the file to write.
    suffixes : allowed suffixes, in lower case; empty to allow any.
    overwrite : whether an existing file may be replaced.

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
        if place.exists() and not overwrite:
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
    """Return whether the effective user of this process may create files in a folder."""
    return os.access(folder, os.W_OK | os.X_OK, effective_ids=os.access in os.supports_effective_ids)


def check_suffix(place: Path, suffixes: Sequence[str]) -> None:
    """Check that a path has one of some suffixes (lower case); an empty sequence allows all."""
    suffix = place.suffix.lower()
    if suffixes and suffix not in suffixes:
        what = f"unknown suffix '{place.suffix}'" if suffix else "the name has no suffix"
        guess = did_you_mean(suffix, suffixes)
        raise RecordingError(f"{place}: {what}{guess} (known: {', '.join(suffixes)})")


def write_text(path: str | os.PathLike[str], text: str, *, overwrite: bool = False) -> Path:
    """Write a text file as UTF-8 with plain line feeds, completely or not at all.

    Parameters
    ----------
    path : of the file.
    text : its content.
    overwrite : whether an existing file may be replaced.

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


def write_columns(place: Path, table: Mapping[str, Any]) -> Path:
    """Write a table of columns by name (arrays of one length) as CSV, completely or not at all, and return its path."""
    with write_atomically(place) as draft, draft.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(table)
        writer.writerows(zip(*(values.tolist() for values in table.values()), strict=True))
    return place


def _new(place: Path) -> tuple[Path, IO[bytes]]:
    """Create an empty file beside `place`, with its suffix and a name that is free; return its path and the open file."""
    for number in itertools.count():
        draft = place.with_name(f"{place.stem}.part{number or ''}{place.suffix}")
        try:
            return draft, draft.open("xb")  # never through a link
        except FileExistsError:
            continue
    raise AssertionError("unreachable: itertools.count is infinite")


def count_bytes(path: Path) -> int:
    """Return the size of a file, or of all files in a folder [byte]."""
    files_in = path.rglob("*") if path.is_dir() else [path]
    return sum(file.stat().st_size for file in files_in if file.is_file())
