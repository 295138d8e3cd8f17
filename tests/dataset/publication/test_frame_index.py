"""The table of frames: a row for each frame, with the values of the shards."""

import numpy as np
import pytest

from rso_lidar.dataset.publication import frame_index
from rso_lidar.dataset.publication.frame_index import INDEX, has_parquet, write_frame_index

parquet = pytest.importorskip("pyarrow.parquet", reason="needs the extra parquet: pip install 'rso-lidar[parquet]'")


def test_rows_are_the_frames_in_order(data):
    assert has_parquet()
    place = write_frame_index(data)
    assert place == data.folder / INDEX
    table = parquet.read_table(place).to_pydict()
    train, test = data.split("train"), data.split("test")
    assert table["split"] == ["train"] * 6 + ["test"] * 4
    assert table["shard"][3:6] == ["train/000000.h5", "train/000001.h5", "train/000001.h5"]
    assert table["row"] == [0, 1, 2, 3, 0, 1, 0, 1, 2, 3]
    assert table["seed"] == [*train.column("seed").tolist(), *test.column("seed").tolist()]
    assert table["class"][:4] == ["relay", "cube", "relay", None] and table["model"][1] == "cubesat_6u"
    np.testing.assert_array_equal(table["box_px"][:6], train.column("box_px"))
    np.testing.assert_array_equal(table["quaternion_xyzw"][:6], train.column("quaternion_xyzw"))
    assert "range_m" not in table and "variable.lidar.laser.energy_mj" in table


def test_columns_state_their_units(data):
    schema = parquet.read_schema(write_frame_index(data))
    assert schema.field("position_m").metadata[b"units"] == b"m"
    assert schema.metadata[b"title"] == b'Two craft, "near" & far'
    assert str(schema.field("class_id").type) == "int16"


def test_rows_are_grouped_across_shards(data, monkeypatch):
    monkeypatch.setattr(frame_index, "ROWS_PER_GROUP", 6)
    whole = parquet.read_metadata(write_frame_index(data))
    assert [whole.row_group(k).num_rows for k in range(whole.num_row_groups)] == [6, 4]
