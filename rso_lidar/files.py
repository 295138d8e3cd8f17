"""Bounded reading of regular files: no pipe, device or huge file is read without end."""

from __future__ import annotations

import os
import stat
from contextlib import suppress
from pathlib import Path
from typing import Any

from rso_lidar.errors import RsoLidarError

MOST_BYTES = 256 * 2**20  # of a catalogue, a table or a picture; the whole public catalogue as OMM has some 40 MiB
_MIB = 2**20


def path_of(given: Any, error: type[RsoLidarError]) -> Path:
    """Return a path, or raise `error` for what is none."""
    try:
        return Path(given)
    except TypeError:
        raise error(f"{given!r:.60}: is no path; give a text or a pathlib.Path") from None


def expanded(path: str | os.PathLike[str]) -> Path:
    """Return a path with a leading ``~`` expanded; as it is where there is no such user, so that no such file is found.

    >>> expanded("~no_such_user/a.tle").parts
    ('~no_such_user', 'a.tle')
    """
    with suppress(RuntimeError):
        return Path(path).expanduser()
    return Path(path)


def check_regular(path: Path, most_bytes: int, error: type[RsoLidarError], what: str = "file") -> os.stat_result:
    """Check that a file is regular and has at most so many bytes, and return its status.

    Parameters
    ----------
    path : the file.
    most_bytes : the largest size that is read [byte].
    error : the class of what is raised.
    what : what the file should be, in words.

    Raises
    ------
    error : there is no such file, it is a folder, a pipe, a socket or a device, or it is too large.
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
    """Return the content of a regular file of at most so many bytes; the parameters are those of `check_regular`."""
    check_regular(path, most_bytes, error, what)
    try:
        # O_NONBLOCK: what takes the file's place now, such as a pipe, does not block.
        with os.fdopen(
            os.open(path, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0)), "rb"
        ) as file:
            # A file of /proc has no size, and one that is written to grows. None: it would block, as the kernel's log does.
            content = file.read(most_bytes + 1) or b""
    except OSError as problem:
        raise error(f"{path}: cannot be read ({_reason(problem)}); check its permissions") from None
    if len(content) > most_bytes:
        raise error(_too_large(path, len(content), most_bytes, what))
    return content


def read_text(path: Path, most_bytes: int, error: type[RsoLidarError], what: str = "text file") -> str:
    """Return the UTF-8 text of a regular file of at most so many bytes, without a byte order mark."""
    try:
        return read_bytes(path, most_bytes, error, what).decode("utf-8-sig")
    except UnicodeDecodeError:
        raise error(f"{path}: is not UTF-8 text; save it as UTF-8") from None


def _too_large(path: Path, size: int, most_bytes: int, what: str) -> str:
    limit = f"{most_bytes / _MIB:,.0f} MiB" if most_bytes >= _MIB else f"{most_bytes:,} bytes"
    return f"{path}: has {size / _MIB:,.1f} MiB or more, over the {limit} that a {what} may have; give a smaller one"


def _reason(problem: BaseException) -> str:
    return getattr(problem, "strerror", None) or " ".join(str(problem).split())
