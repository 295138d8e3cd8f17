"""Recordings travel to other processes, which open the file again."""

import multiprocessing
import os
import pickle
from pathlib import Path

import numpy as np
import pytest

import rso_lidar as rl
from rso_lidar.errors import RecordingError
from tests.export.frames_for_tests import KEEP, make_frames

COUNT = 6


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    made = tmp_path_factory.mktemp("pickled") / "kept.h5"
    rl.save(made, make_frames(COUNT, keep=KEEP))
    return made


def sum_frames(recording, array, frames):
    """Return what a process finds in a recording, one of its arrays and some of its frames, and its number."""
    first = np.nansum(recording[2].observation.reading.range_m)
    return (
        float(first),
        float(np.nansum(array[3])),
        len(frames),
        float(np.nansum(frames[0].labels.photons)),
        os.getpid(),
    )


def test_another_process_opens_a_recording_of_its_own(path, monkeypatch):
    monkeypatch.chdir(path.parent)
    with rl.open(path.name) as recording:
        given = recording, recording.range_m, recording[1:4]
        monkeypatch.chdir("/")
        with multiprocessing.get_context("spawn").Pool(1) as pool:
            there = pool.apply(sum_frames, given)
        here = sum_frames(*given)
    assert there[:-1] == here[:-1]
    assert there[-1] != here[-1]


def test_a_copy_reads_what_the_original_does(path):
    with rl.open(path) as recording:
        copy = pickle.loads(pickle.dumps(recording))
        assert len(copy) == COUNT and copy.kept == recording.kept
    for one in (copy, copy.labels.range_m, copy.prediction.range_sigma_m):
        assert len(one) == COUNT  # the first is closed, its copy is not
    np.testing.assert_array_equal(copy.range_m[4], pickle.loads(pickle.dumps(copy.range_m))[4])
    copy.close()
    with pytest.raises(RecordingError, match="is closed; open it again"):
        pickle.dumps(copy)


def test_a_copy_of_a_file_that_lost_frames_is_refused(path, tmp_path):
    """A growing file may gain frames, which the copy does not show."""
    with rl.open(path) as recording:
        recording._count = COUNT - 2
        assert len(pickle.loads(pickle.dumps(recording))) == COUNT - 2
        recording._count = COUNT + 1
        dumped = pickle.dumps(recording)
    with pytest.raises(RecordingError, match=f"has {COUNT} frames and had {COUNT + 1} in another process"):
        pickle.loads(dumped)
    moved = tmp_path / Path(path).name
    path.rename(moved)
    try:
        with pytest.raises(RecordingError, match="there is no such file"):
            pickle.loads(dumped)
    finally:
        moved.rename(path)
