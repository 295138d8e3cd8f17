"""Files of predictions: CSV, Parquet, NPZ and HDF5, read as columns of one row per frame."""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from rso_lidar.errors import DatasetError, did_you_mean
from rso_lidar.export import check_declared_size, open_checked
from rso_lidar.files import check_regular, describe_size, expand_user, read_arrays, read_text

SUFFIXES = (".csv", ".parquet", ".npz", ".h5", ".hdf5")
IDENTITY = "dataset"  # name under which a file carries the identity of the dataset that it is about
PIXELS = ("part_class_id", "oversampled_range_m", "oversampled_photons")
_PARQUET_BYTES = 8  # of a value, which may be stored in a fraction of a bit
_VECTORS = {"position_m": ("x_m", "y_m", "z_m"), "quaternion_xyzw": ("qx", "qy", "qz", "qw")}
_MOST_MEMORY_BYTES = 2**30  # of a CSV or NPZ file, and of the columns of HDF5; images in HDF5 are read in parts
_SPARE_BYTES = 2**22  # beside the columns that are known, such as columns that are ignored
_MOST_BYTES = 2**38


class PredictionLimits(NamedTuple):
    """The most that predictions for a dataset hold: rows, and bytes of memory for all columns that are read at once."""

    rows: int
    size_bytes: int

    @staticmethod
    def of(rows: int, row_bytes: int) -> PredictionLimits:
        """Return the limits of predictions for some frames."""
        return PredictionLimits(rows, min(rows * row_bytes + _SPARE_BYTES, _MOST_MEMORY_BYTES))


_WIDEST_LIMITS = PredictionLimits(2**40, _MOST_MEMORY_BYTES)


def read_columns(path: Path, most: PredictionLimits = _WIDEST_LIMITS) -> tuple[dict[str, Any], str]:
    """Read the columns of a file of predictions.

    Parameters
    ----------
    most : that the file may hold; more is refused before memory is taken for it

    Returns
    -------
    Columns by name, with the frame as first axis, and the identity of the dataset that the file states, or an empty text.
    Vectors and score matrices are split into columns; arrays of pixels are kept whole, and those of HDF5 are read later.

    Raises
    ------
    DatasetError
        If the file cannot be read, or its columns differ in length.
    """
    path = expand_user(path)
    suffix = path.suffix.lower()
    if suffix not in SUFFIXES:
        guess = did_you_mean(suffix, SUFFIXES)
        raise DatasetError(f"{path}: unknown suffix '{path.suffix}'{guess} (known: {', '.join(SUFFIXES)})")
    if suffix == ".csv":
        columns, identity = _read_csv(path, most)
    else:
        check_regular(path, _MOST_BYTES, DatasetError, "file of predictions")
        readers = {".parquet": _read_parquet, ".npz": _read_npz}
        columns, identity = readers.get(suffix, _read_hdf5)(path, most)
    columns = _split_vectors(path, columns)
    sizes = {name: np.shape(values)[0] if np.ndim(values) else -1 for name, values in columns.items()}
    first = next(iter(sizes), "")
    for name, size in sizes.items():
        if size != sizes[first] or size < 0:
            raise DatasetError(
                f"{path}: {name} has {max(size, 0):,} rows and {first} has {max(sizes[first], 0):,}; give one row for each "
                "frame"
            )
    return columns, identity


def _read_csv(path: Path, most: PredictionLimits) -> tuple[dict[str, Any], str]:
    """Read a CSV file; lines that start with # are comments, one of which may state the dataset."""
    lines = read_text(path, most.size_bytes, DatasetError, "file of predictions for this dataset").splitlines(
        keepends=True
    )
    identity = ""
    for line in lines:
        if line.startswith("#") and line[1:].strip().startswith(f"{IDENTITY}:"):
            identity = line.partition(":")[2].strip()
    try:
        rows = list(csv.reader(io.StringIO("".join(line for line in lines if not line.startswith("#"))), strict=True))
    except csv.Error as error:
        raise DatasetError(f"{path}: is not CSV ({error}); write commas between cells") from None
    rows = [row for row in rows if row]
    if not rows:
        raise DatasetError(f"{path}: is empty; write a line of column names and one line for each frame")
    names = [name.strip() for name in rows[0]]
    twice = [name for name in names if names.count(name) > 1]
    if twice:
        raise DatasetError(f"{path}: the column '{twice[0]}' stands there twice; remove one")
    for number, row in enumerate(rows[1:], 2):
        if len(row) != len(names):
            raise DatasetError(
                f"{path}: row {number} has {len(row)} cells, and the heading names {len(names)} columns; complete it"
            )
    cells = list(zip(*rows[1:], strict=True)) or [()] * len(names)
    return {name: np.array(column, dtype=str) for name, column in zip(names, cells, strict=True)}, identity


