"""Finished runs in a file: read as they were written, and none where the file is damaged."""

import numpy as np
import pytest

from rso_lidar.study.dispersions.kept_runs import read_blocks, write_blocks

BLOCKS = {0: {"miss_m": np.array([1.5, 2.5]), "hit": np.array([True, False])}, 32: {"miss_m": np.array([3.5])}}


@pytest.fixture
def path(tmp_path):
    write_blocks(tmp_path / "runs.npz", BLOCKS)
    return tmp_path / "runs.npz"


def test_blocks_are_read_as_written(path):
    found = read_blocks(path)
    assert {begin: {name: values.tolist() for name, values in block.items()} for begin, block in found.items()} == {
        0: {"miss_m": [1.5, 2.5], "hit": [True, False]},
        32: {"miss_m": [3.5]},
    }


@pytest.mark.parametrize("at", [6, 8], ids=["encryption", "compression"])
def test_a_file_of_another_kind_of_archive_has_none(path, at):
    content = bytearray(path.read_bytes())
    for signature, behind in ((b"PK\x03\x04", 0), (b"PK\x01\x02", 2)):
        content[content.index(signature) + at + behind] = 97
    path.write_bytes(content)
    assert read_blocks(path) == {}


def test_a_file_that_is_cut_short_or_absent_has_none(path):
    path.write_bytes(path.read_bytes()[:-10])
    assert read_blocks(path) == {}
    path.unlink()
    assert read_blocks(path) == {}
