"""Fields that tell a label are found; random ones, and those that only tell the split, are not."""

import numpy as np
import pytest

from rso_lidar.dataset import open as open_dataset
from rso_lidar.dataset.checking import field_leaks
from rso_lidar.dataset.checking.field_leaks import find_field_leaks
from tests.dataset.written_for_tests import make_dataset, make_frame

pytest.importorskip("sklearn", reason="needs the extra learn: pip install 'rso-lidar[learn]'")
COUNT = 400
SPLIT = np.repeat([0, 1], COUNT // 2)


def draw_labels(rng):
    return {
        "class": rng.integers(0, 7, COUNT),
        "range": rng.random((COUNT, 1)),
        "attitude": rng.normal(size=(COUNT, 9)),
    }


@pytest.mark.parametrize("seed", range(2))
def test_random_fields_tell_nothing(seed):
    rng = np.random.default_rng(seed)
    fields = {"sample": rng.permutation(COUNT), "time_s": rng.random(COUNT), "constant": np.ones(COUNT)}
    assert not find_field_leaks(fields, draw_labels(rng), SPLIT)


def test_each_leak_is_named():
    rng = np.random.default_rng(0)
    labels = draw_labels(rng)
    fields = {
        "sample": labels["class"] + 7 * rng.permutation(COUNT),
        "time_s": labels["range"][:, 0] * 50.0 + rng.normal(size=COUNT),
        "seed": (labels["attitude"][:, 2] * 1e6).astype(np.int64),
        "draw": rng.integers(0, 2, COUNT),
    }
    lines = find_field_leaks(fields, labels, SPLIT)
    tells = [line.partition(":")[0] for line in lines]
    assert tells == ["sample tells the class", "time_s tells the range", "seed tells the attitude"]
    assert "a forest predicts it in 9" in lines[0] or "in 100%" in lines[0]


def test_a_field_that_tells_only_the_split_is_no_leak():
    rng = np.random.default_rng(1)
    group = np.where(SPLIT == 0, rng.integers(0, 3, COUNT), rng.integers(3, 6, COUNT))  # unseen craft in the test
    fields = {"size of the file": np.where(SPLIT == 0, 900, 700) + rng.integers(0, 9, COUNT)}
    assert not find_field_leaks(fields, {"model": group}, SPLIT)
    assert find_field_leaks({"seed": group * 100}, {"model": group}, SPLIT)


def test_a_folder_whose_times_tell_the_range_is_warned_of(tmp_path, monkeypatch):
    monkeypatch.setattr(field_leaks, "_TREES", 4)
    monkeypatch.setattr(field_leaks, "_NAMED", ("sample", "time_s", "intrinsics_px"))
    folder = make_dataset(tmp_path / "foreign", {"train": (240,)}, make_frame)  # each frame later and farther
    lines = field_leaks.search_fields(open_dataset(folder))
    assert any(line.startswith("time_s tells the range") for line in lines)


def test_exposures_are_fields_unless_the_camera_chooses_them(paired):
    named = field_leaks._list_image_fields(paired[0])
    assert named == [
        *(f"camera.nav.{field}" for field in ("start_s", "intrinsics_px")),
        *(f"camera.eye.{field}" for field in ("start_s", "intrinsics_px", "exposure_s")),
    ]
