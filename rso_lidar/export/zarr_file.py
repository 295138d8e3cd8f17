"""Zarr stores opened for reading, as `Recording` reads an HDF5 file: the names, dtypes and attributes are the same."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

from rso_lidar.errors import RecordingError

SUFFIX = ".zarr"


class ZarrFile:
    """A Zarr store that answers like an open h5py file: arrays and groups by path, attributes, and `close`."""

    def __init__(self, root: Any) -> None:
        self._root: Any = root

    @property
    def attrs(self) -> Any:
        """Return the attributes of the root."""
        return self._root.attrs

    def __contains__(self, path: str) -> bool:
        return path in self._root

    def __getitem__(self, path: str) -> Any:
        return self._root[path]

    def __bool__(self) -> bool:
        return self._root is not None

    def close(self) -> None:
        """Let go of the store."""
        self._root = None


def opened_zarr(path: Path) -> ZarrFile:
    """Return the store, or say in one line why it is none."""
    if not path.exists():
        raise RecordingError(f"{path}: there is no such folder; export one with `--to {path.name}`")
    if not (path / "zarr.json").is_file():
        raise RecordingError(f"{path}: is no Zarr store of version 3; give one made by `export`")
    try:
        import zarr
    except ImportError:
        raise RecordingError(f"{path}: Zarr needs an extra: pip install rso-lidar[zarr], or open the .h5") from None
    try:
        root = zarr.open_group(path, mode="r")
        for name, array in root.members(max_depth=None):
            if isinstance(array, zarr.Array):
                _whole(path, name, array)
        return ZarrFile(root)
    except RecordingError:
        raise
    except (OSError, ValueError, KeyError, TypeError) as error:
        what = " ".join(str(error).split())[:120]
        raise RecordingError(f"{path}: is damaged ({what}); export it again") from error


def _whole(path: Path, name: str, array: Any) -> None:
    """Refuse an array of which a chunk is not there: it would read as absence, which is something else."""
    held = array.shards or array.chunks
    wanted = math.prod(-(-side // chunk) for side, chunk in zip(array.shape, held, strict=True))
    there = sum(1 for file in (path / name / "c").rglob("*") if file.is_file()) if array.shape else wanted
    if there < wanted:
        raise RecordingError(f"{path}: {name} lacks {wanted - there} of {wanted} chunks; export it again")
