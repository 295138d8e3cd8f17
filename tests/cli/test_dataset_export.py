"""`rso-lidar dataset export` and `dataset publish`."""

import pytest

from tests.dataset.written_for_tests import make_dataset


@pytest.fixture
def folder(tmp_path):
    return make_dataset(tmp_path / "two_craft")


def test_an_export_prints_what_it_wrote_and_left_out(rso_lidar, folder, tmp_path):
    status, out, err = rso_lidar(
        "dataset", "export", folder, "--to", "webdataset", "-o", tmp_path / "out", "--split", "test"
    )
    assert (status, err) == (0, [])
    written, left_out = out.splitlines()
    assert "(webdataset, 4 frames)" in written and "photons" in left_out
    assert sorted(file.name for file in (tmp_path / "out").iterdir()) == ["dataset_export.json", "test-000000.tar"]


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--to", "tfrecords"], "tfrecords: no such format; did you mean 'tfrecord'?"),
        (["--to", "tfrecord", "--arrays", ","], "--arrays ,: names no array; write for example range_m,photons"),
        (["--to", "images", "--split", "val"], "has no split 'val'"),
    ],
)
def test_bad_requests_are_one_line(rso_lidar, folder, tmp_path, options, message):
    status, _, err = rso_lidar("dataset", "export", folder, *options, "-o", tmp_path / "out")
    assert status == 2 and len(err) == 1 and message in err[0]
    assert not (tmp_path / "out").exists()


def test_a_wrong_licence_is_one_line(rso_lidar, folder):
    status, _, err = rso_lidar("dataset", "publish", folder, "--licence", "my own")
    assert status == 2 and len(err) == 1 and "is no SPDX identifier" in err[0]
