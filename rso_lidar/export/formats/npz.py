"""Short recordings as one NPZ of NumPy arrays, named as in the HDF5 layout."""

from __future__ import annotations

import json
import os
import zipfile
import zlib
from collections.abc import Callable, Iterable, Sized
from pathlib import Path
from typing import Any

import numpy as np

from rso_lidar.errors import RecordingError, RunError
from rso_lidar.export.layout.attributes import get_array_attributes, get_root_attributes, get_sensor_attributes
from rso_lidar.export.layout.datasets import LENS, Variable, get_parents, list_variables
from rso_lidar.export.writer.frame_stream import count_frame_bytes, match_entries, take_first, to_json
from rso_lidar.export.writer.lens_tables import LensNumbers
from rso_lidar.files import check_writable, write_atomically
from rso_lidar.records import Frame, Observation, specs

MOST_BYTES = 2_000_000_000


def write_npz(
    path: str | os.PathLike[str], frames: Iterable[Frame], *, overwrite: bool = False, most_bytes: int = MOST_BYTES
) -> Path:
    """Write frames to a compressed NPZ file and return its path; all frames are held in memory.

    Arrays have the names and dtypes of the HDF5 layout (``range``, ``labels/target``, ``truth/tdrs/position``), with
    time as the first dimension. The samples of a sensor are one series (sample, …) without padding. ``attributes`` is a
    JSON text with units, long_name and dims of each array. Its entry ``/`` holds the attributes of the recording, such
    as its pose tree.

    Parameters
    ----------
    most_bytes : greatest size of all arrays before compression [bytes]
    """
    place = check_writable(path, overwrite=overwrite)
    first, coming = take_first(place, frames)
    variables = list_variables(first)
    each = count_frame_bytes(variables)
    total = each * len(frames) if isinstance(frames, Sized) else 0
    columns: dict[str, list[np.ndarray]] = {name: [] for name in variables}
    lenses = LensNumbers()
    numbers: list[int] = []
    tables: list[np.ndarray] = []
    for frame in coming:
        total = max(total, each * (len(columns["time"]) + 1) + sum(table.nbytes for table in tables))
        if total > most_bytes:
            raise RecordingError(
                f"{place}: more than {most_bytes / 1e9:.3g} GB of arrays are too much for one NPZ, which is read as a "
                "whole; write .h5 or .zarr, or choose fewer frames"
            )
        for name, value in match_entries(place, frame, first, variables).items():
            columns[name].append(value)
        numbers.append(lenses.number(frame.line_of_sight))
        if len(lenses) > len(tables):
            tables.append(np.asarray(frame.line_of_sight))
    joins = {name: np.concatenate if variable.is_series else np.stack for name, variable in variables.items()}
    arrays = {name: joins[name](columns.pop(name)) for name in variables}
    if len(lenses) > 1:
        arrays["lens"] = np.array(numbers, LENS.dtype)
    arrays["line_of_sight"] = np.stack(tables) if len(lenses) > 1 else tables[0]
    arrays["attributes"] = np.array(
        json.dumps(_describe_arrays(first, variables, changing=len(lenses) > 1), ensure_ascii=False)
    )
    with write_atomically(place) as draft, draft.open("wb") as stream:
        write: Callable[..., None] = np.savez_compressed
        write(stream, **arrays)  # NumPy 2.1 takes a keyword `allow_pickle` for one more array
        stream.flush()
        _check_archive(place, draft, arrays)
    return place


def _check_archive(place: Path, draft: Path, names: Iterable[str]) -> None:
    """Raise a `RunError` unless all arrays are in the file with correct CRC-32."""
    try:
        with zipfile.ZipFile(draft) as packed:
            wrong = packed.testzip() or ", ".join({f"{name}.npy" for name in names} ^ set(packed.namelist()))
    # zipfile raises RuntimeError where a damaged header names a compression or an encryption that it does not have.
    except (zipfile.BadZipFile, zlib.error, EOFError, RuntimeError) as error:
        wrong = str(error)
    if wrong:
        raise RunError(f"{place}: not written: the file cannot be read back ({wrong}); run again")


def _describe_arrays(first: Frame, variables: dict[str, Variable], *, changing: bool) -> dict[str, Any]:
    """Return the attributes of each array and of the recording, by name, ready for JSON."""
    source = first.source
    root = (
        get_root_attributes(source)
        | get_sensor_attributes(first)
        | {"tree": get_parents(first), "states": list(first.truth.states)}
    )
    described: dict[str, Any] = {"/": {**to_json(root), "targets": json.loads(root["targets"]), "seed": source.seed}}
    for name, variable in variables.items():
        dims = [*["time"] * (not variable.is_series), *variable.spec.dims]
        described[name] = to_json(get_array_attributes(variable, source)) | {"dims": dims}
    sight = specs(Observation)["line_of_sight"]
    dims = ["lens_number"] * changing + list(sight.dims)
    described["line_of_sight"] = {"units": sight.unit, "long_name": sight.meaning, "dims": dims}
    if changing:
        described["lens"] = {"units": LENS.unit, "long_name": LENS.meaning, "dims": ["time"]}
    return described
