"""Statistics of labels compare independent samples."""

import numpy as np

from rso_lidar.dataset.checking.statistics import LabelStatistics


def test_frames_of_one_encounter_are_not_taken_for_many():
    """Forty encounters of 64 frames, whose ranges differ by class as chance has it."""
    rng = np.random.default_rng(6)
    frames, encounters = 64, 40
    owner = np.repeat(np.tile([0, 1], encounters // 2), frames)
    range_m = np.repeat(rng.uniform(100.0, 900.0, encounters), frames)
    count = len(owner)
    columns = {
        "class_id": owner,
        "present": np.ones(count),
        "range_to_target_m": range_m,
        "lit_pixels": np.full(count, 50),
        "reporting_pixels": np.full(count, 50),
        "total_photons": np.full(count, 1e4),
        "position_m": np.column_stack([0.01 * range_m * rng.normal(size=count), np.zeros(count), range_m]),
        "intrinsics_px": np.tile([3000.0, 3000.0, 63.5, 63.5], (count, 1)),
        "step": np.tile(np.arange(frames), encounters),
        "draw": np.zeros(count),
    }
    assert not LabelStatistics(columns, ("a", "b")).warn()
    every = columns | {"step": np.zeros(count)}
    assert any("range tells the class" in line for line in LabelStatistics(every, ("a", "b")).warn())