def _read_parquet(path: Path, most: PredictionLimits) -> tuple[dict[str, Any], str]:
    """Read a Parquet file, whose metadata may state the dataset."""
    try:
        import pyarrow
        import pyarrow.parquet
    except ImportError:
        raise DatasetError(f"{path}: Parquet needs an extra: pip install rso-lidar[parquet], or write .csv") from None
    try:
        _check_parquet(path, pyarrow.parquet.read_metadata(path), most)
        table = pyarrow.parquet.read_table(path)
        columns = {name: np.array(table.column(name).to_pylist()) for name in table.column_names}
    except DatasetError:
        raise
    except (pyarrow.ArrowException, OSError, ValueError) as error:
        raise DatasetError(f"{path}: is not a Parquet table ({_first_line(error)}); write it again") from None
    identity = (table.schema.metadata or {}).get(IDENTITY.encode(), b"")
    return columns, identity.decode("utf-8", "replace")


def _read_npz(path: Path, most: PredictionLimits) -> tuple[dict[str, Any], str]:
    """Read arrays that `numpy.savez` wrote."""
    columns: dict[str, Any] = dict(read_arrays(path, DatasetError, most_bytes=most.size_bytes))
    return columns, str(columns.pop(IDENTITY, ""))


def _read_hdf5(path: Path, most: PredictionLimits) -> tuple[dict[str, Any], str]:
    """Read the datasets of an HDF5 file; arrays of pixels are kept open and read when they are scored."""
    import h5py

    try:
        file = open_checked(path)
        columns: dict[str, Any] = {}
        left = most.size_bytes
        for name, member in file.items():
            if isinstance(member, h5py.Dataset):
                check_declared_size(member)
                _check_rows(path, name, member.shape[0] if member.shape else 0, most)
                left -= 0 if name in PIXELS else member.nbytes
                if left < 0:
                    raise _make_size_error(path, name, most)
                is_text = h5py.check_string_dtype(member.dtype) is not None
                columns[name] = member if name in PIXELS else member.asstr()[()] if is_text else member[()]
        return columns, str(file.attrs.get(IDENTITY, ""))
    except DatasetError:
        raise
    except (OSError, RuntimeError, KeyError, TypeError, ValueError) as error:  # of h5py, and of texts in another code
        raise DatasetError(
            f"{path}: is not an HDF5 file of numbers and texts, or is damaged ({_first_line(error)}); write it again"
        ) from None


def _check_parquet(path: Path, metadata: Any, most: PredictionLimits) -> None:
    """Check the rows of a Parquet file, and the values of each column, before they are decompressed."""
    _check_rows(path, "the table", metadata.num_rows, most)
    left = most.size_bytes
    for group in range(metadata.num_row_groups):
        for place in range(metadata.num_columns):
            column = metadata.row_group(group).column(place)
            left -= max(_PARQUET_BYTES * column.num_values, column.total_uncompressed_size)
            if left < 0:
                raise _make_size_error(path, column.path_in_schema, most)


def _check_rows(path: Path, name: str, rows: int, most: PredictionLimits) -> None:
    """Raise `DatasetError` if a column has more rows than the dataset has frames."""
    if rows > most.rows:
        raise DatasetError(
            f"{path}: {name} has {rows:,} rows, and the dataset {most.rows:,} frames; give one row for each"
        )


def _make_size_error(path: Path, name: str, most: PredictionLimits) -> DatasetError:
    """Return the error for columns that are larger than predictions can be."""
    return DatasetError(
        f"{path}: has columns of more than {describe_size(most.size_bytes)}, {name} among them; give the columns that are "
        "scored, one row for each frame"
    )


def _split_vectors(path: Path, columns: Mapping[str, Any]) -> dict[str, Any]:
    """Split positions, quaternions and matrices of scores into columns."""
    split_columns = dict(columns)
    for name, parts in _VECTORS.items():
        if name in split_columns:
            values = np.asarray(split_columns.pop(name))
            if values.ndim != 2 or values.shape[1] != len(parts):
                raise DatasetError(f"{path}: {name} has shape {values.shape}; give (frame, {len(parts)})")
            split_columns |= {part: values[:, k] for k, part in enumerate(parts)}
    if "scores" in split_columns:
        values, classes = (
            np.asarray(split_columns.pop("scores")),
            np.asarray(split_columns.pop("classes", ())).astype(str),
        )
        if values.ndim != 2 or values.shape[1] != len(classes):
            raise DatasetError(
                f"{path}: scores has shape {values.shape} with {len(classes)} names in classes; give (frame, class) and "
                "the name of each class"
            )
        split_columns |= {f"score.{name}": values[:, k] for k, name in enumerate(classes.tolist())}
    return split_columns


def _first_line(error: BaseException) -> str:
    """Return the first line of an error's text."""
    return (str(error).splitlines() or [type(error).__name__])[0][:160]
