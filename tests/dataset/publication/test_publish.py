"""Publication of a dataset in one call, and the folders that it refuses."""

import io
import json
import shutil
import sys

import pytest
from PIL import Image

import rso_lidar as rl
from rso_lidar.dataset import publish
from rso_lidar.dataset.publication import publish as publish_module
from rso_lidar.dataset.publication.frame_index import INDEX, has_parquet
from rso_lidar.dataset.publication.publish import PICTURES
from rso_lidar.errors import DatasetError


def test_a_folder_gets_card_description_table_and_pictures(folder):
    before = {file.name for file in folder.iterdir()}
    lines = publish(folder, licence="CC-BY-4.0", creators=("A. Person",))
    assert len(lines) == 1 if has_parquet() else "extra" in lines[1]
    table = {INDEX} if has_parquet() else set()
    added = {file.name for file in folder.iterdir()} - before
    assert added == {"README.md", "croissant.json", *PICTURES, *table}
    assert lines[0].endswith(f" in {folder}") and all(name in lines[0] for name in added)
    card = (folder / "README.md").read_text(encoding="utf-8")
    for name in PICTURES:
        assert f"]({name})" in card
        width, height = Image.open(io.BytesIO((folder / name).read_bytes())).size
        assert width > 1000 and height > 300


@pytest.fixture
def without_pictures(monkeypatch):
    """Leave the pictures out, which take seconds."""
    monkeypatch.setattr(publish_module, "_draw_pictures", lambda data: [])


def test_what_was_stated_once_stays(folder, without_pictures):
    publish(folder, licence="CC-BY-4.0", creators=("A. Person",))
    publish(folder, url="https://example.org/a")
    found = json.loads((folder / "croissant.json").read_text(encoding="utf-8"))
    assert "CC-BY-4.0" in found["license"] and found["creator"][0]["name"] == "A. Person"
    assert found["url"] == "https://example.org/a"


def test_without_a_licence_or_pyarrow_a_line_says_so(folder, monkeypatch, without_pictures):
    (folder / INDEX).write_bytes(b"of an earlier run")
    monkeypatch.setitem(sys.modules, "pyarrow.parquet", None)
    lines = publish(folder)
    assert lines == [
        f"written     README.md, croissant.json in {folder}",
        "index.parquet left out: it needs an extra, pip install rso-lidar[parquet]",
        f"README.md and croissant.json state no licence: rso-lidar dataset publish {folder} --licence CC-BY-4.0",
    ]
    assert not (folder / INDEX).exists()


def test_a_folder_without_frames_is_refused(folder):
    (folder / "manifest.jsonl").unlink()
    with pytest.raises(DatasetError, match="holds no frames yet; make them with --resume"):
        publish(folder)


def test_a_folder_that_is_no_dataset_is_refused(tmp_path):
    with pytest.raises(DatasetError, match="is not the folder of a dataset"):
        publish(tmp_path)
    assert not list(tmp_path.iterdir())


def test_a_missing_shard_is_named(folder):
    (folder / "train" / "000001.h5").unlink()
    with pytest.raises(DatasetError, match=r"train/000001\.h5: the shard is missing"):
        publish(folder)


def test_a_wrong_licence_changes_nothing(folder):
    before = sorted(folder.iterdir())
    with pytest.raises(DatasetError, match="is no SPDX identifier"):
        publish(folder, licence="do what you like")
    assert sorted(folder.iterdir()) == before


def test_the_card_shows_and_lists_the_cameras(paired, tmp_path):
    folder = shutil.copytree(paired[0].folder, tmp_path / "paired")
    (written, *_) = rl.dataset.publish(folder, licence="MIT")
    assert "sample_camera_nav.png, sample_camera_eye.png" in written and (folder / "sample_camera_eye.png").is_file()
    card = (folder / "README.md").read_text(encoding="utf-8")
    assert "the cameras nav (24 x 32 x 1) and eye (6 x 8 x 3)" in card and "### sensor, camera nav" in card
    assert "| `camera.nav.intensity_counts` | frame × 24 × 32 × 1 | uint16 | count |" in card
    assert (
        "| `camera.nav.sensor.read_noise_electrons` | 8.0 | assumed |" in card and "mosaics of colour filters" in card
    )
    assert "camera image" in json.loads((folder / "croissant.json").read_text(encoding="utf-8"))["keywords"]
