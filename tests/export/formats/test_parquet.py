"""Tables as Parquet, read back by pyarrow."""

import sys

import numpy as np
import pytest

from rso_lidar.errors import RecordingError
from rso_lidar.export import write_parquet

TABLE = {"row": np.arange(3), "x_m": np.array([0.1, np.nan, -3.0]), "why": np.array(["", "a, b", "ü"])}


def test_columns_come_back(tmp_path):
    parquet = pytest.importorskip("pyarrow.parquet", reason="needs the extra parquet: pip install 'rso-lidar[parquet]'")
    path = write_parquet(tmp_path / "t.parquet", TABLE, {"study": "asked"})
    read = parquet.read_table(path)
    assert read.schema.metadata[b"study"] == b"asked"
    assert [str(kind) for kind in read.schema.types] == ["int64", "double", "string"]
    for name, values in TABLE.items():
        assert repr(read[name].to_pylist()) == repr(values.tolist())


def test_without_the_library_the_extra_is_named(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    monkeypatch.setitem(sys.modules, "pyarrow.parquet", None)
    with pytest.raises(RecordingError, match=r"pip install rso-lidar\[parquet\]"):
        write_parquet(tmp_path / "t.parquet", TABLE, {})
    assert not list(tmp_path.iterdir())
