"""The Croissant description: files with their hashes, records, and what mlcroissant says of it."""

import hashlib
import json

import pytest

from rso_lidar.dataset.publication import croissant
from rso_lidar.dataset.publication.attribution import Attribution
from rso_lidar.dataset.publication.croissant import describe_in_croissant, write_croissant
from rso_lidar.dataset.publication.frame_index import has_parquet, write_frame_index


def find_files(found):
    return {one["@id"]: one for one in found["distribution"] if one["@type"] == "cr:FileObject"}


def test_every_file_is_there_with_its_hash(data):
    files = find_files(describe_in_croissant(data, Attribution()))
    assert {"dataset.toml", "scenario.toml", "manifest.jsonl", "sensor.h5", "train/000000.h5", "test/000000.h5"} <= set(
        files
    )
    for path, one in files.items():
        content = (data.folder / path).read_bytes()
        assert one["sha256"] == hashlib.sha256(content).hexdigest() and one["contentSize"] == f"{len(content)} B"


def test_very_many_shards_are_sets_of_files_alone(data, monkeypatch):
    monkeypatch.setattr(croissant, "MOST_FILES", 2)
    found = describe_in_croissant(data, Attribution())
    assert not [path for path in find_files(found) if path.startswith("train/")]
    sets = [one for one in found["distribution"] if one["@type"] == "cr:FileSet"]
    assert [one["includes"] for one in sets] == ["train/*.h5", "test/*.h5"]


def test_attribution_is_stated_or_absent(data):
    bare = describe_in_croissant(data, Attribution())
    assert not {"license", "creator", "url"} & set(bare)
    full = describe_in_croissant(data, Attribution("CC-BY-4.0", ("A. Person",), "https://example.org/a"))
    assert full["license"] == "https://spdx.org/licenses/CC-BY-4.0.html" and full["url"] == "https://example.org/a"
    assert "A. Person" in full["citeAs"] and full["creator"] == [{"@type": "sc:Person", "name": "A. Person"}]


def test_without_a_table_there_are_no_frames_to_describe(data):
    found = describe_in_croissant(data, Attribution())
    assert [one["@id"] for one in found["recordSet"]] == ["splits", "classes", "models", "part_classes"]


@pytest.mark.filterwarnings("ignore")  # of the library itself
def test_mlcroissant_finds_no_fault_and_reads_the_frames(data):
    mlcroissant = pytest.importorskip(
        "mlcroissant", reason="needs mlcroissant: pip install mlcroissant (a part of it has no wheel)"
    )
    if not has_parquet():
        pytest.skip("needs the extra parquet: pip install 'rso-lidar[parquet]'")
    write_frame_index(data)
    place = write_croissant(data, Attribution(licence="CC-BY-4.0"))
    read = mlcroissant.Dataset(jsonld=str(place))
    assert read.metadata.ctx.issues.report() == ""
    frames = list(read.records("frames"))
    assert [int(frame["frames/seed"]) for frame in frames[:6]] == data.split("train").column("seed").tolist()
    assert frames[1]["frames/class"] == b"cube" and list(frames[1]["frames/box_px"]) == [1, 1, 3, 2]
    assert list(read.records("splits")) == [{"splits/name": "train"}, {"splits/name": "test"}]
    assert json.loads(place.read_text(encoding="utf-8"))["rai:dataLimitations"]
