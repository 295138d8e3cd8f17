"""Files of predictions that declare more than the dataset has: one line, before memory is taken for it."""

import io
import struct
import tracemalloc
import zipfile

import h5py
import numpy as np
import pytest

import rso_lidar as rl
from rso_lidar.dataset.scoring.prediction_file import PredictionLimits, read_columns
from rso_lidar.errors import DatasetError

MOST = PredictionLimits.of(rows=30, row_bytes=4096)  # 4 MiB with what is spare
KEYS = {name: np.arange(3) for name in ("sample", "step", "draw")}


def dump(array):
    stream = io.BytesIO()
    np.save(stream, array)
    return stream.getvalue()


def write_npz(path, **members):
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in ({name: dump(values) for name, values in KEYS.items()} | members).items():
            archive.writestr(f"{name}.npy", content)


def write_hdf5(path, fill):
    with h5py.File(path, "w") as file:
        for name, values in KEYS.items():
            file[name] = values
        fill(file)


def refuse(path, said):
    """Check that a file is refused in one line, with less than 16 MB of memory."""
    tracemalloc.start()
    with pytest.raises(DatasetError, match=said) as caught:
        read_columns(path, MOST)
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert "\n" not in str(caught.value) and str(caught.value).startswith(str(path)) and peak < 16e6


def test_a_small_npz_of_many_zeros_is_not_read(tmp_path):
    write_npz(tmp_path / "zeros.npz", **{"class": dump(np.zeros(30_000_000, np.int8))})
    assert (tmp_path / "zeros.npz").stat().st_size < 60_000
    refuse(tmp_path / "zeros.npz", "class: declares 30000000 values of int8, over the 4 MiB that may be read")


@pytest.mark.parametrize(
    ("fill", "said"),
    [
        (lambda file: file.create_dataset("x_m", (4 * 10**8,), "f8", chunks=(1000,)), "declares 3,200,000,000 bytes"),
        (lambda file: file.create_dataset("x_m", (31,), "f8"), "x_m has 31 rows, and the dataset 30 frames"),
        (lambda file: file.create_dataset("x_m", (3, 10**6), "i1", chunks=(1, 1000)), None),
        (
            lambda file: file.create_dataset("x_m", (3, 2 * 10**6), "i1", chunks=(1, 1000)),
            "columns of more than 4 MiB, x_m",
        ),
        (lambda file: file.create_dataset("class", data=np.array([b"\xff"] * 3)), "codec can't decode"),
        (lambda file: file.__setitem__("class", h5py.Empty("f4")), "is not an HDF5 file of numbers and texts"),
    ],
)
def test_columns_of_hdf5_are_bounded_by_the_frames_of_the_dataset(tmp_path, fill, said):
    write_hdf5(tmp_path / "a.h5", fill)
    if said is None:
        assert read_columns(tmp_path / "a.h5", MOST)[0]["x_m"].shape == (3, 10**6)
    else:
        refuse(tmp_path / "a.h5", said)


def test_a_link_to_nowhere_is_no_column(tmp_path):
    write_hdf5(tmp_path / "a.h5", lambda file: file.__setitem__("class", h5py.SoftLink("/nowhere")))
    assert set(read_columns(tmp_path / "a.h5")[0]) == set(KEYS)


def test_tables_with_more_rows_than_frames_are_not_decompressed(tmp_path):
    pyarrow = pytest.importorskip("pyarrow", reason="needs the extra parquet: pip install 'rso-lidar[parquet]'")
    from pyarrow import parquet

    parquet.write_table(pyarrow.table({"sample": np.zeros(2 * 10**6, np.int64)}), tmp_path / "a.parquet")
    refuse(tmp_path / "a.parquet", "the table has 2,000,000 rows, and the dataset 30 frames")
    parquet.write_table(pyarrow.table({"sample": [1], "class": [[0] * 10**6]}), tmp_path / "b.parquet")
    refuse(tmp_path / "b.parquet", "columns of more than 4 MiB, class")
    (tmp_path / "a.csv").write_bytes(b"sample,class\n" + b"1,plate\n" * 600_000)
    refuse(tmp_path / "a.csv", "over the 4 MiB that a file of predictions for this dataset may have")


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (
            lambda raw: mark(raw, 8, 10, lambda at, raw: struct.pack_into("<H", raw, at, 97)),
            "compression method is not",
        ),
        (lambda raw: mark(raw, 6, 8, lambda at, raw: struct.pack_into("<H", raw, at, 1)), "is encrypted"),
        (lambda raw: raw.__setitem__(slice(40, 60), b"\xff" * 20), "is not an NPZ file of numbers, or is damaged"),
    ],
)
def test_damaged_and_encrypted_members_are_refused_in_one_line(tmp_path, change, said):
    write_npz(tmp_path / "a.npz", **{"class": dump(np.array(["plate"] * 3))})
    raw = bytearray((tmp_path / "a.npz").read_bytes())
    change(raw)
    (tmp_path / "a.npz").write_bytes(raw)
    refuse(tmp_path / "a.npz", said)


def mark(raw, local, central, change):
    """Change a word in the local and the central header of each member of a ZIP file."""
    for signature, offset in ((b"PK\x03\x04", local), (b"PK\x01\x02", central)):
        at = -1
        while (at := raw.find(signature, at + 1)) >= 0:
            change(at + offset, raw)


@pytest.mark.parametrize("content", [b"{'descr': '<f8', 'shape': (3,".ljust(30), b"[" * 9000])
def test_headers_without_an_end_are_refused_in_one_line(tmp_path, content):
    header = b"\x93NUMPY\x01\x00" + struct.pack("<H", len(content)) + content
    write_npz(tmp_path / "a.npz", **{"class": header})
    refuse(tmp_path / "a.npz", "is not an NPZ file of numbers, or is damaged")


def test_a_file_is_bounded_by_the_dataset_that_it_is_scored_on(made, tmp_path):
    write_hdf5(tmp_path / "a.h5", lambda file: file.create_dataset("x_m", (31,), "f8"))  # 30 frames in all splits
    with pytest.raises(DatasetError, match="x_m has 31 rows, and the dataset 30 frames"):
        rl.dataset.score(tmp_path / "a.h5", made[0])
    text = np.full((12, 16, 16), "bus")
    with pytest.raises(DatasetError, match="part_class_id has values of <U3; give an array of real numbers"):
        rl.dataset.score({"sample": np.arange(12), "part_class_id": text}, made[0])
