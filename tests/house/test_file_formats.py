"""Files of each version of each format are read, and those of a later version are refused in one line with a cure."""

import gzip
import json
import re
import shutil
import zipfile
from pathlib import Path

import h5py
import numpy as np
import pytest

import rso_lidar as rl
from rso_lidar.dataset.shards.shard_file import CONVENTIONS
from rso_lidar.errors import RecordingError, RsoLidarError, RunError
from rso_lidar.evaluation import CurvesFile
from rso_lidar.loop.service.command_log import LogHeader
from rso_lidar.loop.service.requests import SCHEMA
from rso_lidar.loop.service.wire_format import decode
from rso_lidar.records import SCHEMA_VERSION
from rso_lidar.study import Requirements, Study

ROOT = Path(__file__).resolve().parents[2]
KEPT = Path(__file__).with_name("kept_files")
TEXTS = {
    "scenario": rl.Scenario,
    "study": Study,
    "requirements": Requirements,
    "dataset": rl.dataset.DatasetSpec,
    "curves": CurvesFile,
}


def unpack(name, folder):
    """Write a kept recording into a folder, and return its path."""
    path = folder / f"{name}.h5"
    path.write_bytes(gzip.decompress((KEPT / f"{name}.h5.gz").read_bytes()))
    return path


@pytest.fixture
def dataset(tmp_path):
    """Return the folder of the kept dataset."""
    with zipfile.ZipFile(KEPT / "dataset_1.zip") as packed:
        packed.extractall(tmp_path / "dataset")
    return tmp_path / "dataset"


def test_a_file_of_each_version_is_kept():
    named = set(re.findall(r"`([\w.]+)`", (KEPT / "README.md").read_text(encoding="utf-8")))
    kept = {file.name for file in KEPT.iterdir()} - {"README.md"}
    assert kept <= named
    assert all(file.stat().st_size <= 50_000 for file in KEPT.iterdir())
    for version in range(1, SCHEMA_VERSION + 1):
        assert any(name.startswith(f"recording_{version}_") for name in kept), "keep a recording of the new schema"
    for version in range(1, int(CONVENTIONS.split()[-1]) + 1):
        assert f"dataset_{version}.zip" in kept, "keep a dataset of the new version"
    for name, part in TEXTS.items():
        (newest,) = part.model_fields["version"].annotation.__args__[-1:]
        assert {f"{name}_{version}.toml" for version in range(1, newest + 1)} <= kept


# Of each frame: number, time [s], returns, sum of their ranges [m] and of all counts; read when the file was written.
FIRST = [(450, 2250.0, 5, 3747.48737, 331), (500, 2500.0, 6, 2982.81833, 1583)]
WITH_ALL = [(0, 0.0, 13, 769.193577, 6427), (1, 1.0, 13, 768.869770, 6449)]


@pytest.mark.parametrize(
    ("name", "frames", "range_m"),
    [
        ("recording_1_first", FIRST, [750.382692, 499.298070]),
        ("recording_1_with_all", WITH_ALL, [60.1331855, 60.1830998]),
    ],
)
def test_a_recording_of_schema_1_has_the_values_that_were_written(tmp_path, name, frames, range_m):
    with rl.open(unpack(name, tmp_path)) as recording:
        target = recording.source.targets[0].name
        for frame, (index, time_s, returns, sum_m, counts), distance_m in zip(recording, frames, range_m, strict=True):
            assert (frame.index, frame.time_s, frame.valid.sum(), frame.intensity_counts.sum()) == (
                index, time_s, returns, counts,
            )  # fmt: skip
            assert np.nansum(frame.range_m, dtype=float) == pytest.approx(sum_m, rel=1e-8)
            assert np.linalg.norm(frame.truth.pose("lidar", target).translation) == pytest.approx(distance_m, abs=1e-6)
            assert frame.labels.photons[frame.labels.target >= 0].min() > 0.0


def test_what_a_recording_may_also_hold_is_read(tmp_path):
    with rl.open(unpack("recording_1_with_all", tmp_path)) as recording:
        assert recording.kept == ("waveforms", "photons")
        assert list(recording.sensors) == ["gyro", "accelerometer", "star_tracker", "gnss", "relative_gnss"]
        assert len(recording.sensors["gyro"].time_s) == 21
        assert recording[1].kept["waveforms"].samples_counts.shape[1] == 20
        assert rl.Scenario.loads(recording.source.scenario).lidar.receiver.n_rows == 8


