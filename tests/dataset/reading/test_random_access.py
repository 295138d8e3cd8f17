"""Reading of datasets: in any order, by other processes, and from damaged folders."""

import json
import pickle
import shutil

import numpy as np
import pytest

import rso_lidar as rl
from rso_lidar.records import Symmetry


def test_frames_in_any_order(made):
    train = made[0].split("train")
    order = np.random.default_rng(1).permutation(len(train))
    drawn = train.read(order, ("range_m", "sample", "class_id"))
    for name, values in drawn.items():
        assert np.array_equal(values, train.column(name)[order], equal_nan=name == "range_m")
    last = train[-1]
    assert last["sample"] == train.column("sample")[-1] and set(last) == set(train.names)
    with pytest.raises(IndexError):
        train.read([len(train)], ("sample",))
    with pytest.raises(rl.DatasetError, match="did you mean 'range_m'"):
        train.read([0], ("range",))


def test_numbers_have_names(made):
    dataset, _ = made
    sphere, plate = Symmetry(is_sphere=True), dataset.symmetries[0]
    assert dataset.symmetries[1] == sphere and (plate.fold, plate.half_turn) == (4, (0.0, 1.0, 0.0))
    assert dataset.symmetries[2].fold == 0
    assert dataset.classes == ("plate", "round") and dataset.models == ("plate", "sphere", "capsule")
    for split in map(dataset.split, dataset.splits):
        present = split.column("present") == 1
        assert np.array_equal(present, split.column("class_id") >= 0)
        models = np.array(dataset.models)[split.column("model_id")[present]]
        assert np.array_equal(models == "plate", split.column("class_id")[present] == 0)
        drawn = split.column("variable.lidar.laser.energy_mj")
        assert (10 <= drawn).all() and (drawn < 60).all()


def test_labels_agree_with_each_other(made):
    train = made[0].split("train")
    photons, target, lit = (train.column(name) for name in ("photons", "target", "lit_pixels"))
    assert np.array_equal(lit, ((photons >= 1.0) & (target == 0)).sum(axis=(1, 2)))
    range_m, reporting = train.column("range_m"), train.column("reporting_pixels")
    assert (reporting <= np.isfinite(range_m).sum(axis=(1, 2))).all()
    first_row, first_col, last_row, last_col = train.column("box_px").T
    rows, cols = ((photons >= 1.0) & (target == 0)).any(axis=2), ((photons >= 1.0) & (target == 0)).any(axis=1)
    shown = lit > 0
    assert np.array_equal(first_row[shown], rows[shown].argmax(axis=1))
    assert np.array_equal(last_col[shown], 15 - cols[shown][:, ::-1].argmax(axis=1))
    assert np.array_equal(last_row[shown], 15 - rows[shown][:, ::-1].argmax(axis=1))
    assert np.array_equal(first_col[shown], cols[shown].argmax(axis=1))
    distance = np.linalg.norm(train.column("position_m"), axis=1)
    np.testing.assert_allclose(distance, train.column("range_to_target_m"), rtol=1e-15)
    assert np.nanmax(np.abs(train.column("part_light_fraction").sum(axis=1)[shown] - 1.0)) < 1e-5


def test_a_dataset_pickles(made):
    train = made[0].split("train")
    _ = train[0]  # with open files
    again = pickle.loads(pickle.dumps(train))
    assert np.array_equal(again.column("sample"), train.column("sample"))
    assert pickle.loads(pickle.dumps(made[0])).classes == made[0].classes


@pytest.mark.parametrize(
    ("spoil", "said"),
    [
        (lambda folder: (folder / "sensor.h5").write_bytes(b"text"), "is damaged"),
        (lambda folder: (folder / "sensor.h5").unlink(), "is not the folder of a dataset"),
        (lambda folder: (folder / "manifest.jsonl").write_text('{"path": 1}\n{}\n'), "line 1 is damaged"),
        (lambda folder: sorted(folder.glob("train/*.h5"))[0].unlink(), "missing"),
        (lambda folder: sorted(folder.glob("train/*.h5"))[0].write_bytes(b""), "differs from its hash"),
        (lambda folder: (folder / "sensor.h5.sha256").write_text("no"), "sensor.h5: is damaged: it differs"),
    ],
)
def test_a_damaged_folder_says_where(made, tmp_path, spoil, said):
    folder = tmp_path / "copy"
    shutil.copytree(made[0].folder, folder)
    spoil(folder)
    with pytest.raises(rl.DatasetError, match=said) as caught:
        rl.dataset.open(folder).split("train").read([0], ("range_m",))
    assert "\n" not in str(caught.value)


