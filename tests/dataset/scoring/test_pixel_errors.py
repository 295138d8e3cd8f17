import numpy as np
import pytest

from rso_lidar.dataset.scoring.pixel_errors import PartCounts, RangeErrors, score_parts, score_ranges
from rso_lidar.dataset.scoring.prediction_table import check_predictions
from rso_lidar.dataset.scoring.scorecard import score_run
from rso_lidar.errors import RsoLidarError
from tests.dataset.scoring.frames import columns_of, make_benchmark, make_truth


class Pixels:
    """Arrays of frames, read as those of a split are."""

    def __init__(self, **arrays):
        self.arrays = arrays

    def read(self, rows, names):
        return {name: self.arrays[name][rows] for name in names}


def values_of(scores, count):
    return {merit.name: merit.statistic.evaluate(np.ones((1, count)))[0] for merit in scores.merits}


def test_overlap_by_hand():
    truth = make_truth(2)
    counts = PartCounts(2, ("bus", "wing", "boom"))
    true = np.array([[[0, 0], [1, -1]], [[1, 1], [1, 0]]])
    called = np.array([[[0, 1], [1, 0]], [[1, 1], [0, 0]]])
    reported = np.array([[[1, 1], [1, 1]], [[1, 0], [1, 1]]], bool)
    counts.add(np.arange(2), called, true, reported)
    found = values_of(score_parts(truth, counts, np.zeros(2, bool)), 2)
    # bus: both 2, there 3, called 4; wing: both 2, there 3, called 3; boom is nowhere
    assert found["iou.bus"] == pytest.approx(2 / 5) and found["iou.wing"] == pytest.approx(2 / 4)
    assert found["mean_iou"] == pytest.approx((2 / 5 + 2 / 4) / 2) and "iou.boom" not in found
    assert found["pixel_accuracy"] == pytest.approx(4 / 7)


def test_a_missing_frame_has_no_right_pixel():
    truth = make_truth(2)
    counts = PartCounts(2, ("bus",))
    true = np.array([[[0, -1]], [[0, -1]]])
    counts.add(np.arange(2), np.array([[[0, -1]], [[-1, -1]]]), true, np.ones((2, 1, 2), bool))
    found = values_of(score_parts(truth, counts, np.array([False, True])), 2)
    assert found == {"mean_iou": 0.5, "pixel_accuracy": 0.5, "iou.bus": 0.5}


def test_ranges_by_hand():
    truth = make_truth(2)
    errors = RangeErrors(2)
    nan = np.nan
    true = np.array([[[10.0, 11.0], [nan, nan]], [[20.0, 21.0], [22.0, nan]]])
    found = np.array([[[10.3, nan], [5.0, nan]], [[20.0, 20.6], [22.0, nan]]])
    errors.add(np.arange(2), found, true)
    errors.add_photons(np.arange(2), np.array([[[3.0, 0.0]], [[nan, 0.0]]]), np.array([[[3.0, 4.0]], [[0.0, 0.0]]]))
    values = values_of(score_ranges(truth, errors), 2)
    assert values["fine_range_rms"] == pytest.approx(np.sqrt((0.09 + 0.16) / 4))
    assert values["fine_range_median"] == pytest.approx(0.5 * (0.3 + 0.0))
    assert values["fine_coverage"] == pytest.approx(4 / 5) and values["fine_silhouette_iou"] == pytest.approx(4 / 6)
    assert values["fine_photons_relative_rms"] == pytest.approx(4.0 / 5.0)


def test_the_median_of_a_frame_is_that_of_sizes_and_not_the_size_of_the_median():
    errors = RangeErrors(1)
    errors.add(np.array([0]), np.array([[[9.6, 10.1, 10.2]]]), np.full((1, 1, 3), 10.0))
    assert errors.median_m == pytest.approx([0.2])


def test_pixels_are_read_from_the_rows_of_their_frames():
    truth = make_truth(90)
    rng = np.random.default_rng(0)
    true = rng.integers(-1, 2, (90, 4, 4)).astype(np.int8)
    benchmark = make_benchmark(
        truth,
        pixels=Pixels(part_class_id=true, range_m=np.where(true >= 0, 100.0, np.nan).astype("f4")),
        part_classes=("bus", "wing"),
    )
    order = rng.permutation(90)[:80]
    columns = {name: values[order] for name, values in columns_of(truth).items()}
    given = check_predictions(columns | {"part_class_id": true[order]}, truth.classes)
    rows = np.full(90, -1)
    rows[order] = np.arange(80)
    found = values_of(score_run(given, rows, benchmark).parts, 90)
    lost = np.setdiff1d(np.arange(90), order)
    assert found["pixel_accuracy"] == pytest.approx(1.0 - (true[lost] >= 0).sum() / (true >= 0).sum())
    wings = (true == 1).sum()
    assert found["iou.wing"] == pytest.approx(1.0 - (true[lost] == 1).sum() / wings)
    for bad, words in (
        (np.full((80, 4, 4), 2, np.int8), "to 2; give 0 to 1, and -1"),
        (true[order][:, :2], "give (frame, 4, 4)"),
    ):
        wrong = check_predictions(columns | {"part_class_id": bad}, truth.classes)
        with pytest.raises(RsoLidarError) as caught:
            score_run(wrong, rows, benchmark)
        assert words in str(caught.value)


def test_fine_ranges_are_read_too():
    truth = make_truth(70)
    fine = np.random.default_rng(0).uniform(10.0, 20.0, (70, 6, 6)).astype("f4")
    benchmark = make_benchmark(truth, pixels=Pixels(oversampled_range_m=fine))
    given = check_predictions(columns_of(truth) | {"oversampled_range_m": fine + np.float32(0.5)}, truth.classes)
    found = values_of(score_run(given, np.arange(70), benchmark).ranges, 70)
    assert found["fine_range_rms"] == pytest.approx(0.5, abs=1e-5) and found["fine_coverage"] == 1.0
    with pytest.raises(RsoLidarError, match="holds no oversampled_range_m"):
        score_run(given, np.arange(70), make_benchmark(truth))
