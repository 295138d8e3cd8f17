"""Statistics of labels compare independent samples."""

import numpy as np

from rso_lidar.dataset.checking.folder_check import collect_statistics
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


def test_images_that_show_nothing_of_the_target_are_warned_of(paired):
    statistics = collect_statistics(paired[0])
    lines = [line.split() for line in statistics.tabulate()]
    table = next(k for k, words in enumerate(lines) if words[:2] == ["camera", "nav"])
    assert lines[table + 1][:2] == ["plate", "6"] and lines[table + 2][:2] == ["round", "6"]
    images = {"target_pixels": 100, "target_electrons": 1e4, "full_pixels": 49}
    count = len(statistics.columns["present"])
    drawn = statistics.columns | {"camera.0.exposure_ms": np.linspace(1.0, 2.0, count)}  # a field, and no camera "0"
    assert {*LabelStatistics(drawn, statistics.classes).cameras} == {"nav", "eye"}
    seen = statistics.columns | {f"camera.nav.{name}": np.full(count, value) for name, value in images.items()}
    assert not any("camera nav" in line for line in LabelStatistics(seen, statistics.classes).warn())
    dark = seen | {"camera.nav.target_electrons": np.full(count, 99.0)}
    blind = seen | {"camera.nav.target_pixels": np.zeros(count, int), "camera.nav.full_pixels": np.zeros(count, int)}
    white = seen | {"camera.nav.full_pixels": np.full(count, 50)}
    for columns, words in ((dark, "less than 1 electron"), (blind, "see nothing"), (white, "are full")):
        (line,) = (line for line in LabelStatistics(columns, statistics.classes).warn() if "camera nav" in line)
        assert "100.0% of the images" in line and words in line
