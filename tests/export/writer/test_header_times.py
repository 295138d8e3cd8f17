"""Recordings written at different times have the same bytes, and HDF5 accepts their seals."""

import time

import h5py
import pytest
from frames_for_tests import make_frames

from rso_lidar import export
from rso_lidar.export.layout.checksum import compute_lookup3
from rso_lidar.export.writer.header_times import clear_header_times


@pytest.mark.parametrize(
    ("text", "wanted"),
    [(b"", 0xDEADBEEF), (b"Four score and seven years ago", 0x17770551)],  # of the driver of lookup3.c, with 0 as start
)
def test_the_checksum_is_that_of_its_author(text, wanted):
    assert compute_lookup3(text) == wanted


def test_files_made_at_other_times_are_equal(tmp_path):
    first = export.save(tmp_path / "first.h5", make_frames(3, shape=(8, 8)))
    time.sleep(1.1)  # HDF5 counts whole seconds
    second = export.save(tmp_path / "second.h5", make_frames(3, shape=(8, 8)))
    assert first.read_bytes() == second.read_bytes()
    with h5py.File(first) as file:
        assert file.id.get_create_plist().get_file_space_page_size() == 4096


def test_a_file_without_an_extension_stays_as_it_is(tmp_path):
    path = tmp_path / "plain.h5"
    with h5py.File(path, "w", libver="latest") as file:
        file["a"] = [1, 2]
    before = path.read_bytes()
    clear_header_times(path)
    assert path.read_bytes() == before
