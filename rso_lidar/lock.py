"""A lock beside a file that is being written."""

from __future__ import annotations

import errno
import os
import time
from pathlib import Path
from types import TracebackType
from typing import Self

from rso_lidar.errors import RecordingError, RunError

_AGAIN_S = 0.02  # between two looks whether a lock has come free
_NOT_OURS = (errno.EACCES, errno.EPERM, errno.EROFS)


def held(path: Path) -> bool | None:
    """Return whether a running process holds a lock; None where the system cannot tell."""
    try:
        import fcntl
    except ImportError:  # pragma: no cover - not POSIX
        return None
    try:
        descriptor = os.open(path, os.O_RDWR)
    except OSError:
        return False
    try:
        fcntl.flock(descriptor, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except BlockingIOError:
        return True
    finally:
        os.close(descriptor)
    return False


class Lock:
    """Keeps others away while this process writes; a killed run's lock falls with it. Also a context manager.

    Parameters
    ----------
    path : the lock's own file, ``.<name>.lock`` beside what it guards; it is taken away again.
    wait_s : how long to wait for whoever holds it [s].
    busy : what to say where it did not come free; else that another run is writing the file.
    """

    def __init__(self, path: Path, *, wait_s: float = 0.0, busy: str | None = None) -> None:
        self._path, self._descriptor = path, -1
        try:
            import fcntl  # noqa: F401
        except ImportError:  # pragma: no cover - not POSIX
            return
        until = time.monotonic() + wait_s
        try:
            while not self._taken():
                if time.monotonic() >= until:
                    says = busy or f"{path.name[1:-5]}: another run is writing it; wait, or give another name"
                    raise RecordingError(says)
                time.sleep(_AGAIN_S)
        except OSError as error:
            if error.errno in _NOT_OURS:
                raise RecordingError(
                    f"{path.parent}: may not be written ({error.strerror}); choose another folder"
                ) from None
            raise RunError(f"{path}: cannot be written ({error.strerror}); make room and run again") from error

    def _taken(self) -> bool:
        """Return whether the lock is ours now; one whose file its last holder took away meanwhile keeps nobody off."""
        import fcntl

        while True:
            descriptor = os.open(self._path, os.O_RDWR | os.O_CREAT, 0o644)
            try:
                fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
                if os.path.samestat(os.fstat(descriptor), self._path.stat()):
                    self._descriptor = descriptor
                    return True
            except BlockingIOError:
                return False
            except FileNotFoundError:
                pass
            finally:
                if self._descriptor != descriptor:
                    os.close(descriptor)

    def release(self) -> None:
        """Let others write; to be called once more than needed does no harm."""
        if self._descriptor >= 0:
            self._path.unlink(missing_ok=True)
            os.close(self._descriptor)
            self._descriptor = -1

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.release()
