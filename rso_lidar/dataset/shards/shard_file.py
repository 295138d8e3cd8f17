"""One shard: an HDF5 file in which every array has the frame as its first dimension."""

from __future__ import annotations

import hashlib
import os
import sys
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from rso_lidar.dataset.shards.layout import VARIABLE_PREFIX, LabelledFrame, describe_array
from rso_lidar.dataset.specification.tables import SPLITS
from rso_lidar.errors import DatasetError
from rso_lidar.export import ImageEncoder, open_checked
from rso_lidar.files import check_regular, explain_unreadable, write_atomically
from rso_lidar.records import specs

CONVENTIONS = "rso_lidar dataset 1"
_IMAGE_DIMENSIONS = 2
_BLOCK = 2**20  # bytes of a file that are read at once


def write_shard(
    path: Path,
    frames: Iterable[LabelledFrame],
    variables: Sequence[Mapping[str, float]],
    names: Sequence[str],
    *,
    dataset: str,
) -> None:
    """Write a shard, completely or not at all. Equal frames give equal bytes.

    Parameters
    ----------
    path : of the file; an existing one is replaced
    variables : (frame) drawn numbers by name
    names : of all numbers that the dataset draws
    dataset : hash of the dataset that the shard belongs to
    """
    rows = list(frames)
    arrays: dict[str, list[np.ndarray]] = {}
    for name in specs(LabelledFrame):
        entries = [getattr(row, name) for row in rows]
        if entries[0] is not None:
            arrays[name] = entries
    for name in names:
        arrays[VARIABLE_PREFIX + name] = list(np.array([variable.get(name, np.nan) for variable in variables], float))
    write_arrays(path, arrays, dataset=dataset)


def write_arrays(path: Path, arrays: Mapping[str, Sequence[np.ndarray]], *, dataset: str) -> None:
    """Write arrays of frames as a shard, completely or not at all.

    Parameters
    ----------
    path : of the file; an existing one is replaced
    arrays : entries (frame) of arrays of `LabelledFrame` and of drawn numbers, by name
    dataset : hash of the dataset that the shard belongs to
    """
    import h5py

    with write_atomically(path, keep_suffix=False) as draft:
        with h5py.File(draft, "w", libver=("v110", "v110")) as file:
            file.attrs["Conventions"] = CONVENTIONS
            file.attrs["dataset_sha256"] = dataset
            for name, entries in arrays.items():
                _write_array(file, name, entries)
        with draft.open("rb") as written:  # before the rename, so that a crash of the machine leaves no partial shard
            os.fsync(written.fileno())


def _write_array(file: Any, name: str, entries: Sequence[np.ndarray]) -> None:
    """Write one array of a shard."""
    spec = describe_array(name)
    if len(spec.dims) == _IMAGE_DIMENSIONS:
        encoder = ImageEncoder(max(entry.nbytes for entry in entries))
        shape = (len(entries), *entries[0].shape)
        options: dict[str, Any] = {"shuffle": True, "compression": "gzip", "compression_opts": 1, "fletcher32": True}
        dataset = file.create_dataset(name, shape, spec.dtype, chunks=(1, *shape[1:]), **options)
        for k, entry in enumerate(entries):
            dataset.id.write_direct_chunk((k, 0, 0), encoder.encode(entry))
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
