"""Frames for data loaders: the order of visits, random numbers by epoch, other processes, PyTorch and Hugging Face."""

import multiprocessing
import pickle
import subprocess
import sys
from types import SimpleNamespace

import numpy as np
import pytest

import rso_lidar as rl
from rso_lidar.dataset.torch import (
    CropReturns,
    FrameDataset,
    FrameSampler,
    MirrorImages,
    PointCloud,
    QuarterTurns,
    Visit,
    stack_frames,
    to_tensors,
)

FIELDS = ("range_m", "intensity_counts", "class_id")


@pytest.fixture(scope="module")
def train(made):
    return made[0].split("train")


class Shift:
    """Shifts the range of a frame by a random number."""

    needs = ("range_m", "sample")

    def __call__(self, frame, rng):
        return frame | {"range_m": frame["range_m"] + np.float32(rng.random())}


def test_frames_are_those_of_the_split(train):
    frames = FrameDataset(train, FIELDS)
    assert len(frames) == len(train)
    wanted = train.read([3, 0, 5], FIELDS)
    for k, frame in enumerate(frames.__getitems__([3, 0, 5])):
        assert tuple(frame) == FIELDS
        for name in FIELDS:
            np.testing.assert_array_equal(frame[name], wanted[name][k])
    np.testing.assert_array_equal(frames[-1]["range_m"], train[len(train) - 1]["range_m"])


def test_what_only_a_transform_needs_is_not_returned(made, train):
    frames = FrameDataset(train, ("class_id",), transforms=[CropReturns(16), PointCloud.of(made[0], 32)])
    assert set(frames[0]) == {"class_id", "image", "cloud_m", "center_m", "returns"}
    with pytest.raises(rl.DatasetError, match="did you mean 'range_m'"):
        FrameDataset(train, ("rang_m",))


def test_plain_functions_change_frames(train):
    def halve(frame):
        return frame | {"range_m": 0.5 * frame["range_m"], "half": np.float32(2.0)}

    def shift(frame, rng):
        frame["range_m"] = frame["range_m"] + np.float32(rng.random())
        return frame

    frames = FrameDataset(train, ("range_m",), augmentations=[shift], transforms=[CropReturns(16), halve], seed=3)
    row = int(train.column("reporting_pixels").argmax())
    frame, plain = frames[Visit(row, 0)], train.read([row], ("range_m",))["range_m"][0]
    assert set(frame) == {"range_m", "image", "half"} and frame["half"] == 2.0  # not the counts that the crop needs
    shifts = 2.0 * frame["range_m"] - plain
    assert 0.0 < np.nanmin(shifts) and np.nanmax(shifts) - np.nanmin(shifts) < 1e-4
    assert stack_frames(frames.__getitems__([0, 1]))["half"].shape == (2,)


@pytest.mark.parametrize(
    ("transforms", "said"),
    [
        (lambda frame: frame, r"^transforms: is <function .*; give a list of functions"),
        (3, r"^transforms: is 3; give a list"),
        ([CropReturns], r"^transforms\[0\]: is the class CropReturns; give an object of it"),
        (
            [CropReturns(), "range_m"],
            r"^transforms\[1\]: is 'range_m', which is no function; give one that takes a frame",
        ),
        ([CropReturns(needs="range_m")], r"^transforms\[0\]: its needs is 'range_m'; give a tuple"),
        ([lambda frame: None], r"^transforms\[0\]: returned None, not a frame"),
        ([lambda frame: {}], r"^transforms\[0\]: returned a frame without 'class_id'; return all arrays"),
    ],
)
def test_what_is_no_transform_is_refused_in_one_line(train, transforms, said):
    with pytest.raises(rl.DatasetError, match=said) as caught:
        FrameDataset(train, ("class_id",), transforms=transforms)[0]
    assert "\n" not in str(caught.value)


def test_random_numbers_follow_from_seed_epoch_and_frame(train):
    other, row = np.argsort(train.column("reporting_pixels"))[-2:].tolist()
    frames = FrameDataset(train, FIELDS, augmentations=[Shift()], seed=5)
    again = pickle.loads(pickle.dumps(frames))

    def read(source, *visits):
        return [frame["range_m"] for frame in source.__getitems__(list(visits))]

    first, second = read(frames, Visit(row, 0), Visit(other, 0))
    np.testing.assert_array_equal(read(again, Visit(other, 0))[0], second)
    np.testing.assert_array_equal(read(again, Visit(row, 0))[0], first)
    plain = train.read([row], ("range_m",))["range_m"][0]
    shift = np.nanmean(first - plain)
    others = [
        np.nanmean(read(frames, Visit(row, 1))[0] - plain),
        np.nanmean(read(FrameDataset(train, FIELDS, augmentations=[Shift()]), Visit(row, 0))[0] - plain),
        np.nanmean(read(frames, row)[0] - plain),
        np.nanmean(read(frames, row)[0] - plain),
    ]
    assert len({round(float(value), 4) for value in (shift, *others)}) == 5


