"""Lock files: one process at a time writes a file or a folder."""

from __future__ import annotations

import errno
import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from rso_lidar.errors import RecordingError, RunError
from rso_lidar.files.writing import REFUSED, advise_on_write
from rso_lidar.interruption import remove_on_signal

_WAIT_S = 0.1  # longer than is_locked holds a lock, which is microseconds
_POLL_S = 0.02  # between two attempts to acquire a lock


@contextmanager
def hold_lock(path: Path, *, wait_s: float = _WAIT_S, busy: str | None = None) -> Iterator[None]:
    """Hold a lock file during a context, so that no other process writes the file that it guards.

    The system releases the lock of a process that is killed. The lock file is removed when the context ends.

    Parameters
    ----------
    path : of the lock file, ``.<name>.lock`` beside the file that it guards
    wait_s : longest wait for another process to release it [s]
    busy : message if it was not released; by default, that another run is writing the file

    Yields
    ------
    None
        While the lock is held.

    Raises
    ------
    RecordingError
        If another process holds the lock, or the folder may not be written.
    RunError
        If the file system refuses the lock file for another reason, such as a full disk.
    """
    from filelock import FileLock, Timeout

    lock = FileLock(path, thread_local=False)
    try:
        if not path.parent.is_dir():  # FileLock would make it
            raise FileNotFoundError(errno.ENOENT, os.strerror(errno.ENOENT))
        lock.acquire(timeout=wait_s, poll_interval=_POLL_S)
    except Timeout:
        message = busy or f"{path.name[1:-5]}: another run is writing it; wait, or give another name"
        raise RecordingError(message) from None
    except OSError as error:
        if error.errno in REFUSED:
            raise RecordingError(
                f"{path.parent}: may not be written ({error.strerror}); choose another folder"
            ) from None
        raise RunError(
            f"{path}: cannot be written ({error.strerror}); {advise_on_write(error.errno)} and run again"
        ) from error
    try:
        with remove_on_signal(path.unlink):
            yield
    finally:
        if os.name == "posix":  # while locked: filelock then notices that its file is gone, and acquires a new one
            with suppress(OSError):
                path.unlink()
        lock.release()


def is_locked(path: Path) -> bool | None:
    """Return whether a running process holds a lock file; None if that cannot be determined.

    Parameters
    ----------
    path : of the lock file
    """
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
