"""A contest publishes readings of the test only, commits to their labels, and is judged by the key."""

import hashlib
import json
import shutil

import h5py
import numpy as np
import pytest

import rso_lidar as rl
from rso_lidar.dataset.publication import contest_folder
from rso_lidar.dataset.publication.attribution import Attribution
from rso_lidar.dataset.reading.contest_key import ContestKey, read_key

KEY = ContestKey("ab" * 32)


@pytest.fixture(scope="module")
def contest(made, tmp_path_factory):
    """Return the dataset with the labels, and the folder of its contest; no test changes them."""
    place = tmp_path_factory.mktemp("contest")
    private = shutil.copytree(made[0].folder, place / "private")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(contest_folder, "_LEAST_SEED", 1)
        lines = rl.dataset.publish(private, hidden_labels=place / "public", licence="CC-BY-4.0")
    assert "without labels" in lines[0] and "--contest" in lines[1]
    return rl.dataset.open(private), rl.dataset.open(place / "public")


def number_frames(dataset):
    test = dataset.split("test")
    sample, step, draw = (test.column(name) for name in ("sample", "step", "draw"))
    return read_key(dataset.folder).number_frames(sample, draw), step, test


def test_the_test_holds_what_the_sensor_knows_and_nothing_else(contest):
    dataset, public = contest
    number, step, test = number_frames(dataset)
    shown = public.split("test")
    assert set(shown.names) == {"sample", "step", "draw", *contest_folder.READINGS}
    row = {key: k for k, key in enumerate(zip(number.tolist(), step.tolist(), strict=True))}
    places = [row[key] for key in zip(shown.column("sample").tolist(), shown.column("step").tolist(), strict=True)]
    assert sorted(places) == list(range(len(test)))
    for name in contest_folder.READINGS:
        assert np.array_equal(shown.column(name), test.column(name)[places], equal_nan=True)
    assert not shown.column("draw").any()
    for record in public.split("train").records:
        assert (public.folder / record.path).read_bytes() == (dataset.folder / record.path).read_bytes()
    with h5py.File(public.folder / shown.records[0].path) as file:
        assert set(file.attrs) == {"Conventions", "dataset_sha256"}
    written = "".join(path.read_text() for path in public.folder.glob("*.*") if path.suffix != ".h5")
    assert "seed = " not in written and read_key(dataset.folder).secret not in written
    assert not rl.dataset.check_folder(public.folder).problems


def test_hashes_are_of_the_salted_labels(contest):
    dataset, public = contest
    number, step, test = number_frames(dataset)
    k = 3
    labels = {
        "class": None if test.column("class_id")[k] < 0 else dataset.classes[test.column("class_id")[k]],
        "model": None if test.column("model_id")[k] < 0 else dataset.models[test.column("model_id")[k]],
        "present": int(test.column("present")[k]),
        "position_m": [repr(x) for x in test.column("position_m")[k].tolist()],
        "quaternion_xyzw": [repr(x) for x in test.column("quaternion_xyzw")[k].tolist()],
    }
    labels |= {
        name: hashlib.sha256(test.column(name)[k].tobytes()).hexdigest() for name in ("part_class_id", "true_range_m")
    }
    identity = f"{number[k]},{step[k]}"
    salt = read_key(dataset.folder).digest(f"salt,{identity}")
    expected = hashlib.sha256(f"{salt} {identity} {json.dumps(labels, sort_keys=True)}".encode()).hexdigest()
    assert f"{expected}  {identity}" in (public.folder / "labels.sha256").read_text().splitlines()


def test_the_judge_knows_frames_by_their_published_numbers(contest):
    dataset, public = contest
    number, step, test = number_frames(dataset)
    right = np.array([*dataset.classes, ""])[test.column("class_id")]
    answer = {"sample": number, "step": step, "class": right}
    card = rl.dataset.score(answer, dataset, contest=True)
    assert card.merits[0].name == "accuracy" and card.merits[0].value.value == 1.0
    worse = rl.dataset.score(answer | {"class": np.roll(right, 1)}, dataset, contest=True)
    assert worse.merits[0].value.value < 1.0
    with pytest.raises(rl.DatasetError, match=r"is not in the dataset|is of the split"):
        rl.dataset.score(answer, dataset)
    with pytest.raises(rl.DatasetError, match="the labels of 'test' are hidden"):
        rl.dataset.score(answer, public)
    with pytest.raises(rl.DatasetError, match="a contest scores the split 'test'"):
        rl.dataset.score(answer, dataset, "train", contest=True)


