"""Making of datasets: the same bytes with any number of processes and in any parts, and completed after interruption."""

import hashlib
import json
import shutil

import numpy as np
import pytest

import rso_lidar as rl
from rso_lidar.dataset import check_folder
from rso_lidar.dataset.drawing.plan import make_plan
from rso_lidar.dataset.making.folder_setup import list_constants
from rso_lidar.dataset.making.make import choose_shards
from rso_lidar.dataset.shards import shard_file
from rso_lidar.dataset.shards.manifest import MANIFEST
from tests.dataset.bench_for_tests import make_spec
from tests.dataset.written_for_tests import SHA256, make_frame


def hashes(folder):
    """Return the hash of each shard."""
    return {
        path.relative_to(folder).as_posix(): hashlib.sha256(path.read_bytes()).hexdigest()
        for path in sorted(folder.glob("*/*.h5"))
    }


@pytest.mark.slow
def test_bytes_do_not_depend_on_workers(made, tmp_path):
    dataset, spec = made
    other = rl.dataset.make(spec, tmp_path / "two", workers=2)
    assert hashes(other.folder) == hashes(dataset.folder) and len(hashes(dataset.folder)) > 3
    assert {one.sha256 for one in other.records} == set(hashes(dataset.folder).values())


@pytest.mark.parametrize("kind", ["made", "paired"])
def test_parts_make_the_whole(kind, request, tmp_path):
    dataset, spec = request.getfixturevalue(kind)
    for part in ("1/2", "0/2"):
        rl.dataset.make(spec, tmp_path / "parts", workers=1, shards=part)
    assert hashes(tmp_path / "parts") == hashes(dataset.folder)


@pytest.mark.parametrize("kind", ["made", "paired"])
def test_an_interrupted_set_continues(kind, request, tmp_path):
    dataset, spec = request.getfixturevalue(kind)
    folder = tmp_path / "resumed"
    shutil.copytree(dataset.folder, folder)
    lines = (folder / MANIFEST).read_bytes().splitlines(keepends=True)
    (folder / MANIFEST).write_bytes(b"".join(lines[:2]) + lines[2][:40])  # a line that was being written
    kept = [json.loads(line)["path"] for line in lines[:2]]
    for path in folder.glob("*/*.h5"):
        if path.relative_to(folder).as_posix() not in kept:
            path.unlink()
    for draft in ("000001.h5.part", "000001.h5.part1", "000001.part.h5"):  # the last by an earlier version
        (folder / "train" / draft).write_bytes(b"killed")
    with pytest.raises(rl.DatasetError, match="--resume"):
        rl.dataset.make(spec, folder, workers=1)
    seen = []
    rl.dataset.make(spec, folder, workers=1, resume=True, on_shard=lambda done, count: seen.append((done, count)))
    assert seen[0] == (2, len(lines)) and seen[-1] == (len(lines), len(lines))
    assert hashes(folder) == hashes(dataset.folder) and not list(folder.glob("*/*.part*"))


def test_no_documented_pattern_matches_a_shard_that_is_being_written(original, tmp_path, monkeypatch):
    folder = shutil.copytree(original, tmp_path / "folder")
    (folder / "train" / "000000.h5").unlink()
    write_array, seen = shard_file._write_array, set()

    def watch(*given):
        seen.update(path.name for path in folder.rglob("*.part*"))
        assert not list(folder.glob("train/000000*.h5")) and not list(folder.glob("train/.*"))
        write_array(*given)

    monkeypatch.setattr(shard_file, "_write_array", watch)
    shard_file.write_shard(folder / "train/000000.h5", [(make_frame(0), {})], (), dataset=SHA256)
    assert seen == {"000000.h5.part"} and not list(folder.rglob("*.part*"))
    (folder / "train" / "000000.h5.part").write_bytes(b"killed")
    assert "ignored: temporary files of running or killed runs: 1, such as" in check_folder(folder).describe()


def test_another_specification_is_refused(made):
    dataset, spec = made
    before = hashes(dataset.folder)
    with pytest.raises(rl.DatasetError, match="another specification"):
        rl.dataset.make(spec.replace(seed=12), dataset.folder, workers=1, resume=True)
    assert hashes(dataset.folder) == before


def test_a_file_that_changed_is_refused(tmp_path):
    heights = np.zeros((5, 5))
    np.save(tmp_path / "ground.npy", heights)
    classes = [{"name": "ground", "samples": 2}]
    ground = 'target.body.terrain={type="height_field",file="ground.npy",cell_m=1.0}'
    spec = make_spec(tmp_path, classes=classes, set=(ground,), split={"type": "random", "test": 0.0}, draws=1)
    bench = (tmp_path / "bench.toml").read_text(encoding="utf-8").replace('model = "plate"\n', "")
    (tmp_path / "bench.toml").write_text(bench, encoding="utf-8")
    made = rl.dataset.make(spec, tmp_path / "made", workers=1)
    assert made.models == ("height_field",)
    before = hashes(made.folder)
    rl.dataset.make(spec, made.folder, workers=1, resume=True)
    np.save(tmp_path / "ground.npy", heights + 0.1)
    with pytest.raises(rl.DatasetError, match="a file that it names has changed; name another folder") as caught:
        rl.dataset.make(spec, made.folder, workers=1, resume=True)
    assert "\n" not in str(caught.value) and hashes(made.folder) == before


