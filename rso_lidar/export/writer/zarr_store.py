"""Recordings as Zarr v3 stores, with the names, dtypes and attributes of the HDF5 layout.

A chunk is one frame, and a shard (one file) holds up to 100 of them. The store is a folder, written completely or not
at all. It suits object stores and many parallel readers.
"""

from __future__ import annotations

import json
import os
import warnings
from collections.abc import Iterable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from rso_lidar.errors import RecordingError, RunError
from rso_lidar.export.layout import intermediates
from rso_lidar.export.layout.attributes import (
    SCALES,
    get_array_attributes,
    get_group_attributes,
    get_root_attributes,
    get_scale_meaning,
    get_sensor_attributes,
)
from rso_lidar.export.layout.datasets import LENS, Variable, get_parents, list_optional, list_variables
from rso_lidar.export.reader.zarr_file import add_metadata_crc32, open_zarr
from rso_lidar.export.writer.folders import check_export_folder, draft_export_folder
from rso_lidar.export.writer.frame_stream import count_frame_bytes, match_entries, pad_all, take_first, to_json
from rso_lidar.export.writer.lens_tables import LensNumbers
from rso_lidar.records import Frame, Observation, specs

FRAMES_PER_SHARD = 100
MOST_BATCH_BYTES = 2**28  # a shard is held in memory until it is full; with waveforms kept it has fewer frames


def write_zarr(path: str | os.PathLike[str], frames: Iterable[Frame], *, overwrite: bool = False) -> Path:
    """Write frames to a Zarr store, shard by shard, and return its path."""
    zarr = _import_zarr(path)
    place = check_export_folder(path, overwrite=overwrite)
    first, coming = take_first(place, frames)
    with draft_export_folder(place, overwrite=overwrite) as draft:
        store = ZarrWriter(zarr, place, draft, first)
        for frame in coming:
            store.add(frame)
        store.finish()
    return place


_ALL_CHUNKS = {"write_empty_chunks": True}  # so that a chunk that is not there is one that was lost


def _import_zarr(path: str | os.PathLike[str]) -> Any:
    """Import the library, or raise a `RecordingError` that names the extra to install."""
    try:
        import zarr
    except ImportError:
        raise RecordingError(f"{path}: Zarr needs an extra: pip install rso-lidar[zarr], or write .h5") from None
    return zarr


