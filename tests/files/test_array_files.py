"""NumPy files: what is declared is checked before memory is taken for it, and every fault is one line."""

import io
import struct
import tracemalloc
import zipfile
import zlib

import numpy as np
import pytest

from rso_lidar import files
from rso_lidar.errors import DatasetError

ARRAY = np.arange(24.0).reshape(2, 3, 4)


def write_npy(path, header, content=b""):
    head = header + b" " * (118 - len(header)) + b"\n"
    path.write_bytes(b"\x93NUMPY\x01\x00" + len(head).to_bytes(2, "little") + head + content)


def describe(shape, dtype="<f8"):
    return f"{{'descr': '{dtype}', 'fortran_order': False, 'shape': {shape}, }}".encode()


@pytest.mark.parametrize(
    "array",
    [ARRAY, np.asfortranarray(ARRAY), np.array(3.5, ">f4"), np.zeros((0, 3), "i2"), np.array(["ab", "ç"]), ARRAY > 5],
    ids=["C", "Fortran", "scalar", "empty", "text", "bool"],
)
def test_an_array_is_read_as_numpy_wrote_it(tmp_path, array):
    np.save(tmp_path / "a.npy", array)
    np.savez_compressed(tmp_path / "a.npz", one=array, two=ARRAY)
    read = files.read_arrays(tmp_path / "a.npz", DatasetError)
    for found in (files.read_array(tmp_path / "a.npy", DatasetError), read["one"]):
        np.testing.assert_array_equal(found, array)
        assert found.dtype == array.dtype
        assert found.flags.writeable
    assert list(read) == ["one", "two"]


@pytest.mark.parametrize(
    ("header", "why"),
    [
        (b"((((", "is not an NPY file"),
        (b"{'descr': '<f8', 'shape': (3,", "is not an NPY file"),
        (describe("(-1, 3)"), "negative"),
        (describe("(99999999999,)"), "99999999999 values of float64, over the 256 MiB"),
        (describe("(3,)"), "does not end where"),
        (describe("(1,)", "|O"), "contains object, not numbers"),
        (describe("(2,)", "<M8[s]"), "not numbers"),
    ],
)
def test_a_broken_header_is_one_line(tmp_path, header, why):
    write_npy(tmp_path / "a.npy", header, bytes(16))
    with pytest.raises(DatasetError, match=why) as caught:
        files.read_array(tmp_path / "a.npy", DatasetError)
    assert "\n" not in str(caught.value)


def patched(name, at, value):
    """Write an NPZ, and change two bytes at an offset of the local and the central header of its member."""

    def write(path):
        np.savez_compressed(path, a=ARRAY)
        content = bytearray(path.read_bytes())
        for signature, behind in ((b"PK\x03\x04", 0), (b"PK\x01\x02", 2)):
            place = content.index(signature) + at + behind
            content[place : place + 2] = struct.pack("<H", value)
        path.write_bytes(content)

    return pytest.param(write, id=name)


def flip_stream(path):
    np.savez_compressed(path, a=ARRAY)
    content = bytearray(path.read_bytes())
    content[60:64] = b"\xff\xff\xff\xff"
    path.write_bytes(content)


def miss_crc(path):
    np.savez(path, a=ARRAY)
    content = bytearray(path.read_bytes())
    content[content.index(ARRAY.tobytes()) + 9] ^= 1
    path.write_bytes(content)


def cut_short(path):
    np.savez(path, a=ARRAY)
    path.write_bytes(path.read_bytes()[:-30])


@pytest.mark.parametrize(
    "write", [patched("compression", 8, 99), patched("encryption", 6, 1), flip_stream, miss_crc, cut_short]
)
def test_a_damaged_archive_is_one_line(tmp_path, write):
    write(tmp_path / "a.npz")
    with pytest.raises(DatasetError, match="is not an NPZ file of numbers, or is damaged") as caught:
        files.read_arrays(tmp_path / "a.npz", DatasetError)
    assert "\n" not in str(caught.value)


def test_zeros_that_unpack_to_more_than_the_limit_take_no_memory(tmp_path):
    """Two members of 40 MiB each pass a limit of 50 MiB one by one, and not together."""
    path = tmp_path / "a.npz"
    content = io.BytesIO()
    np.save(content, np.zeros(5 * 2**20))
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as archive:
        for name in ("a.npy", "b.npy"):
            archive.writestr(name, content.getvalue())
    assert path.stat().st_size < 2**20
    tracemalloc.start()
    with pytest.raises(DatasetError, match="a: declares 5242880 values of float64, over the 30 MiB"):
        files.read_arrays(path, DatasetError, most_bytes=30 * 2**20)
    assert tracemalloc.get_traced_memory()[1] < 2**20
    tracemalloc.stop()
    with pytest.raises(DatasetError, match="b: declares 5242880 values of float64, over the 10 MiB"):
        files.read_arrays(path, DatasetError, most_bytes=50 * 2**20)


def test_a_member_that_is_longer_than_its_array_is_refused(tmp_path):
    content = io.BytesIO()
    np.save(content, ARRAY)
    with zipfile.ZipFile(tmp_path / "a.npz", "w") as archive:
        archive.writestr("a.npy", content.getvalue() + zlib.compress(bytes(10)))
    with pytest.raises(DatasetError, match="does not end where"):
        files.read_arrays(tmp_path / "a.npz", DatasetError)