def test_numbers_are_a_random_order_that_each_noise_draw_has_for_itself():
    sample, draw = np.repeat(np.arange(50), 2), np.tile([0, 1], 50)
    number = KEY.number_frames(sample, draw)
    assert sorted(number) == list(range(100))
    assert abs(np.corrcoef(number, sample)[0, 1]) < 0.4 and np.ptp(number[::2] - number[1::2]) > 20
    chosen = np.array([4, 4, 9])  # frames of a sequence share their number
    assert np.ptp(KEY.number_frames(chosen, np.zeros(3, int))[:2]) == 0


def test_a_contest_that_gives_its_labels_away_is_refused(made, data, tmp_path):
    with pytest.raises(rl.DatasetError, match=r"seed = 11 can be guessed, .* such as \d{17,19}$"):
        rl.dataset.publish(made[0].folder, hidden_labels=tmp_path / "public")
    with pytest.raises(rl.DatasetError, match="5 of 8 samples are made"):
        contest_folder.write_contest(data, tmp_path / "public", Attribution())
    even = rl.dataset.open(made[0].folder)
    even.__dict__["spec"] = even.spec.replace(seed=2**62, sampling="halton")
    with pytest.raises(rl.DatasetError, match="Halton sequence"):
        contest_folder.write_contest(even, tmp_path / "public", Attribution())
    assert not (tmp_path / "public").exists() and not (made[0].folder / "contest_key.json").exists()


def test_an_exposure_that_tells_which_frames_share_a_pose_is_refused(paired, tmp_path):
    several = rl.dataset.open(paired[0].folder)
    several.__dict__["spec"] = several.spec.replace(draws=2)
    with pytest.raises(rl.DatasetError, match=r"camera\.nav\.exposure_s differs from sample to sample"):
        contest_folder.write_contest(several, tmp_path / "public", Attribution())


@pytest.mark.parametrize("text", ["", "[" * 4000, "{}", '{"secret": 3}', '{"secret": "AB"}'])
def test_a_damaged_key_is_one_line(tmp_path, text):
    (tmp_path / "contest_key.json").write_text(text)
    with pytest.raises(rl.DatasetError, match="is damaged; restore it") as caught:
        read_key(tmp_path)
    assert "\n" not in str(caught.value)


def test_images_of_cameras_are_published_and_their_labels_are_hidden(paired, tmp_path):
    private = shutil.copytree(paired[0].folder, tmp_path / "private")
    rl.dataset.publish(private, hidden_labels=tmp_path / "public")
    dataset, public = rl.dataset.open(private), rl.dataset.open(tmp_path / "public")
    shown = public.split("test")
    of_cameras = {name for name in shown.names if name.startswith("camera.")}
    fields = ("intensity_counts", "exposure_s", "start_s", "intrinsics_px")
    assert of_cameras == {f"camera.{name}.{field}" for name in ("nav", "eye") for field in fields}
    number, step, test = number_frames(dataset)
    order = np.lexsort((step, number))
    images = test.column("camera.nav.intensity_counts")
    assert np.array_equal(shown.column("camera.nav.intensity_counts"), images[order])
    with h5py.File(public.folder / shown.records[0].path) as file:
        assert not any("target" in name or "part" in name for name in file)
    before = (public.folder / "labels.sha256").read_text().splitlines()
    rows = np.arange(len(test))
    labels = list(contest_folder._list_labels(dataset, test, rows))
    tables = [json.loads(text) for text in labels]
    hashed = [hashlib.sha256(values.tobytes()).hexdigest() for values in test.column("camera.nav.range_m")]
    assert [table["camera.nav.range_m"] for table in tables] == hashed and len(before) == len(test)
    assert "`camera.nav.intensity_counts`" in (public.folder / "README.md").read_text(encoding="utf-8")
    assert not rl.dataset.check_folder(public.folder).problems
