"""A folder that is the only one a program may read and write: names of files inside it, and nothing outside it."""

from __future__ import annotations

from pathlib import Path

from rso_lidar.errors import ScenarioError

_MOST_FILES = 500  # that a list shows
_LONGEST_NAME = 200  # bytes of a path inside the folder; file systems take 255


class Folder:
    """One folder, with the only files that a program may read and write.

    Names are relative paths inside it. Absolute names, `..`, hidden files, and symbolic links that lead outside are refused.
    """

    def __init__(self, path: Path) -> None:
        """Take the path of an existing folder; raise `ScenarioError` if it is not a folder."""
        if not path.is_dir():
            raise ScenarioError(f"{path}: is not a folder; make it first, or name another")
        self.path = path.resolve()

    def resolve(self, name: str, suffixes: tuple[str, ...]) -> Path:
        """Return the path of a name inside the folder; the file need not exist.

        Raises
        ------
        ScenarioError
            If the name leads outside the folder, is hidden, or has another ending.
        """
        # One spelling of each name, so that two tabs never edit one file as two documents; no drives or streams of Windows.
        plain = name.isprintable() and 0 < len(name.encode()) <= _LONGEST_NAME and not {"\\", ":"} & set(name)
        if not plain or any(part.startswith((".", "~", " ")) or not part for part in name.split("/")):
            raise ScenarioError(
                f"{name!r:.80}: is not a file name inside the folder; give one such as approach{suffixes[0]}"
            )
        if not name.endswith(suffixes):
            raise ScenarioError(f"{name:.80}: must end with {' or '.join(suffixes)}")
        return self.require_inside(self.path / name)

    def has_inside(self, path: Path) -> bool:
        """Return whether the target of a path lies inside the folder."""
        try:
            return path.resolve().is_relative_to(self.path)
        except (OSError, RuntimeError, ValueError):  # a loop of links, or a name that no file can have
            return False

    def require_inside(self, path: Path) -> Path:
        """Return a path whose target lies inside the folder, or raise `ScenarioError`."""
        if not self.has_inside(path):
            raise ScenarioError(f"{path.name}: leads outside the folder {self.path.name}; copy the file into it")
        return path

    def list_files(self, suffixes: tuple[str, ...]) -> list[str]:
        """List the names with certain endings in the folder and its subfolders, at most 500, sorted."""
        names = []
        for path in sorted((*self.path.glob("*"), *self.path.glob("*/*"))):
            name = path.relative_to(self.path).as_posix()
            try:
                self.resolve(name, suffixes)
            except ScenarioError:
                continue
            if path.is_file():
                names.append(name)
        return names[:_MOST_FILES]