class ZarrWriter:
    """A Zarr store that grows by complete shards."""

    def __init__(self, zarr: Any, place: Path, folder: Path, first: Frame) -> None:
        """Create the store and its arrays."""
        self._zarr, self._place, self._folder, self._first = zarr, place, folder, first
        self._variables = list_variables(first)
        self._per_shard = int(np.clip(MOST_BATCH_BYTES // count_frame_bytes(self._variables), 1, FRAMES_PER_SHARD))
        self._waiting: dict[str, list[np.ndarray]] = {name: [] for name in self._variables}
        self._written = 0
        self._lenses = LensNumbers()
        self._numbers: list[int] = []  # of the line of sight of each frame
        self._root = zarr.open_group(folder, mode="a", zarr_format=3)  # "w" would make the folder anew
        self._root.attrs.update(to_json(get_root_attributes(first.source) | get_sensor_attributes(first)))
        self._arrays = {name: self._array(variable) for name, variable in self._variables.items()}
        for name, parent in get_parents(first).items():
            self._root[f"truth/{name}"].attrs["parent"] = parent
        self._root["truth"].attrs.update(
            {"tree": json.dumps(get_parents(first)), "states": json.dumps(list(first.truth.states))}
        )
        for group, held in (intermediates.get_constants(first.kept) | get_group_attributes(first)).items():
            self._root[group].attrs.update(held)

    def add(self, frame: Frame) -> None:
        """Add one frame; write the shard when it is full."""
        for name, value in match_entries(self._place, frame, self._first, self._variables).items():
            self._waiting[name].append(value)
        count = len(self._lenses)
        self._numbers.append(self._lenses.number(frame.line_of_sight))
        if len(self._lenses) > count:
            self._add_sight(frame.line_of_sight)
        if len(self._waiting["time"]) == self._per_shard:
            self._flush()

    def finish(self) -> None:
        """Write the last shard, the scales, /lens if the lens changed, and the metadata; then check the store."""
        self._flush()
        self._scales()
        changed = len(self._lenses) > 1
        if changed:
            numbers = np.array(self._numbers, LENS.dtype)
            self._array(Variable("lens", LENS, ()))
            self._resized("lens", len(numbers))[:] = numbers
        self._root.attrs["optional_datasets"] = json.dumps([*list_optional(self._first), *["lens"] * changed])
        with (
            warnings.catch_warnings()
        ):  # all metadata in one file: not yet in the specification, and others may ignore it
            warnings.simplefilter("ignore")
            self._zarr.consolidate_metadata(self._root.store)
        try:
            add_metadata_crc32(self._folder)
            written = open_zarr(self._folder)["time"].shape[0]
        except (RecordingError, KeyError, ValueError) as error:
            raise RunError(f"{self._place}: not written: the store cannot be read back ({error}); run again") from error
        if written != self._written:
            raise RunError(f"{self._place}: not written: the store has {written} of {self._written} frames; run again")

    # ------------------------------------------------------------------------------------------------------ the inside

    def _array(self, variable: Variable) -> Any:
        """Create an empty array."""
        stated = {"dtype": variable.spec.dtype, "dims": ("time", *variable.spec.dims), "fill": variable.fill}
        attributes = get_array_attributes(variable, self._first.source)
        if variable.fill is not None and variable.spec.dtype.kind == "i":
            attributes["_FillValue"] = variable.fill
        chunk = (1 if variable.is_image else FRAMES_PER_SHARD, *variable.shape)
        shard = (self._per_shard, *variable.shape) if variable.is_image else None
        return self._create(variable.path, (0, *variable.shape), chunk, shard, stated, attributes)

    def _create(
        self,
        path: str,
        shape: tuple[int, ...],
        chunk: tuple[int, ...],
        shard: tuple[int, ...] | None,
        stated: Mapping[str, Any],
        attributes: Mapping[str, Any],
    ) -> Any:
        """Create an empty array.

        Parameters
        ----------
        shape, chunk, shard : sizes along its dimensions; without shard, each chunk is a file
        """
        *groups, name = path.split("/")
        place = self._root
        for group in groups:
            place = place.require_group(group)
        return place.create_array(
            name,
            shape=shape,
            chunks=chunk,
            shards=shard,
            dtype=stated["dtype"],
            fill_value=0 if stated["fill"] is None else stated["fill"],
            compressors=[
                self._zarr.codecs.BloscCodec(cname="zstd", clevel=5, shuffle="shuffle"),
                self._zarr.codecs.Crc32cCodec(),
            ],
            dimension_names=stated["dims"],
            attributes=to_json(attributes),
            config=_ALL_CHUNKS,
        )

    def _scales(self) -> None:
        """Write the coordinates of rows, columns and other counted dimensions."""
        sizes = {"row": self._first.range_m.shape[0], "col": self._first.range_m.shape[1]}
        for variable in self._variables.values():
            group = variable.path.rpartition("/")[0]
            own = zip(variable.spec.dims, variable.shape, strict=True)
            common = (
                ("xyz", "quaternion") if variable.is_series else ("row", "col", *set(variable.spec.dims) - {*SCALES})
            )
            sizes |= {f"{group}/{dim}": size for dim, size in own if dim not in common}
        for path, size in sizes.items():
            dim = path.rpartition("/")[2]
            stated = {"dtype": np.dtype("i4"), "dims": (dim,), "fill": None}
            array = self._create(
                path, (size,), (size,), None, stated, {"units": "1", "long_name": get_scale_meaning(path)}
            )
            array[:] = np.arange(size, dtype="i4")

    def _add_sight(self, line_of_sight: np.ndarray) -> None:
        """Write a line of sight: a single one as (row, col, xyz), several as (lens_number, row, col, xyz)."""
        spec, count, shape = specs(Observation)["line_of_sight"], len(self._lenses), line_of_sight.shape
        attributes = {"units": spec.unit, "long_name": spec.meaning}
        if count == 1:
            stated = {"dtype": spec.dtype, "dims": spec.dims, "fill": np.nan}
            self._create("line_of_sight", shape, shape, None, stated, attributes)[:] = line_of_sight
            return
        if count == 2:
            alone = self._root["line_of_sight"][:]
            del self._root["line_of_sight"]
            stated = {"dtype": spec.dtype, "dims": ("lens_number", *spec.dims), "fill": np.nan}
            self._create("line_of_sight", (1, *shape), (1, *shape), None, stated, attributes)[0] = alone
        self._resized("line_of_sight", count)[count - 1] = line_of_sight

    def _resized(self, path: str, count: int) -> Any:
        """Resize an array to a number of entries and return it."""
        array = self._root[path].with_config(_ALL_CHUNKS)
        array.resize((count, *array.shape[1:]))
        return array

    def _flush(self) -> None:
        """Write the pending frames: a full shard, or the last one."""
        count = len(self._waiting["time"])
        for name, column in self._waiting.items():
            if count:
                if self._variables[name].is_series:
                    self._make_room(name, max(map(len, column)))
                    column = pad_all(column, self._variables[name])
                array, end = self._arrays[name], self._written + count
                array.resize((end, *array.shape[1:]))
                array[self._written : end] = np.stack(column)
                self._waiting[name].clear()
        self._written += count

    def _make_room(self, name: str, count: int) -> None:
        """Write an array of samples anew where its entries have no room for so many samples."""
        variable = self._variables[name]
        if count <= variable.shape[0]:
            return
        written = self._root[name][:]
        variable = self._variables[name] = replace(variable, shape=(count + 1, *variable.shape[1:]))
        del self._root[name]
        self._arrays[name] = self._array(variable)
        if len(written):
            self._resized(name, len(written))[:] = np.stack(pad_all(written, variable))
