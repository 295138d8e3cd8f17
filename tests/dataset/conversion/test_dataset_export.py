"""Exports: complete or absent, replacement of an older export, and bad requests refused in one line."""

import errno
import io
import json
import re

import pytest

from rso_lidar.dataset import EXPORT_FORMATS
from rso_lidar.dataset import export as export_dataset
from rso_lidar.dataset import open as open_dataset
from rso_lidar.dataset.conversion import dataset_export
from rso_lidar.dataset.conversion.dataset_export import MARK
from rso_lidar.errors import DatasetError, RecordingError, RunError


@pytest.mark.parametrize("to", EXPORT_FORMATS)
def test_an_export_says_what_it_holds_and_what_it_leaves_out(data, tmp_path, to):
    lines = export_dataset(data, tmp_path / "out", to)
    assert lines[0].startswith(f"written     {tmp_path / 'out'} ({to}, 10 frames); lost: ")
    *scale, left_out = lines[1:]
    level = "range       20 mm per grey level; 0 is no return, or a range beyond 1,311 m"
    assert scale == ([level] if to == "images" else [])
    assert left_out.startswith(
        "left out    images part, photons, " + ("saturated, " if to == "images" else "") + "true_range_m"
    )
    mark = json.loads((tmp_path / "out" / MARK).read_text(encoding="utf-8"))
    assert mark["splits"] == {"train": 6, "test": 4} and mark["classes"] == ["relay", "cube"]
    with pytest.raises(RecordingError, match="exists already"):
        export_dataset(data, tmp_path / "out", to)
    export_dataset(data, tmp_path / "out", to, splits=["test"], overwrite=True)
    assert not list((tmp_path / "out").rglob("train*"))


def test_all_arrays_leave_nothing_out(data, tmp_path):
    assert len(export_dataset(data, tmp_path / "out", "webdataset", images=["all"])) == 1


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"to": "webdatset"}, r"webdatset: no such format; did you mean 'webdataset'\? \(known: webdataset, images"),
        ({"to": "matlab"}, "matlab: reads the shards as they are; see examples/matlab/"),
        (
            {"to": "images", "images": ["photons"]},
            "images: has range, intensity, target and part class; leave out photons",
        ),
        ({"to": "tfrecord", "images": ["depth"]}, "depth: no such images"),
        ({"to": "images", "splits": ["trian"]}, r"has no split 'trian'; did you mean 'train'\?"),
    ],
)
def test_bad_requests_leave_nothing(data, tmp_path, options, message):
    before = sorted(tmp_path.iterdir())
    with pytest.raises(DatasetError, match=message):
        export_dataset(data, tmp_path / "out", **options)
    assert sorted(tmp_path.iterdir()) == before


def test_a_folder_of_something_else_is_never_replaced(data, tmp_path):
    (tmp_path / "photos").mkdir()
    (tmp_path / "photos" / "cat.png").write_bytes(b"cat")
    with pytest.raises(RecordingError, match=re.escape("holds cat.png, which is not an export of rso_lidar")):
        export_dataset(data, tmp_path / "photos", "images", overwrite=True)
    with pytest.raises(RecordingError, match="which is not an export of rso_lidar"):
        export_dataset(data, data.folder, "images", overwrite=True)  # the dataset itself
    assert (data.folder / "train" / "000000.h5").is_file()


def test_a_damaged_shard_leaves_no_half_export(folder, tmp_path):
    shard = folder / "train" / "000001.h5"
    content = bytearray(shard.read_bytes())
    content[len(content) // 2 :] = bytes(len(content) - len(content) // 2)
    shard.write_bytes(content)
    before = sorted(tmp_path.iterdir())
    with pytest.raises(DatasetError, match=re.escape("train/000001.h5")):
        export_dataset(open_dataset(folder), tmp_path / "out", "webdataset")
    assert sorted(tmp_path.iterdir()) == before


def test_a_full_disk_leaves_nothing(data, tmp_path, monkeypatch):
    def fail(*_):
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(io, "BytesIO", fail)
    before = sorted(tmp_path.iterdir())
    with pytest.raises(RunError, match=r"out: could not be written: No space left on device; make room and run again"):
        export_dataset(data, tmp_path / "out", "webdataset")
    assert sorted(tmp_path.iterdir()) == before


def test_an_older_export_stays_until_the_new_one_is_complete(data, tmp_path, monkeypatch):
    export_dataset(data, tmp_path / "out", "webdataset")
    before = sorted(tmp_path.rglob("*"))

    def interrupt(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr(dataset_export, "write_tensorflow_files", interrupt)
    with pytest.raises(KeyboardInterrupt):
        export_dataset(data, tmp_path / "out", "tfrecord", overwrite=True)
    assert sorted(tmp_path.rglob("*")) == before
