"""Frames one by one: names, descriptions, groups and the choice of arrays."""

import json

import numpy as np
import pytest

from rso_lidar.dataset.conversion.frame_batches import (
    BATCH,
    choose_images,
    divide,
    read_batches,
    read_frames,
)
from rso_lidar.errors import DatasetError


def test_frames_come_in_the_order_of_the_split(data):
    frames = list(read_frames(data, "train", ["range_m"]))
    split = data.split("train")
    assert [int(frame.numbers["frame_number"]) for frame in frames] == split.column("frame_number").tolist()
    np.testing.assert_array_equal(np.stack([frame.images["range_m"] for frame in frames]), split.column("range_m"))


def test_a_name_is_sample_step_and_draw(data):
    names = [frame.name for split in data.splits for frame in read_frames(data, split, [])]
    assert names[:3] == ["00000000-0000-00", "00000000-0000-01", "00000001-0000-00"]
    assert len(set(names)) == len(names) == 10


def test_a_description_is_json_with_names(data):
    relay, cube, _, nothing = list(read_frames(data, "train", []))[:4]
    assert relay.words == {"split": "train", "class": "relay", "model": "tdrs", "sensor": "sensor"}
    assert cube.words["model"] == "cubesat_6u"
    description = json.loads(json.dumps(nothing.description, allow_nan=False))
    assert description["class"] is None and description["class_id"] == -1 and description["range_to_target_m"] is None
    assert description["position_m"] == [None, None, None] and description["seed"] == 2**53 + 3


def test_batches_are_small_and_end_with_the_shard(data):
    assert BATCH < 256
    assert [len(batch["sample"]) for batch in read_batches(data.split("train"), ["sample"])] == [4, 2]


def test_a_pass_over_all_frames_keeps_one_shard_open(data):
    split = data.split("train")
    split.read([0, 5], ["range_m"])
    assert len(split._files) == 2
    for _ in read_batches(split, ["range_m"]):
        assert len(split._files) == 1


def test_groups_hold_all_frames_once():
    groups = [list(group) for group in divide(iter(range(10)), 4)]
    assert groups == [[0, 1, 2, 3], [4, 5, 6, 7], [8, 9]]
    assert list(divide(iter([]), 4)) == []


def test_images_are_chosen_by_name(data):
    split = data.split("train")
    assert set(choose_images(split, [])) == {"range_m", "intensity_counts", "saturated", "target", "part_class_id"}
    assert choose_images(split, ["photons"]) == ["photons"]
    assert set(choose_images(split, ["all"])) > {"photons", "true_range_m", "part"}
    with pytest.raises(DatasetError, match=r"photon: no such images; did you mean 'photons'\? \(known: "):
        choose_images(split, ["photon"])
    with pytest.raises(DatasetError, match="class_id: no such images"):
        choose_images(split, ["class_id"])


def test_usual_images_include_those_of_cameras(paired):
    chosen = choose_images(paired[0].split("train"), [])
    fields = ("intensity_counts", "part_class_id", "target")
    of_cameras = [f"camera.{camera}.{field}" for camera in ("eye", "nav") for field in fields]
    assert [name for name in chosen if name.startswith("camera.")] == of_cameras and "range_m" in chosen
