"""Truth of made-up frames, and predictions of made-up algorithms, for tests of scores."""

import numpy as np

from rso_lidar.dataset import Scorecard
from rso_lidar.dataset.scoring.ground_truth import FrameTruth
from rso_lidar.dataset.scoring.prediction_table import check_predictions
from rso_lidar.dataset.scoring.scorecard import Benchmark, score_run

CLASSES = ("dawn", "juno", "tdrs")


def make_truth(encounters=60, draws=1, empty=0, seed=0, classes=CLASSES):
    """Make the truth of some encounters, each with `draws` frames, the last `empty` of them without a target."""
    rng = np.random.default_rng(seed)
    sample = np.repeat(np.arange(encounters) * 3 + 1, draws)
    count = len(sample)
    class_id = np.repeat(rng.integers(0, len(classes), encounters), draws)
    class_id[sample >= sample.max() - 3 * empty + 1] = -1 if empty else class_id[-1]
    there = class_id >= 0
    range_m = np.repeat(np.exp(rng.uniform(np.log(100.0), np.log(3000.0), encounters)), draws)
    lit = np.where(there, np.ceil(3e7 / range_m**2 * 0.03).clip(1, 16384), 0).astype(int)
    quaternion = np.repeat(rng.normal(size=(encounters, 4)), draws, axis=0)
    quaternion /= np.linalg.norm(quaternion, axis=1, keepdims=True)
    position = np.stack([0.02 * range_m, -0.01 * range_m, range_m], axis=1)
    return FrameTruth(
        sample=sample,
        step=np.zeros(count, int),
        draw=np.tile(np.arange(draws), encounters),
        class_id=class_id,
        model_id=class_id.copy(),
        present=there.astype(np.uint8),
        range_to_target_m=np.where(there, range_m, np.nan),
        lit_pixels=lit,
        reporting_pixels=lit,
        total_photons=lit * 40.0,
        position_m=np.where(there[:, None], position, np.nan),
        quaternion_xyzw=np.where(there[:, None], quaternion, np.nan),
        classes=tuple(classes),
        models=tuple(classes),
    )


def columns_of(truth):
    """Return the columns that identify frames."""
    return {"sample": truth.sample, "step": truth.step, "draw": truth.draw}


def make_benchmark(truth, **more):
    """Make a benchmark of a truth without pixels."""
    parts = {"pixels": None, "part_classes": (), "surfaces": {}, "symmetries": [None] * len(truth.models)} | more
    return Benchmark(truth=truth, identity="f00d", split="test", **parts)


def make_card(truth, *runs, replicates=400, **more):
    """Score columns of predictions, one mapping for each run."""
    benchmark = make_benchmark(truth, **more)
    made = []
    for number, columns in enumerate(runs):
        given = check_predictions(columns_of(truth) | columns, truth.classes, f"run {number}")
        made.append(score_run(given, np.arange(len(truth)), benchmark))
    return Scorecard(benchmark, tuple(made), replicates)


def guess_classes(truth, right, rng):
    """Return names of classes that are right with probability `right` (a number, or one for each encounter)."""
    lucky = rng.random(len(truth)) < np.asarray(right)
    other = (truth.class_id + rng.integers(1, len(truth.classes), len(truth))) % len(truth.classes)
    return np.array(truth.classes)[np.where(lucky, truth.class_id, other)]


def by_name(card):
    """Return the scored figures of merit by name."""
    return {merit.name: merit for merit in card.merits}
