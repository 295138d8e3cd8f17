"""Paths of the data shipped with the package: `tle/`, `models/`, `gravity/`, `stars/` and `examples/`."""

from pathlib import Path

_FOLDERS = ("tle", "models", "gravity", "stars", "examples")


def shipped(name: str = "") -> Path:
    """Return the path of shipped data, such as ``shipped("tle/tdrs.tle")``.

    A wheel has the folders inside the package, an editable install beside it. The path need not exist.
    """
    package = Path(__file__).resolve().parent
    inside = (package / "models" / "index.toml").is_file()
    return (package if inside else package.parent) / name


def is_shipped(path: Path) -> bool:
    """Return whether a file belongs to the shipped data, symbolic links resolved."""
    return any(path.resolve().is_relative_to(shipped(folder).resolve()) for folder in _FOLDERS)


def find(path: str | Path, folder: Path | None = None) -> Path | None:
    """Find the file that a user means by `path`; None if there is none.

    An absolute path is used as it is. A relative path is looked up in `folder` (by default the working folder), then among
    the shipped data: not in the package's other folders, nor by `..` beside it.

    Parameters
    ----------
    folder : start of relative paths (None: the working folder)
    """
    try:
        wanted = Path(path).expanduser()
        places = [wanted if wanted.is_absolute() else (folder or Path()) / wanted]
        if wanted.parts and wanted.parts[0] in _FOLDERS and ".." not in wanted.parts:
            places.append(shipped(str(wanted)))
        return next((place for place in places if place.exists()), None)
    except (OSError, RuntimeError, ValueError):  # no such user, a name too long: there is no such file
        return None
