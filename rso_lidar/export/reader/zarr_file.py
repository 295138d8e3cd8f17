"""Zarr stores opened for reading, with the interface of an h5py file."""

from __future__ import annotations

import json
import math
import zlib
from pathlib import Path
from typing import Any

from rso_lidar.errors import RecordingError

SUFFIX = ".zarr"
_CRC = "metadata_crc32"  # attribute of the group /truth


class ZarrFile:
    """A Zarr store with the interface of an open h5py file: arrays and groups by path, attributes, and `close`."""

    def __init__(self, root: Any) -> None:
        self._root: Any = root

    @property
    def attrs(self) -> Any:
        """Attributes of the root."""
        return self._root.attrs

    def __contains__(self, path: str) -> bool:
        return path in self._root

    def __getitem__(self, path: str) -> Any:
        return self._root[path]

    def __bool__(self) -> bool:
        return self._root is not None

    def close(self) -> None:
        """Release the store."""
        self._root = None


def open_zarr(path: Path) -> ZarrFile:
    """Open a Zarr store; raise a `RecordingError` where it is missing, damaged or incomplete."""
    if not path.exists():
        raise RecordingError(f"{path}: there is no such folder; export one with `--to {path.name}`")
    if not (path / "zarr.json").is_file():
        raise RecordingError(f"{path}: is not a Zarr store of version 3; give one made by `export`")
    try:
        import zarr
    except ImportError:
        raise RecordingError(f"{path}: Zarr needs an extra: pip install rso-lidar[zarr], or open the .h5") from None
    try:
        _check_metadata(path)
        root = zarr.open_group(path, mode="r")
        for name, array in root.members(max_depth=None):
            if isinstance(array, zarr.Array):
                _check_chunks(path, name, array)
        return ZarrFile(root)
    except RecordingError:
        raise
    except (OSError, ValueError, KeyError, TypeError) as error:
        what = " ".join(str(error).split())[:120]
        raise RecordingError(f"{path}: is damaged ({what}); export it again") from error


def add_metadata_crc32(folder: Path) -> None:
    """Write the CRC-32 of the consolidated metadata of a store into its zarr.json."""
    file = folder / "zarr.json"
    metadata = json.loads(file.read_text(encoding="utf-8"))
    _get_truth_attributes(metadata)[_CRC] = _compute_crc32(metadata)
    file.write_text(json.dumps(metadata, indent=2), encoding="utf-8", newline="\n")


def _check_metadata(path: Path) -> None:
    """Raise a `ValueError` where the metadata of a store differ from their checksum; older stores have none."""
    metadata = json.loads((path / "zarr.json").read_text(encoding="utf-8"))
    if "consolidated_metadata" in metadata:
        stated = _get_truth_attributes(metadata).pop(_CRC, None)
        if stated is not None and stated != _compute_crc32(metadata):
            raise ValueError(f"metadata in zarr.json differ from their checksum {_CRC}")


def _get_truth_attributes(metadata: dict[str, Any]) -> dict[str, Any]:
    """Return the attributes of /truth in the consolidated metadata of a store."""
    attributes: dict[str, Any] = metadata["consolidated_metadata"]["metadata"]["truth"]["attributes"]
    return attributes


def _compute_crc32(metadata: dict[str, Any]) -> int:
    return zlib.crc32(json.dumps(metadata, sort_keys=True).encode())


def _check_chunks(path: Path, name: str, array: Any) -> None:
    """Raise a `RecordingError` where a chunk of an array is missing: Zarr would read it as fill values."""
    held = array.shards or array.chunks
    wanted = math.prod(-(-side // chunk) for side, chunk in zip(array.shape, held, strict=True))
    there = sum(1 for file in (path / name / "c").rglob("*") if file.is_file()) if array.shape else wanted
    if there < wanted:
        raise RecordingError(f"{path}: {name} lacks {wanted - there} of {wanted} chunks; export it again")
