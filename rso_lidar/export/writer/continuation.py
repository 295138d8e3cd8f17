"""Frames of an interrupted run, copied to the new file in which the run continues."""

from __future__ import annotations

from collections.abc import Collection
from typing import Any

from rso_lidar.errors import RecordingError
from rso_lidar.export.layout.checksum import is_intact
from rso_lidar.export.layout.sensor_samples import GROUP, is_series, pad
from rso_lidar.export.reader.recording import Recording
from rso_lidar.export.writer.lens_tables import LensTables


def copy_frames(file: Any, old: Recording, paths: Collection[str]) -> None:
    """Copy the complete frames of datasets as stored chunks, after verifying their checksums.

    Parameters
    ----------
    file : h5py file that has the same datasets, empty
    paths : of the datasets to copy; each has one chunk for each frame

    Raises
    ------
    RecordingError
        If a dataset is stored in another way in the old recording, or one of its checksums is wrong.
    """
    for path in sorted(paths):
        have, make, count = old.handle(path), file[path], len(old)
        if is_series(path) and have.shape[1] < make.shape[1]:
            _copy_samples(make, old, path)
            continue
        if _get_layout(have) != _get_layout(make):
            raise RecordingError(f"{old.path}: {path} is stored in another way; give --overwrite to start again")
        make.resize(count, axis=0)
        for k in range(count):
            place = (k, *(0,) * (make.ndim - 1))
            with old.watched(path):
                mask, chunk = have.id.read_direct_chunk(place)
                if mask or not is_intact(chunk) or not any(chunk[:2]):  # a zlib stream never begins with zeros
                    raise ValueError(f"the checksum of frame {k} is wrong")
            make.id.write_direct_chunk(place, chunk)


def _copy_samples(make: Any, old: Recording, path: str) -> None:
    """Copy the samples of a sensor to longer entries."""
    make.resize(len(old), axis=0)
    for k in range(len(old)):
        make[k] = pad(old.read(path, k), make.shape[1], make.fillvalue)


def get_capacities(old: Recording | None) -> dict[str, int]:
    """Return for how many samples of each sensor the entries of a recording have room; none without a recording."""
    return {} if old is None else {name: old.handle(f"{GROUP}/{name}/time_s").shape[1] for name in old.sensors}


def copy_lenses(file: Any, old: Recording, lenses: LensTables) -> None:
    """Copy the lines of sight of complete frames, and the number of each frame's.

    Parameters
    ----------
    file : h5py file with an empty dataset /lens
    lenses : tables of `file`; the lines of sight are added to them
    """
    tables = old.line_of_sight if old.changes_lens else old.line_of_sight[None]
    numbers = [lenses.number(table) for table in tables]
    file["lens"].resize(len(old), axis=0)
    file["lens"][:] = old.lens[:] if old.changes_lens else numbers[0]


def _get_layout(dataset: Any) -> tuple[Any, ...]:
    """Return the properties that two datasets must share for stored chunks to be copied."""
    filters = (dataset.compression, dataset.shuffle, dataset.fletcher32)
    return (dataset.shape[1:], dataset.dtype, dataset.chunks, filters)
