"""Frames of two seeds differ by the noise of both."""

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
    empty = APPROACH.replace(lidar=APPROACH.lidar.replace(laser=APPROACH.lidar.laser.replace(energy_mj=1e-6)))
    found = rl.study.compare_frames(frames[0], next(iter(rl.simulate(empty, frames=[0]))))
    assert found.both == 0 or np.isfinite(found.mean_range_m)
    assert found.both > 0 or (np.isnan(found.mean_range_m) and len(found.describe().splitlines()) == 1)
