"""Counts of frames by class, split and reporting pixels."""

import numpy as np

from rso_lidar.dataset.publication.card_tables import NO_TARGET, PIXEL_STEPS, count_frames


def test_frames_by_class_and_split(data):
    counts = count_frames(data)
    assert counts.by_class == {
        "train": {"relay": 3, "cube": 2, NO_TARGET: 1},
        "test": {"relay": 2, "cube": 1, NO_TARGET: 1},
    }
    assert counts.frames == {"train": 6, "test": 4}


def test_frames_by_reporting_pixels_leave_out_those_without_a_target(data):
    counts = count_frames(data)
    assert PIXEL_STEPS == (0, 1, 10, 100, 1000)
    assert counts.by_pixels == {"train": (0, 5, 0, 0, 0), "test": (0, 3, 0, 0, 0)}


def test_ranges_by_class(data):
    ranges_m = count_frames(data).ranges_m
    assert np.allclose(ranges_m["relay"], [np.sqrt(100.0**2 + 5), np.sqrt(900.0**2 + 5)])
    assert np.allclose(ranges_m["cube"], [np.sqrt(200.0**2 + 5), np.sqrt(1000.0**2 + 5)])
