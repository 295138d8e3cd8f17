"""A lock beside a recording that is being written."""

from __future__ import annotations

import os
from pathlib import Path

from rso_lidar.errors import RecordingError, RunError


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
    """Keeps a second run of the same recording away while this one writes; a killed run's lock falls with it."""

    def __init__(self, path: Path) -> None:
        self._path, self._descriptor = path, -1
        try:
            import fcntl
        except ImportError:  # pragma: no cover - not POSIX
            return
        try:
            self._descriptor = os.open(path, os.O_RDWR | os.O_CREAT, 0o644)
            fcntl.flock(self._descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            os.close(self._descriptor)
            raise RecordingError(f"{path.name[1:-5]}: another run is writing it; wait, or give another name") from None
        except OSError as error:
            raise RunError(f"{path}: cannot be written ({error.strerror}); make room and run again") from error

    def release(self) -> None:
        """Let others write; to be called once more than needed does no harm."""
        if self._descriptor >= 0:
            self._path.unlink(missing_ok=True)
            os.close(self._descriptor)
            self._descriptor = -1
