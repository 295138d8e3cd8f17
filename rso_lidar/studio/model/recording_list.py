"""The recordings of a folder: their status, and how one is opened."""

from __future__ import annotations

import contextlib
from pathlib import Path
from typing import Any

from rso_lidar.errors import RecordingError, RsoLidarError, ScenarioError
from rso_lidar.export import Recording, RecordingStatus, check_self_contained, read_status
from rso_lidar.studio.model.root_folder import Folder

RECORDINGS = (".h5", ".nc")
Stamp = tuple[int, int, int]


class RecordingList:
    """Status of each recording of a folder. A file is read again only when it has changed."""

    def __init__(self, folder: Folder) -> None:
        self.folder = folder
        self._known: dict[Path, tuple[tuple[Stamp, ...], RecordingStatus]] = {}
        self.problems: dict[Path, str] = {}

    def read(self) -> list[RecordingStatus]:
        """List the recordings of the folder and its subfolders: complete, being written or interrupted.

        Those that cannot be read, and those that name other files, are left out; `problems` says why.
        """
        files: dict[Path, list[Path]] = {self.folder.path / name: [] for name in self.folder.list_files(RECORDINGS)}
        for path in sorted((*self.folder.path.glob("*.tmp-*"), *self.folder.path.glob("*/*.tmp-*"))):
            with contextlib.suppress(ScenarioError):
                name = path.relative_to(self.folder.path).as_posix().rpartition(".tmp-")[0]
                if not path.is_symlink():  # a run makes none
                    files.setdefault(self.folder.resolve(name, RECORDINGS), []).append(path)
        statuses, problems = {}, {}
        for path, temporary in sorted(files.items()):
            try:
                stamps = tuple(_stamp(file) for file in (path, *temporary) if file.exists())
                known = self._known.get(path)
                if known and known[0] == stamps and not known[1].running:
                    statuses[path] = known
                    continue
                status = read_status(path)
                check_self_contained(status.file)
                statuses[path] = stamps, status
            except (RsoLidarError, OSError) as error:
                problems[path] = str(error).removeprefix(f"{path}: ")
        self._known, self.problems = statuses, problems
        return [status for _, status in statuses.values()]

    def tabulate(self) -> list[dict[str, Any]]:
        """List the recordings as rows of a table: name in the folder, frames, state and size [MB]; last, those not read."""
        rows: list[dict[str, Any]] = []
        for status in self.read():
            size = f"{status.file.stat().st_size / 1e6:.1f}" if status.file.exists() else "0.0"
            state = "complete" if status.complete else "running" if status.running else "interrupted"
            rows.append({"name": self._name(status.output), "frames": status.frames, "state": state, "size": size})
        unread = {"frames": "", "state": "cannot be read", "size": ""}
        return rows + [{"name": self._name(path), **unread} for path in self.problems]

    def _name(self, path: Path) -> str:
        return path.relative_to(self.folder.path).as_posix()


def open_recording(folder: Folder, name: str) -> tuple[Recording, bool]:
    """Open a recording of the folder, and say whether it is still written.

    Raises
    ------
    RsoLidarError
        If the name is not allowed, or the file cannot be read or names other files.
    """
    place = folder.resolve(name, RECORDINGS)
    status = read_status(place)
    try:
        return _open_checked(status.file), status.running
    except RecordingError:
        if status.complete or status.file.exists():
            raise
    return _open_checked(read_status(place).file), False  # its run has ended meanwhile, and has renamed the file


def _open_checked(path: Path) -> Recording:
    check_self_contained(path)
    return Recording(path)


def _stamp(path: Path) -> Stamp:
    status = path.stat()
    return status.st_mtime_ns, status.st_size, status.st_ino
