"""TFRecord files of a dataset, read back by the layout of the format."""

import struct

import numpy as np
import pytest

from rso_lidar.dataset.conversion.tensorflow_files import write_tensorflow_files


def read_records(place):
    """Return the data of the records of a file."""
    content, found = place.read_bytes(), []
    while content:
        (length,) = struct.unpack("<Q", content[:8])
        found.append(content[12 : 12 + length])
        content = content[16 + length :]
    return found


def test_a_record_per_frame_with_raw_images(data, tmp_path):
    out = tmp_path / "out"
    out.mkdir()
    write_tensorflow_files(out, data, ["train", "test"], ["range_m"])
    assert sorted(file.name for file in out.iterdir()) == ["test-000000.tfrecord", "train-000000.tfrecord"]
    records = read_records(out / "train-000000.tfrecord")
    range_m = data.split("train").column("range_m")
    assert len(records) == 6
    for record, image in zip(records, range_m, strict=True):
        assert image.astype("<f4").tobytes() in record and b"range_m/shape" in record and b"float32" in record
    assert b"relay" in records[0] and b"00000000-0000-00" in records[0] and b"cubesat_6u" in records[1]


@pytest.mark.filterwarnings("ignore")  # of the library itself
def test_another_reader_takes_them(data, tmp_path):
    # Not in the test group: it has no wheel.
    reader = pytest.importorskip("tfrecord.reader", reason="needs tfrecord: pip install tfrecord")
    write_tensorflow_files(tmp_path, data, ["test"], ["range_m", "target"])
    frames = list(reader.tfrecord_loader(str(tmp_path / "test-000000.tfrecord"), None))
    split = data.split("test")
    assert [int(frame["seed"][0]) for frame in frames] == split.column("seed").tolist()
    target = np.frombuffer(bytes(frames[1]["target"]), np.int8).reshape(frames[1]["target/shape"])
    np.testing.assert_array_equal(target, split[1]["target"])
    np.testing.assert_allclose(frames[2]["position_m"], split[2]["position_m"], rtol=1e-6)  # rounded to 32 bits
