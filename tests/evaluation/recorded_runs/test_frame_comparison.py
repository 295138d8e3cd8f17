"""Frames of two seeds differ by the noise of both."""

from dataclasses import replace

import numpy as np
import pytest

import rso_lidar as rl
from rso_lidar.errors import RecordingError

APPROACH = rl.Scenario.load("examples/tdrs_approach.toml")


@pytest.fixture(scope="module")
def frames():
    """Return the last frame of the approach with two seeds."""
    return [next(iter(rl.simulate(APPROACH.replace(seed=seed), frames=[539]))) for seed in (1, 2)]


def test_a_frame_does_not_differ_from_itself(frames):
    found = rl.study.compare_frames(frames[0], frames[0])
    assert (found.both, found.first_only, found.second_only) == (int(frames[0].valid.sum()), 0, 0)
    assert found.rms_range_m == found.robust_range_m == found.std_counts == 0.0


def test_the_difference_of_two_seeds_has_the_noise_of_both(frames):
    found = rl.study.compare_frames(*frames)
    assert found.both + found.first_only == frames[0].valid.sum()
    assert found.both + found.second_only == frames[1].valid.sum()
    errors_m = [np.asarray(one.range_m, float) - one.labels.range_m for one in frames]
    both = frames[0].valid & frames[1].valid & (frames[0].labels.target >= 0)
    robust_m = [1.4826 * np.nanmedian(np.abs(one[both] - np.nanmedian(one[both]))) for one in errors_m]
    # Independent noise: variances add. The median absolute deviation of n samples has a relative error of 1.17 / sqrt(n).
    assert found.robust_range_m == pytest.approx(np.hypot(*robust_m), rel=5 * 1.17 / np.sqrt(both.sum()) * np.sqrt(2))
    assert "Reported by both" in found.describe()


def test_frames_of_other_sizes_are_refused(frames):
    receiver = APPROACH.lidar.receiver.replace(n_rows=64, n_cols=64)
    small = APPROACH.replace(lidar=APPROACH.lidar.replace(receiver=receiver))
    with pytest.raises(RecordingError, match="128 x 128 and 64 x 64"):
        rl.study.compare_frames(frames[0], next(iter(rl.simulate(small, frames=[539]))))


def test_frames_without_returns_in_common_have_no_statistics(frames):
    nothing = replace(frames[0].observation.reading, range_m=np.full_like(frames[0].range_m, np.nan))
    empty = replace(frames[0], observation=replace(frames[0].observation, reading=nothing))
    compared = rl.study.compare_frames(frames[0], empty)
    assert (compared.both, compared.first_only, compared.second_only) == (0, frames[0].valid.sum(), 0)
    assert np.isnan([compared.mean_range_m, compared.rms_range_m, compared.robust_range_m, compared.std_counts]).all()
    assert len(compared.describe().splitlines()) == 1