class TestFrameSampler:
    SPLIT = SimpleNamespace(records=[SimpleNamespace(frames=n) for n in (5, 7, 3, 6, 4)])

    @pytest.mark.parametrize("shuffle", ["frames", "shards", "none"])
    def test_every_frame_once_in_each_epoch(self, shuffle):
        sampler = FrameSampler(self.SPLIT, shuffle, seed=3, shards_at_once=2)
        first, second = list(sampler), list(sampler)
        for epoch, visits in enumerate((first, second)):
            assert sorted(visit.frame for visit in visits) == list(range(25)) and len(sampler) == 25
            assert {visit.epoch for visit in visits} == {epoch}
        assert ([v.frame for v in first] == [v.frame for v in second]) == (shuffle == "none")
        sampler.set_epoch(1)
        assert list(sampler) == second
        assert list(FrameSampler(self.SPLIT, shuffle, seed=3, shards_at_once=2)) == first

    def test_few_shards_are_visited_at_a_time(self):
        ends = np.cumsum([record.frames for record in self.SPLIT.records])
        order = FrameSampler(self.SPLIT, "shards", shards_at_once=2).order(0)
        shard = np.searchsorted(ends, order, side="right")
        last = {k: int(np.flatnonzero(shard == k).max()) for k in range(5)}
        first = {k: int(np.flatnonzero(shard == k).min()) for k in range(5)}
        assert sorted(first, key=first.__getitem__) != list(range(5))
        open_at_once = max(sum(first[k] <= at <= last[k] for k in range(5)) for at in range(25))
        assert open_at_once == 2

    def test_what_cannot_be(self):
        with pytest.raises(rl.DatasetError, match="is none of frames, shards, none"):
            FrameSampler(self.SPLIT, "all")
        with pytest.raises(rl.DatasetError, match="take at least 1"):
            FrameSampler(self.SPLIT, "shards", shards_at_once=0)


def sum_ranges(frames, index):
    return float(np.nansum(frames[index]["range_m"]))


def test_another_process_opens_files_of_its_own(train):
    frames = FrameDataset(train, FIELDS)
    here = sum_ranges(frames, 4)  # with an open file
    with multiprocessing.get_context("spawn").Pool(1) as pool:
        assert pool.apply(sum_ranges, (frames, 4)) == here


def test_nothing_imports_torch():
    code = "import sys, rso_lidar, rso_lidar.dataset.torch; sys.exit('torch' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_a_data_loader_of_pytorch(train):
    torch = pytest.importorskip("torch", reason="needs the extra learn: pip install 'rso-lidar[learn]'")
    frames = FrameDataset(train, FIELDS, transforms=[CropReturns(16)], augmentations=[Shift()])
    read = []
    for workers in (0, 1):
        order = FrameSampler(train, seed=1)
        loader = torch.utils.data.DataLoader(
            frames, 4, sampler=order, num_workers=workers, collate_fn=to_tensors, persistent_workers=workers > 0
        )
        read.append([list(loader), list(loader)])
    for one, two in zip(*read, strict=True):
        assert len(one) == len(two) == -(-len(train) // 4)
        for alone, parallel in zip(one, two, strict=True):
            assert set(alone) == {*FIELDS, "image"}
            for name, values in alone.items():
                torch.testing.assert_close(values, parallel[name], equal_nan=True, rtol=0, atol=0)
            assert alone["intensity_counts"].dtype == torch.int32 and alone["image"].shape[1:] == (3, 16, 16)
    plain = torch.utils.data.DataLoader(FrameDataset(train, ("range_m", "class_id")), 4, shuffle=True)
    assert sum(len(batch["class_id"]) for batch in plain) == len(train)


def test_batches_without_torch(train):
    batch = stack_frames(FrameDataset(train, FIELDS).__getitems__([0, 1, 2]))
    assert batch["range_m"].shape == (3, 16, 16) and batch["class_id"].shape == (3,)


def test_hugging_face_reads_shards_without_our_code(made, train, tmp_path):
    datasets = pytest.importorskip("datasets", reason="needs datasets: pip install datasets")
    files = {name: str(made[0].folder / name / "*.h5") for name in made[0].splits}
    for streaming in (False, True):
        loaded = datasets.load_dataset("hdf5", data_files=files, cache_dir=str(tmp_path), streaming=streaming)
        assert set(loaded) == set(made[0].splits)
        rows = list(loaded["train"].with_format("numpy"))
        assert len(rows) == len(train)
        for name in ("range_m", "class_id", "quaternion_xyzw", "sample", "box_px"):
            found = np.stack([np.asarray(row[name]) for row in rows])
            np.testing.assert_allclose(found, train.column(name), rtol=1e-6, equal_nan=True)


def test_a_plain_function_sees_images_of_cameras(paired):
    split = paired[0].split("train")
    frames = FrameDataset(
        split,
        ("range_m", "camera.nav.intensity_counts", "class_id"),
        transforms=[lambda frame: frame | {"bright": frame["camera.nav.intensity_counts"].max()}],
    )
    batch = stack_frames([frames[k] for k in range(len(frames))])
    assert np.array_equal(batch["bright"], split.column("camera.nav.intensity_counts").max(axis=(1, 2, 3)))


@pytest.mark.parametrize("change", [QuarterTurns(), MirrorImages()])
def test_turns_of_the_lidars_images_refuse_those_of_cameras(paired, change):
    fields = ("range_m", "camera.nav.target_pixels")
    with pytest.raises(rl.DatasetError, match=r"camera\.nav\.target_pixels would not fit"):
        FrameDataset(paired[0].split("train"), fields, augmentations=[change])
