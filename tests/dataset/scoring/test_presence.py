import numpy as np
import pytest

from rso_lidar.dataset import Scorecard
from rso_lidar.dataset.scoring.prediction_table import check_predictions
from rso_lidar.dataset.scoring.presence import score_presence
from rso_lidar.dataset.scoring.scorecard import score_run
from tests.dataset.scoring.frames import by_name, columns_of, make_benchmark, make_card, make_truth


def test_a_perfect_detector_and_one_that_guesses():
    truth = make_truth(400, empty=150)
    assert (truth.present == 0).sum() == 150
    sure = by_name(make_card(truth, {"present": truth.present.astype(float)}))
    assert sure["presence_average_precision"].value.value == 1.0
    assert sure["presence_roc_area"].value.value == 1.0 and sure["false_alarms_at_recall_95"].value.value == 0.0
    guess = by_name(make_card(truth, {"present": np.random.default_rng(0).random(400)}))
    assert guess["presence_average_precision"].value.value == pytest.approx(250 / 400, abs=0.06)
    assert guess["presence_roc_area"].value.value == pytest.approx(0.5, abs=0.08)
    assert guess["false_alarms_at_recall_95"].value.value == pytest.approx(0.95, abs=0.06)


def test_a_missing_frame_is_a_failure_whatever_it_holds():
    truth = make_truth(40, empty=20)
    columns = {name: values[1:-1] for name, values in (columns_of(truth) | {"present": truth.present * 1.0}).items()}
    given = check_predictions(columns, truth.classes)
    rows = np.concatenate([[-1], np.arange(38), [-1]])  # one frame with a target and one without are missing
    card = Scorecard(make_benchmark(truth), (score_run(given, rows, make_benchmark(truth)),), 100)
    found = by_name(card)
    # one threshold finds 19 of 20 targets, and the empty frame that outranks them
    assert found["presence_average_precision"].value.value == pytest.approx(19 / 20 * 19 / 20)
    assert found["false_alarms_at_recall_95"].value.value == pytest.approx(1 / 20)


def test_targets_without_light_do_not_matter():
    truth = make_truth(40, empty=20)
    truth.lit_pixels[:5] = 0
    score = np.where(np.arange(40) < 5, -1.0, truth.present.astype(float))
    found = score_presence(truth, score)
    assert found.merits[0].statistic.evaluate(np.ones((1, 40)))[0] == 1.0
    assert found.merits[0].statistic.count() == (35, 35)
