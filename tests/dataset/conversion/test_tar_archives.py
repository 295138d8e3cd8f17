"""WebDataset: the members of archives, their bytes, and that webdataset reads them."""

import io
import json
import tarfile

import numpy as np
import pytest

from rso_lidar.dataset.conversion import tar_archives
from rso_lidar.dataset.conversion.frame_batches import divide
from rso_lidar.dataset.conversion.tar_archives import write_tar_archives

IMAGES = ["range_m", "target"]


def test_files_of_a_frame_stand_together(data, tmp_path):
    write_tar_archives(tmp_path, data, ["train"], IMAGES)
    with tarfile.open(tmp_path / "train-000000.tar") as archive:
        names = archive.getnames()
        range_m = np.load(io.BytesIO(archive.extractfile("00000000-0000-01.range_m.npy").read()))
        description = json.loads(archive.extractfile("00000000-0000-01.json").read())
        assert archive.extractfile("00000000-0000-01.cls").read() == b"1"
    assert names[:4] == [f"00000000-0000-00.{suffix}" for suffix in ("range_m.npy", "target.npy", "json", "cls")]
    assert len(names) == 6 * 4
    np.testing.assert_array_equal(range_m, data.split("train")[1]["range_m"])
    assert (
        description["class"] == "cube"
        and description["split"] == "train"
        and description["variable.lidar.laser.energy_mj"] == 21.0
    )


def test_archives_are_divided_and_have_no_dates(data, tmp_path, monkeypatch):
    monkeypatch.setattr(tar_archives, "divide", lambda frames: divide(frames, 4))
    for name in ("one", "two"):
        (tmp_path / name).mkdir()
        write_tar_archives(tmp_path / name, data, ["train", "test"], IMAGES)
    files = sorted(file.name for file in (tmp_path / "one").iterdir())
    assert files == ["test-000000.tar", "train-000000.tar", "train-000001.tar"]
    for name in files:
        assert (tmp_path / "one" / name).read_bytes() == (tmp_path / "two" / name).read_bytes()


@pytest.mark.filterwarnings("ignore")  # of the library itself
def test_webdataset_reads_them(data, tmp_path):
    webdataset = pytest.importorskip("webdataset", reason="needs webdataset: pip install webdataset")
    write_tar_archives(tmp_path, data, ["test"], IMAGES)
    frames = list(webdataset.WebDataset(str(tmp_path / "test-000000.tar"), shardshuffle=False).decode())
    assert [frame["cls"] for frame in frames] == data.split("test").column("class_id").tolist()
    np.testing.assert_array_equal(frames[2]["range_m.npy"], data.split("test")[2]["range_m"])
    assert frames[0]["json"]["sample"] == 3
