"""Tables as Parquet files, for data frames."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from rso_lidar.errors import RecordingError
from rso_lidar.files import write_atomically


def check_parquet(place: Path) -> None:
    """Check that the library that writes Parquet is installed, before work begins.

    Parameters
    ----------
    place : of the output, for messages

    Raises
    ------
    RecordingError
        If the extra ``parquet`` is not installed.
    """
    try:
        import pyarrow.parquet  # noqa: F401
    except ImportError:
        raise RecordingError(
            f"{place}: Parquet needs an extra: pip install rso-lidar[parquet], or write .csv"
        ) from None


def write_parquet(place: Path, table: Mapping[str, np.ndarray], metadata: Mapping[str, str]) -> Path:
    """Write a Parquet file, completely or not at all.

    Parameters
    ----------
    place : of the file
    table : (row) columns by name
    metadata : texts by name

    Returns
    -------
    Path
        Of the file.

    Raises
    ------
    RecordingError
        If the extra ``parquet`` is not installed, or the file cannot be written.
    """
    check_parquet(place)
    import pyarrow
    import pyarrow.parquet

    columns: dict[str, Any] = {name: pyarrow.array(values.tolist()) for name, values in table.items()}
    arrow_table = pyarrow.table(columns).replace_schema_metadata(dict(metadata))
    with write_atomically(place) as draft:
        pyarrow.parquet.write_table(arrow_table, draft)
    return place
