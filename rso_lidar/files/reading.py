"""Files read whole and within bounds: pipes, devices and files above a size limit are refused, so that reading ends."""

from __future__ import annotations

import errno
import os
import stat
from contextlib import suppress
from pathlib import Path
from typing import Any

from rso_lidar.errors import RsoLidarError

MOST_BYTES = 256 * 2**20  # of a catalogue, a table or an image; the whole public catalogue as OMM has about 40 MiB
_MIB = 2**20
_UNREADABLE = {  # what a file that cannot be read is, and what to do, by the system's error number
    errno.ENOENT: "no such file; check the name",
    errno.ENOTDIR: "a folder in its path is a file; check the path",
    errno.ENAMETOOLONG: "its name is longer than the file system allows; check the name",
    errno.ELOOP: "its symbolic links lead in a circle; give the file itself",
    errno.EISDIR: "is a folder; give a file in it",
    **dict.fromkeys((errno.EACCES, errno.EPERM), "may not be read; allow reading it, or copy it to a folder of yours"),
}


def convert_path(given: Any, error: type[RsoLidarError]) -> Path:
    """Convert a user's argument to a path.

    Parameters
    ----------
    given : what was given as a path
    error : class of the error to raise

    Returns
    -------
    Path

    Raises
    ------
    error
        If the argument is neither a text nor a path.
    """
    try:
        return Path(given)
    except TypeError:
        raise error(f"{given!r:.60}: not a path; give a str or a pathlib.Path") from None


def expand_user(path: str | os.PathLike[str]) -> Path:
    """Return a path with its leading ``~`` expanded; unchanged if there is no such user, so that no file is found.

    Parameters
    ----------
    path : as the user wrote it

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
    path : of the file
    most_bytes : largest allowed size [byte]
    error : class of the error to raise
    what : kind of file that is expected, for messages

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
    except (OSError, ValueError) as problem:
        raise error(explain_unreadable(path, problem)) from None
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
    path, most_bytes, error, what : as for `check_regular`

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
        raise error(explain_unreadable(path, problem)) from None
    if len(content) > most_bytes:
        raise error(_too_large(path, len(content), most_bytes, what))
    return content


def read_text(path: Path, most_bytes: int, error: type[RsoLidarError], what: str = "text file") -> str:
    """Read a UTF-8 text file that is not larger than a limit.

    Parameters
    ----------
    path, most_bytes, error, what : as for `check_regular`

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
    path, size : the file, and its size [byte]
    most_bytes, what : largest allowed size [byte], and the kind of the file
    """
    limit = describe_size(most_bytes)
    return f"{path}: has {size / _MIB:,.1f} MiB or more, over the {limit} that a {what} may have; give a smaller one"


def describe_size(size: int) -> str:
    """Return a size as text: in MiB, or in bytes below 1 MiB.

    Parameters
    ----------
    size : [byte]

    Returns
    -------
    str
        Such as "256 MiB" or "4,096 bytes".
    """
    return f"{size / _MIB:,.0f} MiB" if size >= _MIB else f"{size:,} bytes"


def explain_unreadable(path: str | os.PathLike[str], problem: OSError | ValueError) -> str:
    """Return the message about a file that cannot be read: its path as the user wrote it, the cause, and what to do.

    Parameters
    ----------
    path : of the file
    problem : what was raised; a ValueError for a NUL character in the path

    >>> explain_unreadable("a.toml", FileNotFoundError(errno.ENOENT, "No such file or directory"))
    'a.toml: no such file; check the name'
    """
    if not isinstance(problem, OSError):
        return f"{os.fspath(path)}: its name contains a NUL character, which no file can have; check the name"
    if problem.errno == errno.ENOENT and Path(path).is_symlink():
        return f"{os.fspath(path)}: is a link to {Path(path).readlink()}, which does not exist; mend the link"
    if problem.errno in _UNREADABLE:
        return f"{os.fspath(path)}: {_UNREADABLE[problem.errno]}"
    what = problem.strerror or " ".join(str(problem).split())
    return f"{os.fspath(path)}: cannot be read ({what}); check the file and its disk"


def count_bytes(path: Path) -> int:
    """Return the size of a file, or of all files in a folder [byte].

    Parameters
    ----------
    path : of the file or the folder
    """
    files_in = path.rglob("*") if path.is_dir() else [path]
    return sum(file.stat().st_size for file in files_in if file.is_file())