def test_a_dataset_of_version_1_has_the_values_that_were_written(dataset):
    data = rl.dataset.open(dataset)
    found = {}
    for split in ("train", "test"):
        read = data.split(split).read([0, 1], ("range_m", "class_id", "position_m"))
        found[split] = read["range_m"][0], read["class_id"].tolist(), read["position_m"][0]
    assert found["train"][1] == found["test"][1] == [0, -1]
    assert np.nanmean(found["train"][0]) == pytest.approx(26.99526, abs=1e-5)
    np.testing.assert_allclose(found["train"][2], [0.03576612, 0.09891802, 27.00836298], atol=1e-8)
    np.testing.assert_allclose(found["test"][2], [-0.22495355, 0.13053944, 24.63504592], atol=1e-8)


@pytest.mark.parametrize("name", TEXTS)
def test_a_text_of_version_1_is_read(name):
    text = (KEPT / f"{name}_1.toml").read_text(encoding="utf-8")
    folder = {"scenario": "", "study": "studies", "dataset": "datasets"}.get(name)
    read = TEXTS[name].loads(text, **({} if folder is None else {"folder": ROOT / "examples" / folder}))
    assert read.version == 1


# ------------------------------------------------------------------------------------------------ files of later versions


def refuse(call, kind=RsoLidarError):
    """Return the one line that a call is refused with."""
    with pytest.raises(kind) as refused:
        call()
    assert "\n" not in str(refused.value)
    return str(refused.value)


def test_a_recording_of_a_later_schema_is_refused(tmp_path):
    path = unpack("recording_1_first", tmp_path)
    with h5py.File(path, "r+") as file:
        file.attrs["schema_version"] = SCHEMA_VERSION + 1
        file.attrs["rso_lidar_version"] = "9.8.7"
    line = refuse(lambda: rl.open(path), RecordingError)
    assert line.endswith(f"is of schema {SCHEMA_VERSION + 1}, by rso_lidar 9.8.7; this one reads up to schema "
                         f"{SCHEMA_VERSION}: upgrade rso_lidar")  # fmt: skip


def test_a_dataset_of_a_later_version_is_refused(dataset):
    with h5py.File(dataset / "sensor.h5", "r+") as file:
        file.attrs["Conventions"] = "rso_lidar dataset 99"
    assert "upgrade rso_lidar" in refuse(lambda: rl.dataset.open(dataset))


@pytest.mark.parametrize("name", TEXTS)
def test_a_text_of_a_later_version_is_refused(tmp_path, name):
    shutil.copy(ROOT / "examples" / "datasets" / "random_views.toml", tmp_path)
    text = (KEPT / f"{name}_1.toml").read_text(encoding="utf-8")
    path = tmp_path / "later.toml"
    path.write_text(re.sub(r"^version( *)= 1", r"version\1= 2", text, count=1, flags=re.MULTILINE), encoding="utf-8")
    line = refuse(lambda: TEXTS[name].load(path))
    assert "later.toml: version: is 2, of a newer rso_lidar; this one reads up to 1: upgrade rso_lidar" in line


def test_a_command_log_of_a_later_version_is_refused():
    assert "upgrade rso_lidar" in refuse(lambda: LogHeader(version=2, digest="0", seed=1))


def test_a_message_of_another_version_is_refused():
    later = {"schema": {**SCHEMA, "version": SCHEMA["version"] + 1}, "ok": True}
    assert "use equal versions" in refuse(lambda: decode([json.dumps(later).encode()]), RunError)


def test_page_of_compatibility_names_every_number():
    page = (ROOT / "docs" / "compatibility.md").read_text(encoding="utf-8")
    assert f"`schema_version`, {SCHEMA_VERSION}" in page
    assert f'`Conventions`, "{CONVENTIONS}"' in page
    assert f"`{SCHEMA['name']}`, {SCHEMA['version']}" in page
    for part in (*TEXTS.values(), LogHeader):
        assert part.model_fields["version"].annotation.__args__ == (1,)
