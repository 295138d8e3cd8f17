import numpy as np
import pytest

from rso_lidar.dataset.metrics.precision_recall import AveragePrecision, FalseAlarmRate, RocArea
from rso_lidar.dataset.metrics.resampling import EncounterIndex


def rank(kind, score, positive, asked=None):
    score, positive = np.asarray(score, float), np.asarray(positive, bool)
    asked = np.ones(len(score), bool) if asked is None else np.asarray(asked, bool)
    return kind(EncounterIndex(np.arange(len(score))), score, positive, asked)


def value(kind, score, positive, asked=None):
    return rank(kind, score, positive, asked).evaluate(np.ones((1, len(score))))[0]


def test_average_precision_by_hand():
    # ranked: + - + + -, precisions at the positives 1, 2/3, 3/4
    assert value(AveragePrecision, [0.9, 0.8, 0.7, 0.6, 0.1], [1, 0, 1, 1, 0]) == pytest.approx((1 + 2 / 3 + 3 / 4) / 3)
    # a tie of + and - is retrieved at once: precision 1/2, then 2/3
    assert value(AveragePrecision, [0.9, 0.9, 0.5], [1, 0, 1]) == pytest.approx(0.5 * 0.5 + 0.5 * 2 / 3)


def test_perfect_and_reversed_rankings():
    positive = [1, 1, 0, 0, 0, 0]
    assert value(AveragePrecision, [6, 5, 4, 3, 2, 1], positive) == 1.0
    assert value(AveragePrecision, [1, 2, 3, 4, 5, 6], positive) == pytest.approx((1 / 5 + 2 / 6) / 2)
    assert value(RocArea, [6, 5, 4, 3, 2, 1], positive) == 1.0 and value(RocArea, [1, 2, 3, 4, 5, 6], positive) == 0.0
    assert value(FalseAlarmRate, [6, 5, 4, 3, 2, 1], positive) == 0.0


def test_scores_without_information():
    positive = np.arange(4000) % 4 == 0
    constant = np.zeros(4000)
    assert value(AveragePrecision, constant, positive) == pytest.approx(0.25)
    assert value(RocArea, constant, positive) == pytest.approx(0.5)
    assert value(FalseAlarmRate, constant, positive) == 1.0
    shuffled = np.random.default_rng(2).permutation(4000)
    assert value(AveragePrecision, shuffled, positive) == pytest.approx(0.25, abs=0.03)
    assert value(RocArea, shuffled, positive) == pytest.approx(0.5, abs=0.03)
    assert value(FalseAlarmRate, shuffled, positive) == pytest.approx(0.95, abs=0.03)


def test_only_the_order_of_scores_matters():
    rng = np.random.default_rng(4)
    score, positive = rng.normal(size=200), rng.random(200) < 0.3
    for kind in (AveragePrecision, RocArea, FalseAlarmRate):
        assert value(kind, score, positive) == value(kind, np.exp(3.0 * score), positive)


def test_missing_predictions_are_never_retrieved():
    assert value(AveragePrecision, [0.9, -np.inf], [1, 1]) == pytest.approx(0.5)
    assert value(RocArea, [0.9, -np.inf, 0.1], [1, 1, 0]) == pytest.approx(0.5)
    assert value(FalseAlarmRate, [0.9, -np.inf, 0.1], [1, 1, 0]) == 1.0
    assert value(FalseAlarmRate, [-np.inf, -np.inf], [1, 0]) == 1.0
    assert value(AveragePrecision, [-np.inf, -np.inf], [1, 0]) == 0.0
    curve = rank(AveragePrecision, [0.9, -np.inf, 0.1], [1, 1, 0]).trace()
    assert curve.recall.tolist() == [0.0, 0.5, 0.5] and curve.precision.tolist() == [1.0, 1.0, 0.5]


def test_frames_that_are_not_asked_for_do_not_matter():
    score, positive, asked = [0.9, 0.8, 0.7, 0.6], [1, 0, 1, 0], [1, 0, 1, 1]
    assert value(AveragePrecision, score, positive, asked) == 1.0
    assert rank(AveragePrecision, score, positive, asked).count() == (3, 3)
    assert np.isnan(value(AveragePrecision, score, [0, 0, 0, 0]))
    assert np.isnan(value(RocArea, score, [1, 1, 1, 1]))


def test_a_weight_is_a_number_of_copies():
    rng = np.random.default_rng(6)
    score, positive = rng.integers(0, 12, 30).astype(float), rng.random(30) < 0.4
    encounters = EncounterIndex(np.repeat(np.arange(15), 2))
    drawn = np.concatenate([*encounters.draw(30)])
    for kind in (AveragePrecision, RocArea, FalseAlarmRate):
        values = kind(encounters, score, positive, np.ones(30, bool)).evaluate(drawn)
        for weights, found in zip(drawn, values, strict=True):
            copies = np.repeat(np.arange(30), weights[encounters.index].astype(int))
            assert found == pytest.approx(value(kind, score[copies], positive[copies]))


def test_they_are_those_of_scikit_learn():
    metrics = pytest.importorskip("sklearn.metrics", reason="needs scikit-learn: pip install scikit-learn")
    rng = np.random.default_rng(7)
    for levels in (5, 40, 10**6):  # with many ties, some, and none
        score = rng.integers(0, levels, 300).astype(float)
        positive = rng.random(300) < 0.2 + 0.5 * score / levels
        assert value(AveragePrecision, score, positive) == pytest.approx(
            metrics.average_precision_score(positive, score)
        )
        assert value(RocArea, score, positive) == pytest.approx(metrics.roc_auc_score(positive, score))
        rates, recalls, _ = metrics.roc_curve(positive, score, drop_intermediate=False)
        assert value(FalseAlarmRate, score, positive) == pytest.approx(rates[recalls >= 0.95].min())
        curve = rank(AveragePrecision, score, positive).trace()
        precision, recall, _ = metrics.precision_recall_curve(positive, score)
        assert curve.precision[1:] == pytest.approx(precision[-2::-1]) and curve.recall[1:] == pytest.approx(
            recall[-2::-1]
        )
