"""One shard: an HDF5 file in which every array has the frame as its first dimension."""

from __future__ import annotations

import hashlib
import os
import sys
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from rso_lidar.dataset.shards.layout import VARIABLE_PREFIX, LabelledFrame, describe_array, is_image, list_entries
from rso_lidar.dataset.specification.tables import SPLITS
from rso_lidar.errors import DatasetError
from rso_lidar.export import ImageEncoder, open_checked
from rso_lidar.files import check_regular, explain_unreadable, write_atomically

CONVENTIONS = "rso_lidar dataset 1"
_BLOCK = 2**20  # bytes of a file that are read at once


def write_shard(
    path: Path, frames: Iterable[tuple[LabelledFrame, Mapping[str, float]]], names: Sequence[str], *, dataset: str
) -> int:
    """Write a shard, completely or not at all, and return the number of its frames. Equal frames give equal bytes.

    Parameters
    ----------
    path : of the file; an existing one is replaced
    frames : each frame with its drawn numbers by name. Only the compressed images of the frames are kept in memory
    names : of all numbers that the dataset draws
    dataset : hash of the dataset that the shard belongs to
    """
    columns = _ShardArrays()
    count = 0
    for frame, drawn in frames:
        count += 1
        columns.add(list_entries(frame))
        columns.add({VARIABLE_PREFIX + name: np.array(drawn.get(name, np.nan), float) for name in names})
    columns.write(path, dataset)
    return count


def write_arrays(path: Path, arrays: Mapping[str, Sequence[np.ndarray]], *, dataset: str) -> None:
    """Write arrays of frames as a shard, completely or not at all.

    Parameters
    ----------
    path : of the file; an existing one is replaced
    arrays : entries (frame) of arrays of `LabelledFrame`, of `LabelledImage` and of drawn numbers, by name
    dataset : hash of the dataset that the shard belongs to
    """
    columns = _ShardArrays()
    for name, entries in arrays.items():
        for entry in entries:
            columns.add({name: entry})
    columns.write(path, dataset)


class _ShardArrays:
    """Arrays of a shard that grow by an entry for each frame. Images are kept as the file holds them, compressed."""

    def __init__(self) -> None:
        self._entries: dict[str, list[Any]] = {}
        self._shapes: dict[str, tuple[int, ...]] = {}  # of each image
        self._encoders: dict[int, ImageEncoder] = {}  # by the bytes of an image

    def add(self, entries: Mapping[str, Any]) -> None:
        """Add an entry to some arrays, by name."""
        for name, entry in entries.items():
            stored = self._encode(name, entry) if is_image(name) else entry
            self._entries.setdefault(name, []).append(stored)

    def _encode(self, name: str, entry: np.ndarray) -> bytes:
        """Encode an image as a chunk of the file."""
        image = np.ascontiguousarray(entry, describe_array(name).dtype)
        if self._shapes.setdefault(name, image.shape) != image.shape:
            raise DatasetError(f"{name}: has images of {self._shapes[name]} and of {image.shape}; take one size")
        if image.nbytes not in self._encoders:
            self._encoders[image.nbytes] = ImageEncoder(image.nbytes)
        return self._encoders[image.nbytes].encode(image).tobytes()

    def write(self, path: Path, dataset: str) -> None:
        """Write the file of a shard, completely or not at all; `dataset` is the hash of its dataset."""
        import h5py

        with write_atomically(path, keep_suffix=False) as draft:
            with h5py.File(draft, "w", libver=("v110", "v110")) as file:
                file.attrs["Conventions"] = CONVENTIONS
                file.attrs["dataset_sha256"] = dataset
                for name, entries in self._entries.items():
                    _write_array(file, name, entries, self._shapes.get(name))
            with draft.open(
                "rb"
            ) as written:  # before the rename, so that a crash of the machine leaves no partial shard
                os.fsync(written.fileno())


def _write_array(file: Any, name: str, entries: Sequence[Any], shape: tuple[int, ...] | None) -> None:
    """Write one array of a shard.

    Parameters
    ----------
    entries : (frame) numbers or short vectors, or encoded images
    shape : of an image; None for an array of numbers
    """
    spec = describe_array(name)
    if shape is not None:
        options: dict[str, Any] = {"shuffle": True, "compression": "gzip", "compression_opts": 1, "fletcher32": True}
        dataset = file.create_dataset(name, (len(entries), *shape), spec.dtype, chunks=(1, *shape), **options)
        for k, entry in enumerate(entries):
            dataset.id.write_direct_chunk((k, *(0,) * len(shape)), entry)
    else:
        values = np.array(entries, spec.dtype)
        dataset = file.create_dataset(name, data=values, chunks=values.shape, fletcher32=True)
    dataset.flush()  # allocates the chunks now: the time at which Python closes the dataset would change the bytes
    dataset.attrs["units"] = spec.unit
    dataset.attrs["long_name"] = spec.meaning
    dataset.attrs["dims"] = " ".join(("frame", *spec.dims))


def open_shard(path: Path, dataset: str | None, cache_bytes: int = sys.maxsize) -> Any:
    """Open a shard with h5py to read.

    Parameters
    ----------
    dataset : hash of the dataset that it must belong to; None for one that was checked before
    cache_bytes : of chunks, which are frames, that libhdf5 keeps for each array [bytes], at most 1 MiB

    Raises
    ------
    DatasetError
        If the file is absent, damaged, or of another dataset.
    """
    if path.exists():
        check_regular(path, sys.maxsize, DatasetError, "shard")
    try:
        file = open_checked(path, cache_bytes=cache_bytes)
        sha256 = None if dataset is None else file.attrs.get("dataset_sha256")
    except FileNotFoundError:
        raise DatasetError(f"{path}: the shard is missing; run `rso-lidar dataset make` again with --resume") from None
    except (OSError, KeyError, ValueError, RuntimeError) as error:  # h5py raises any of them
        if isinstance(error, OSError) and error.errno:
            raise DatasetError(explain_unreadable(path, error)) from None
        raise DatasetError(
            f"{path}: is not a readable shard ({' '.join(str(error).split()):.120}); delete it and make the dataset again"
        ) from None
    if sha256 != dataset:
        file.close()
        raise DatasetError(f"{path}: belongs to another dataset; move it away")
    return file


def list_drafts(folder: Path) -> list[Path]:
    """List the temporary files of shards that running or killed runs have left in the folder of a dataset."""
    # .part.h5 is the name that earlier versions gave them
    return sorted(
        draft
        for split in SPLITS
        for pattern in ("*.h5.part*", "*.part*.h5")
        for draft in (folder / split).glob(pattern)
    )


def hash_file(path: Path) -> str:
    """Return the SHA-256 of a file."""
    digest = hashlib.sha256()
    with path.open("rb") as stream:
        while block := stream.read(_BLOCK):
            digest.update(block)
    return digest.hexdigest()