def test_a_lost_sensor_file_is_written_again(made, tmp_path):
    dataset, spec = made
    folder = shutil.copytree(dataset.folder, tmp_path / "made")
    (folder / "sensor.h5").unlink()
    with pytest.raises(rl.DatasetError, match="belongs to another dataset"):
        rl.dataset.make(spec.replace(seed=12), folder, workers=1, resume=True)
    rl.dataset.make(spec, folder, workers=1, resume=True)
    assert (folder / "sensor.h5").read_bytes() == (dataset.folder / "sensor.h5").read_bytes()
    assert hashes(folder) == hashes(dataset.folder)


def test_a_folder_with_other_files_is_refused(made, tmp_path):
    (tmp_path / "notes.txt").write_text("mine", encoding="utf-8")
    with pytest.raises(rl.DatasetError, match="holds other files"):
        rl.dataset.make(made[1], tmp_path, workers=1)
    with pytest.raises(rl.DatasetError, match="is a file"):
        rl.dataset.make(made[1], tmp_path / "notes.txt", workers=1)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["notes.txt"]


@pytest.mark.parametrize("text", ["", "3", "a:b", "4/4", "0/0", "99:", "2:1", "-1/2"])
def test_bad_choices_of_shards(text):
    with pytest.raises(rl.DatasetError, match="--shards"):
        choose_shards(text, 8)


def test_noise_draws_have_the_same_truth(made):
    split = made[0].split("train")
    sample, draw, present = (split.column(name) for name in ("sample", "draw", "present"))
    assert set(draw) == {0, 1}
    for one in np.unique(sample[present == 1]):
        first, second = (split[int(np.flatnonzero((sample == one) & (draw == k))[0])] for k in (0, 1))
        for name in ("true_range_m", "photons", "part_class_id", "position_m", "quaternion_xyzw", "lit_pixels"):
            assert np.array_equal(first[name], second[name], equal_nan=True), name
        assert first["seed"] != second["seed"]
    readings = split.column("range_m").reshape(len(split), -1)
    both = np.isfinite(readings[draw == 0]) & np.isfinite(readings[draw == 1])
    spread = (readings[draw == 0] - readings[draw == 1])[both]
    assert both.sum() > 20 and np.all(spread != 0.0) and np.std(spread) < 1.0


def test_a_closed_loop_is_flown_to_the_frames_that_are_asked_for(tmp_path):
    scenario = """
version = 1
name = "a stage passes"
world = { axes = "local" }
time = { start_utc = 2024-09-17T12:00:00Z, duration_s = 1, frame_rate_hz = 5 }
follower = { motion = { type = "fixed", position_m = [0, 0, 0] } }
ptu.point = { type = "fixed", pan_deg = 0.4, tilt_deg = 0 }
ptu.response = { type = "first_order", time_constant_s = 0.02 }
lidar = { preset = "gsfl_1064", receiver = { n_rows = 16, n_cols = 16, fov_deg = 2.0, rays_per_pixel = 4 } }
target = [{ name = "body", model = "sphere", size_m = 3, motion = { type = "fixed", position_m = [200, 0, 0] } }]
"""
    text = """
version = 1
name = "closed loop"
scenario = "loop.toml"
sequence = { frames = 2, stride = 2 }
controller = { type = "pointing", gate_m = 20, lead_s = 0.1 }
draws = 2
split = { type = "random", test = 0.5 }
classes = [{ name = "sphere", samples = 4 }]
"""
    (tmp_path / "loop.toml").write_text(scenario, encoding="utf-8")
    (tmp_path / "spec.toml").write_text(text, encoding="utf-8")
    made = rl.dataset.make(tmp_path / "spec.toml", tmp_path / "made", workers=1)
    split = made.split(made.splits[0])
    position, step, number = (split.column(name) for name in ("position_m", "step", "frame_number"))
    assert np.array_equal(np.unique(number), [0, 2])
    off_deg = np.degrees(np.hypot(position[:, 0], position[:, 1]) / position[:, 2])
    assert (
        off_deg[step == 0] == pytest.approx(0.4, abs=1e-4) and (off_deg[step == 1] < 0.2).all()
    )  # the loop has pointed it


def test_the_symmetry_of_a_target_that_the_scenario_describes(tmp_path):
    one = {"name": "a", "samples": 6, "set": ["target.body.symmetry={fold=3}"]}
    plan = make_plan(make_spec(tmp_path, classes=[one, {"name": "b", "models": ["sphere"], "samples": 6}]))
    found = list_constants(plan).symmetries
    assert found["plate"]["fold"] == 3 and found["sphere"]["is_sphere"]


def test_a_second_run_waits(made, tmp_path):
    from rso_lidar.files import hold_lock

    spec = made[1]
    rl.dataset.make(spec, tmp_path / "made", workers=1, shards="0:1")
    with hold_lock(tmp_path / "made" / ".make.lock"), pytest.raises(rl.RecordingError, match="another run is making"):
        rl.dataset.make(spec, tmp_path / "made", workers=1, resume=True)


def test_bodies_have_the_same_numbers_with_and_without_a_target(tmp_path):
    clutter = {
        "models": ["sphere"],
        "count": {"type": "whole", "low": 2, "high": 2},
        "range_m": {"type": "uniform", "low": 40, "high": 60},
    }
    split = rl.dataset.make(make_spec(tmp_path, clutter=clutter, draws=1), tmp_path / "made", workers=1).split("train")
    target, present = split.column("target"), split.column("present")
    assert (target[present == 0] != 0).all() and set(np.unique(target)) <= {-1, 0, 1, 2}
    assert (target[present == 1] == 0).any() and (target[present == 0] >= 1).any()
