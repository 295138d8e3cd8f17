import dataclasses

import numpy as np
import pytest

from rso_lidar.dataset.metrics.resampling import EncounterIndex
from rso_lidar.dataset.scoring.classification import PassingLevel
from tests.dataset.scoring.frames import CLASSES, by_name, guess_classes, make_card, make_truth


def one_hot(truth, chosen):
    return {f"score.{name}": (np.asarray(chosen) == k).astype(float) for k, name in enumerate(truth.classes)}


def test_a_perfect_classifier():
    truth = make_truth(60, draws=2)
    card = make_card(truth, one_hot(truth, truth.class_id))
    found = by_name(card)
    for name in ("accuracy", "balanced_accuracy", "macro_average_precision", "recall.tdrs", "precision.dawn"):
        assert found[name].value.value == 1.0
    # no failure in 60 encounters, not in 120 frames
    assert found["accuracy"].value.low == pytest.approx(0.9398, abs=1e-4) and found["accuracy"].value.high == 1.0
    assert found["accuracy"].value.frames == 120 and found["accuracy"].value.encounters == 60
    counts = card.confusions[0].counts[0]
    assert np.array_equal(counts[:, :-1], np.diag(np.bincount(truth.class_id))) and not counts[:, -1].any()
    assert found["pixels_for_recall_90"].value.value == truth.lit_pixels.min()


def test_chance_and_permuted_classes():
    truth = make_truth(3000)
    rng = np.random.default_rng(1)
    card = make_card(truth, {f"score.{name}": rng.random(3000) for name in CLASSES}, replicates=100)
    found = by_name(card)
    assert found["accuracy"].value.value == pytest.approx(1 / 3, abs=0.03)
    assert found["macro_average_precision"].value.value == pytest.approx(1 / 3, abs=0.03)
    assert found["pixels_for_recall_90"].value.value == np.inf
    shifted = by_name(make_card(truth, one_hot(truth, (truth.class_id + 1) % 3), replicates=100))
    assert shifted["accuracy"].value.value == 0.0 and shifted["recall.juno"].value.value == 0.0


def test_balanced_accuracy_weighs_classes_alike():
    truth = make_truth(90)
    truth = dataclasses.replace(truth, class_id=np.where(np.arange(90) < 80, 0, 1))
    found = by_name(make_card(truth, {"class": np.full(90, "dawn")}))
    assert found["accuracy"].value.value == pytest.approx(80 / 90)
    assert found["balanced_accuracy"].value.value == pytest.approx(0.5)
    assert "macro_average_precision" not in found  # classes alone have no ranking
    assert not np.isfinite(found["precision.juno"].value.value)  # juno was never predicted


def test_frames_without_light_do_not_matter():
    truth = make_truth(40)
    truth = dataclasses.replace(truth, lit_pixels=np.where(np.arange(40) < 10, 0, truth.lit_pixels))
    columns = {"class": np.array(CLASSES)[np.where(np.arange(40) < 10, (truth.class_id + 1) % 3, truth.class_id)]}
    assert by_name(make_card(truth, columns))["accuracy"].value.value == 1.0
    everything = dataclasses.replace(truth, min_lit_pixels=0)
    assert by_name(make_card(everything, columns))["accuracy"].value.value == pytest.approx(30 / 40)


def test_recall_is_binned_by_lit_pixels_range_and_light():
    truth = make_truth(400)
    near = truth.range_to_target_m < 800.0
    chosen = np.where(near, truth.class_id, (truth.class_id + 1) % 3)
    card = make_card(truth, {"class": np.array(CLASSES)[chosen]})
    by_quantity = {bins.quantity: (bins, values["all classes"]) for bins, values in card.binned}
    assert set(by_quantity) == {"lit_pixels", "range", "total_photons"}
    bins, values = by_quantity["range"]
    assert sum(one.frames for one in values) == 400
    assert values[0].value == 1.0 and values[-1].value == 0.0 and np.all(np.diff(bins.edges) > 0)
    ranges = card.confusions[1]
    assert ranges.quantity == "range" and ranges.counts.sum() == 400
    assert np.trace(ranges.counts[0]) == ranges.counts[0].sum() and np.trace(ranges.counts[-1]) == 0


@pytest.mark.parametrize("threshold", [20.0, 100.0])
def test_the_level_at_which_recall_passes_is_found(threshold):
    rng = np.random.default_rng(3)
    lit = np.exp(rng.uniform(0.0, np.log(2000.0), 2000))
    hit = rng.random(2000) < np.where(lit < threshold, 0.6, 0.97)
    statistic = PassingLevel(EncounterIndex(np.arange(2000)), lit, hit, np.ones(2000, bool))
    assert statistic.evaluate(np.ones((1, 2000)))[0] == pytest.approx(threshold, rel=0.1)


def test_a_level_that_a_few_lucky_frames_reach_is_not_reached():
    lit = np.arange(1.0, 201.0)
    hit = np.arange(200) % 2 == 0
    hit[-5:] = True
    statistic = PassingLevel(EncounterIndex(np.arange(200)), lit, hit, np.ones(200, bool))
    assert statistic.evaluate(np.ones((1, 200)))[0] == np.inf
    nothing = PassingLevel(EncounterIndex(np.arange(200)), lit, hit, np.zeros(200, bool))
    assert np.isnan(nothing.evaluate(np.ones((1, 200)))[0])


def test_several_runs_have_a_mean_and_a_spread():
    truth = make_truth(300)
    rng = np.random.default_rng(9)
    runs = [{"class": guess_classes(truth, share, rng)} for share in (0.7, 0.8, 0.9)]
    card = make_card(truth, *runs)
    alone = [by_name(make_card(truth, run))["accuracy"].value.value for run in runs]
    found = by_name(card)["accuracy"]
    assert found.of_runs == pytest.approx(alone) and found.value.value == pytest.approx(np.mean(alone))
    assert found.spread == pytest.approx(np.std(alone, ddof=1))
    assert found.value.low < found.value.value < found.value.high
    assert card.confusions[0].counts.sum() == 900
    values = {bins.quantity: of["all classes"] for bins, of in card.binned}["range"]
    assert np.average([one.value for one in values], weights=[one.frames for one in values]) == pytest.approx(
        np.mean(alone)
    )