def test_a_damaged_image_is_found_as_it_is_read(made, tmp_path):
    import h5py

    folder = tmp_path / "copy"
    shutil.copytree(made[0].folder, folder)
    path = sorted(folder.glob("train/*.h5"))[0]
    with h5py.File(path) as file:
        at = file["range_m"].id.get_chunk_info(0)
    data = bytearray(path.read_bytes())
    data[at.byte_offset + at.size // 2] ^= 1
    path.write_bytes(data)
    with pytest.raises(rl.DatasetError, match="differs from its hash"):
        rl.dataset.open(folder).split("train").read([0], ("range_m",))
    unverified = rl.dataset.open(folder, verify=False).split("train")
    with pytest.raises(rl.DatasetError, match="range_m is damaged"):
        pickle.loads(pickle.dumps(unverified)).read([0], ("range_m",))
    assert len(unverified.read([0], ("intensity_counts",))["intensity_counts"]) == 1


@pytest.mark.parametrize("name", ["sensor.h5", "train/000000.h5"])
def test_any_damage_is_one_line(original, tmp_path, name):
    folder = shutil.copytree(original, tmp_path / "copy")
    whole = (folder / name).read_bytes()
    rng = np.random.default_rng(8)
    for case in range(60):  # libhdf5 itself would hang on one of a hundred, and read wrong numbers from many
        data, at = bytearray(whole), int(rng.integers(len(whole)))
        if case % 3 == 0:
            data[at] ^= 1 << int(rng.integers(8))
        elif case % 3 == 1:
            del data[at:]
        else:
            data[at : at + 64], data[:64] = data[:64], data[at : at + 64]
        (folder / name).write_bytes(data)
        if bytes(data) == whole:
            continue
        with pytest.raises(rl.DatasetError, match=r"damaged|differs from its hash") as caught:
            rl.dataset.open(folder).split("train").column("sample")
        assert "\n" not in str(caught.value) and name.rpartition("/")[2] in str(caught.value)


def test_few_files_are_open_at_once(made, monkeypatch):
    from rso_lidar.dataset.reading import random_access

    monkeypatch.setattr(random_access, "_limit_open_shards", lambda: 2)
    train = rl.dataset.open(made[0].folder).split("train")
    assert len(train.records) > 2
    order = np.random.default_rng(1).permutation(np.repeat(np.arange(len(train)), 3))
    read = train.read(order, ("range_m", "sample"))
    assert len(train._files) <= 2
    for name, values in read.items():
        assert np.array_equal(values, made[0].split("train").column(name)[order], equal_nan=True)


def test_there_is_no_such_split(made):
    with pytest.raises(rl.DatasetError, match="no split 'trian'; did you mean 'train'"):
        made[0].split("trian")


def test_shards_of_another_dataset_are_refused(made, tmp_path):
    folder = tmp_path / "copy"
    shutil.copytree(made[0].folder, folder)
    lines = [json.loads(line) for line in (folder / "manifest.jsonl").read_text().splitlines()]
    lines[0]["dataset"] = "0" * 64
    (folder / "manifest.jsonl").write_text("".join(json.dumps(line) + "\n" for line in lines))
    with pytest.raises(rl.DatasetError, match="another dataset"):
        rl.dataset.open(folder)


def test_images_of_cameras_are_read_at_random(paired):
    dataset, _ = paired
    split = dataset.split("train")
    assert dataset.cameras == ("nav", "eye")  # in the order of the scenario
    arrays = split.read(
        [5, 0, -1], ["camera.nav.intensity_counts", "camera.eye.intensity_counts", "camera.eye.start_s"]
    )
    assert [values.shape for values in arrays.values()] == [(3, 24, 32, 1), (3, 6, 8, 3), (3,)]
    assert arrays["camera.nav.intensity_counts"].dtype == np.uint16 and (arrays["camera.eye.start_s"] == 0.5e-3).all()
    for place, index in enumerate((5, 0, len(split) - 1)):
        whole = split[index]["camera.nav.intensity_counts"]
        assert np.array_equal(arrays["camera.nav.intensity_counts"][place], whole) and whole.std() > 0.0
    entry = dataset.constants.cameras["sensor"]["nav"]
    row, col = 3, 20
    fx, fy, cx, cy = split[0]["camera.nav.intrinsics_px"]
    ray = np.array([(col - cx) / fx, (row - cy) / fy, 1.0])
    assert entry.line_of_sight[row, col] == pytest.approx(ray / np.linalg.norm(ray), abs=1e-12)
    assert json.loads(entry.table)["bands"][0]["name"] == "grey"
