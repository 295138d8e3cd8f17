"""The table of frames, `index.parquet`: one row per frame, for viewers and for choosing frames without opening shards."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from rso_lidar.dataset.shards.layout import describe_array, is_image
from rso_lidar.files import write_atomically
from rso_lidar.records import ArraySpec

if TYPE_CHECKING:
    from rso_lidar.dataset.reading.random_access import Dataset, Split

INDEX = "index.parquet"
ROWS_PER_GROUP = 65_536  # some 20 MB in memory, and 1,500 groups at 10^8 frames
NAMES = {  # columns beside those of the shards
    "split": "split that the frame belongs to",
    "shard": "path of the shard that holds the frame",
    "row": "place of the frame in its shard",
    "class": "name of the class, null without a target",
    "model": "name of the model, null without a target",
    "sensor": "name of the sensor",
}


def has_parquet() -> bool:
    """Return whether the library that writes Parquet is installed."""
    try:
        import pyarrow.parquet  # noqa: F401
    except ImportError:
        return False
    return True


def list_index_columns(data: Dataset) -> dict[str, ArraySpec]:
    """Return dtype, unit and meaning of each column that comes from the shards, by name."""
    return {name: describe_array(name) for name in data.split(data.splits[0]).names if not is_image(name)}


def write_frame_index(data: Dataset) -> Path:
    """Write the table of frames into the folder of a dataset, at constant memory, and return its path."""
    import pyarrow
    import pyarrow.parquet

    place = data.folder / INDEX
    columns = list_index_columns(data)
    schema = _make_schema(data, columns)
    with (
        write_atomically(place, keep_suffix=False) as draft,
        pyarrow.parquet.ParquetWriter(draft, schema, compression="zstd") as writer,
    ):
        waiting: list[Any] = []
        for table in _read_tables(data, list(columns), schema):
            waiting.append(table)
            if sum(map(len, waiting)) >= ROWS_PER_GROUP:
                writer.write_table(pyarrow.concat_tables(waiting), ROWS_PER_GROUP)
                waiting = []
        if waiting:
            writer.write_table(pyarrow.concat_tables(waiting), ROWS_PER_GROUP)
    return place


def _make_schema(data: Dataset, columns: dict[str, ArraySpec]) -> Any:
    """Return the Arrow schema of the table, with units and meanings as metadata of its fields."""
    import pyarrow

    texts = pyarrow.dictionary(pyarrow.int32(), pyarrow.string())
    fields = [
        pyarrow.field(name, pyarrow.int32() if name == "row" else texts, metadata={"long_name": meaning})
        for name, meaning in NAMES.items()
    ]
    first = data.split(data.splits[0])[0]
    for name, spec in columns.items():
        number = pyarrow.from_numpy_dtype(spec.dtype)
        size = first[name].shape
        kind = pyarrow.list_(number, size[0]) if size else number
        fields.append(pyarrow.field(name, kind, metadata={"units": spec.unit, "long_name": spec.meaning}))
    return pyarrow.schema(fields, metadata={"title": data.spec.name})


def _read_tables(data: Dataset, columns: list[str], schema: Any) -> Iterator[Any]:
    """Yield an Arrow table for each shard."""
    import pyarrow

    lists = {"class": data.classes, "model": data.models, "sensor": data.sensors}
    for name in data.splits:
        split: Split = data.split(name)
        for shard, record in enumerate(split.records):
            arrays = split.read_shard(shard, columns)
            count = record.frames
            table: dict[str, Any] = {
                "split": _repeat(name, count),
                "shard": _repeat(record.path, count),
                "row": pyarrow.array(np.arange(count, dtype=np.int32)),
            }
            table |= {word: _take_names(names, arrays[f"{word}_id"]) for word, names in lists.items()}
            for column, values in arrays.items():
                flat = pyarrow.array(np.ascontiguousarray(values).ravel())
                of_list = schema.field(column).type
                table[column] = flat if values.ndim == 1 else pyarrow.FixedSizeListArray.from_arrays(flat, type=of_list)
            yield pyarrow.table([table[field.name] for field in schema], schema=schema)


def _repeat(text: str, count: int) -> Any:
    """Return a column that repeats one text."""
    import pyarrow

    return pyarrow.DictionaryArray.from_arrays(np.zeros(count, np.int32), [text])


def _take_names(names: tuple[str, ...], numbers: np.ndarray) -> Any:
    """Return a column of names; null for negative numbers."""
    import pyarrow

    places = pyarrow.array(numbers.astype(np.int32), mask=numbers < 0)
    return pyarrow.DictionaryArray.from_arrays(places, pyarrow.array(names, pyarrow.string()))
