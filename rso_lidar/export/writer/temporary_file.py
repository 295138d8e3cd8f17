"""The temporary file of a recording: checks for interference, and a copy of its frames where needed."""

from __future__ import annotations

import os
import sys
import tempfile
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

from rso_lidar.files import can_write_in

_COPY_BYTES = 2**22


class InterferenceError(OSError):
    """Another program moved, replaced or truncated the temporary file, or its folder became read-only.

    `cure` says what to do before the next run. `intact` says whether the open file still holds all its frames.
    """

    def __init__(self, what: str, cure: str, *, intact: bool = True) -> None:
        """Describe the interference.

        Parameters
        ----------
        intact : whether the open file still holds all its frames
        """
        super().__init__(what)
        self.cure, self.intact = cure, intact


class TemporaryFile:
    """A file that this process writes, identified by its inode as well as its name.

    On systems without inodes (Windows) nothing is checked.

    Parameters
    ----------
    descriptor : of the open file; a duplicate keeps the content alive if the name is removed
    """

    def __init__(self, path: Path, descriptor: int) -> None:
        self.path = path
        self._descriptor = os.dup(descriptor) if os.name == "posix" else -1

    def check(self, least_bytes: int) -> None:
        """Raise an `InterferenceError` unless the open file is at its path, has the length, and can be renamed.

        Parameters
        ----------
        least_bytes : least length of the file [bytes]
        """
        if self._descriptor < 0:
            return
        folder = self.path.parent
        if not self._lies_at(self.path):
            if not folder.is_dir():
                raise InterferenceError("its folder was removed or renamed", "make the folder again")
            what = "was replaced by another file" if os.path.lexists(self.path) else "was removed or renamed"
            raise InterferenceError(f"{self.path.name} {what}", "keep other programs away from it")
        if os.fstat(self._descriptor).st_size < least_bytes:
            what = f"{self.path.name} was cut short by another program"
            raise InterferenceError(what, "keep other programs away from it", intact=False)
        if not can_write_in(folder):
            raise InterferenceError(f"the folder {folder} may no longer be written to", "allow writing there again")

    def keep(self, output: Path) -> Path | None:
        """Return the path of the content, copied if its file has no name any more; None if copying failed.

        Parameters
        ----------
        output : final name of the recording; a copy gets a name that a resumed run recognises
        """
        for path in (self.path, *self._names()):
            if self._lies_at(path):
                return path
        suffix = self.path.name.removeprefix(output.name)
        for folder in self._folders():
            for name in (output.name, f"{output.stem}.rescued{output.suffix}"):
                with suppress(OSError):
                    return self._copy(folder / f"{name}{suffix}")
        return None

    def close(self) -> None:
        """Close the file; content without a name is lost then."""
        if self._descriptor >= 0:
            os.close(self._descriptor)
            self._descriptor = -1

    # ------------------------------------------------------------------------------------------------------ the inside

    def _lies_at(self, path: Path) -> bool:
        if self._descriptor < 0:
            return path.exists()
        with suppress(OSError):
            return os.path.samestat(os.lstat(path), os.fstat(self._descriptor))
        return False

    def _names(self) -> Iterator[Path]:
        """Yield the present name of the open file, where the system provides it (Linux, macOS)."""
        with suppress(OSError):
            if sys.platform == "darwin":  # pragma: no cover - macOS
                import fcntl

                path = fcntl.fcntl(self._descriptor, fcntl.F_GETPATH, bytes(1024)).rstrip(b"\0")
                yield Path(os.fsdecode(path))
            else:
                yield Path(f"/proc/self/fd/{self._descriptor}").readlink()

    def _folders(self) -> Iterator[Path]:
        """Yield folders for a copy: the nearest existing parent, and the system's temporary folder."""
        if self._descriptor < 0:
            return
        yield next(folder for folder in self.path.absolute().parents if folder.is_dir())
        yield Path(tempfile.gettempdir())

    def _copy(self, path: Path) -> Path:
        """Copy the content to a new file and return its path; never overwrite a file or follow a link."""
        try:
            with path.open("xb") as stream:
                place = 0
                while block := os.pread(self._descriptor, _COPY_BYTES, place):
                    stream.write(block)
                    place += len(block)
                stream.flush()
                os.fsync(stream.fileno())
        except FileExistsError:
            raise
        except OSError:
            with suppress(OSError):
                path.unlink()
            raise
        return path
