"""The check of a folder: a byte that changed, a shard that is missing, and frames made again."""

import shutil
from dataclasses import replace

import h5py
import numpy as np
import pytest

import rso_lidar as rl
from rso_lidar.dataset import check_folder
from rso_lidar.dataset.checking import folder_check
from tests.dataset.bench_for_tests import make_spec
from tests.dataset.written_for_tests import make_dataset, make_frame


def test_a_whole_folder_has_no_problems(made):
    found = check_folder(made[0].folder, samples=2)
    assert not found.problems and found.remade == 4  # two noise draws of each
    assert "made again and compared bit for bit" in found.describe() and "plate" in found.describe()


def test_a_changed_byte_and_a_missing_shard_are_found(made, tmp_path):
    folder = tmp_path / "copy"
    shutil.copytree(made[0].folder, folder)
    first, second = sorted(folder.glob("*/*.h5"))[:2]
    data = bytearray(first.read_bytes())
    data[len(data) // 2] ^= 4
    first.write_bytes(data)
    assert not check_folder(folder, quick=True).problems  # which compares sizes only
    first.write_bytes(data[:-1])
    quick = check_folder(folder, quick=True)
    assert "differs from its size" in quick.problems[0] and "no frame was made again" in quick.describe()
    first.write_bytes(data)
    second.unlink()
    problems = check_folder(folder, samples=2).problems
    assert len(problems) == 2
    assert "differs from its hash" in problems[0] + problems[1] and "is missing" in problems[0] + problems[1]


def test_a_frame_that_was_changed_differs_when_it_is_made_again(made, tmp_path):
    from rso_lidar.dataset.shards.shard_file import hash_file

    folder = tmp_path / "copy"
    shutil.copytree(made[0].folder, folder)
    manifest = folder / "manifest.jsonl"
    for path in folder.glob("*/*.h5"):
        before = hash_file(path)
        with h5py.File(path, "r+") as file:
            file["position_m"][:] = file["position_m"][:] + 1e-9
        manifest.write_text(manifest.read_text().replace(before, hash_file(path)))
    found = check_folder(folder, samples=2)
    assert found.problems and all("differs in position_m;" in line for line in found.problems)


def test_a_specification_that_was_changed_is_a_problem(made, tmp_path):
    folder = tmp_path / "copy"
    shutil.copytree(made[0].folder, folder)
    spec = folder / "dataset.toml"
    spec.write_text(spec.read_text().replace("seed = 11", "seed = 12"))
    found = check_folder(folder)
    (problem,) = found.problems
    assert "is not the one that made its shards" in problem and found.n_shards is None and found.remade == 0
    assert found.statistics is not None and f"problem: {problem}" in found.describe()


def test_classes_that_follow_from_the_number_of_the_sample_are_found(tmp_path, monkeypatch):
    leaks = ("seed tells the class: so it does",)
    monkeypatch.setattr(folder_check, "has_forest", lambda: True)
    monkeypatch.setattr(folder_check, "search_fields", lambda _: leaks)

    def make_cyclic(number):
        return replace(make_frame(number), class_id=np.array(number // 2 % 3))

    folder = make_dataset(
        tmp_path / "foreign", {"train": (72, 72), "test": (96,)}, make_cyclic
    )  # two draws of 120 samples
    found = check_folder(folder)
    assert len(found.problems) == 1  # its meshes and scenario are not here
    orders = ("number of a sample", "place of a sample in train", "place of a sample in test")
    assert [line.partition(" tells")[0] for line in found.order_leaks] == [f"the {order}" for order in orders]
    said = "its number modulo 3 predicts it in 100% of 60 samples, and the most frequent class is right in 33%"
    assert said in found.order_leaks[0]
    assert f"warning: {found.order_leaks[0]}" in found.describe() and f"warning: {leaks[0]}" in found.describe()
    monkeypatch.setattr(folder_check, "has_forest", lambda: False)
    without = check_folder(folder)
    assert without.field_leaks is None and "not tested" in without.describe()


@pytest.mark.parametrize(
    ("name", "value", "said"),
    [
        ("classes", "[" * 5000, "recursion"),
        ("classes", '{"a": 1}', "is not a list of names"),
        ("part_classes", "[1]", "is not a list of names"),
        ("model_parts", "[3]", "'list' object has no attribute 'items'"),
        ("symmetries", "{}", "no symmetry of capsule"),
        ("file_sha256", "3", "3 is not a table"),
        ("sensors", '["nope"]', "'nope' doesn't exist"),
    ],
)
def test_a_sensor_file_that_lies_is_damaged(made, tmp_path, name, value, said):
    folder = shutil.copytree(made[0].folder, tmp_path / "copy")
    with h5py.File(folder / "sensor.h5", "r+") as file:
        file.attrs[name] = value
    (folder / "sensor.h5.sha256").unlink()
    with pytest.raises(rl.DatasetError, match="is damaged") as caught:
        check_folder(folder, samples=0)
    assert said in str(caught.value) and "\n" not in str(caught.value)


CODE = """
def drift(t, x, u):
    return [*x[3:], 0.0, 0.0, 0.0]
"""


def test_code_that_a_folder_names_is_not_run_unless_it_is_trusted(tmp_path):
    (tmp_path / "theirs.py").write_text(CODE)
    state = "initial_state=[300, 0, 0, 0, 0, 0]"
    coded = f'target.0.motion={{type="state_space", axes="local", dynamics="theirs.py:drift", {state}}}'
    folder = rl.dataset.make(
        make_spec(tmp_path, view=None, set=(coded,)), tmp_path / "made", workers=1, trust_code=True
    ).folder
    (folder / "theirs.py").write_text('raise SystemExit("it ran")')
    with pytest.raises(
        rl.DatasetError, match=r"names the Python code 'theirs\.py:drift', .* give --trust-code, with --files"
    ):
        check_folder(folder, files=tmp_path)
    assert not check_folder(folder, samples=0).problems
    assert not check_folder(folder, samples=1, files=tmp_path, trust_code=True).problems


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('"path": "test/', '"path": "test/../../', "line . is damaged"),
        ('"path": "test/000000.h5"', '"path": 5', "line . is damaged"),
        ('"frames": ', '"frames": -', "line 1 is damaged"),
        ('"frames": ', '"frames": 1', "and the manifest says 1"),
        ('"versions": "{', '"versions": "[', "line 1 is damaged"),
        ('{"dataset": ', "[" * 100_000, "line 1 is damaged"),
    ],
)
def test_lines_of_the_manifest_that_cannot_be(made, tmp_path, old, new, said):
    folder = tmp_path / "copy"
    shutil.copytree(made[0].folder, folder)
    manifest = folder / "manifest.jsonl"
    text = manifest.read_text()
    assert old in text
    manifest.write_text(text.replace(old, new))
    with pytest.raises(rl.DatasetError, match=said):
        check_folder(folder, samples=0)
