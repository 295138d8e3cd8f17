"""Scores of files of predictions against a dataset in a folder."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from rso_lidar.dataset.drawing.plan import make_plan
from rso_lidar.dataset.drawing.sample import draw_sample
from rso_lidar.dataset.reading.contest_key import CONTEST_SPLIT, read_key
from rso_lidar.dataset.reading.random_access import SPEC_FILE, Dataset
from rso_lidar.dataset.scoring.ground_truth import COLUMNS, MIN_LIT_PIXELS, FrameTruth
from rso_lidar.dataset.scoring.pose_errors import ModelSurface
from rso_lidar.dataset.scoring.prediction_file import PIXELS, PredictionLimits
from rso_lidar.dataset.scoring.prediction_table import Predictions, check_predictions, load_predictions, match_frames
from rso_lidar.dataset.scoring.scorecard import Benchmark, Scorecard, score_run
from rso_lidar.errors import DatasetError, RsoLidarError, warn
from rso_lidar.track import sample_mesh

_ROW_BYTES, _CLASS_BYTES = 4096, 256  # of a row of predictions: all its numbers and texts, and more for each class
_LEAST_HASH = 8  # letters of a dataset's hash that identify it

PredictionSource = str | os.PathLike[str] | Mapping[str, Any]


def score(
    predictions: PredictionSource | Sequence[PredictionSource],
    dataset: Dataset | str | os.PathLike[str],
    split: str = "test",
    *,
    contest: bool = False,
    min_lit_pixels: int = MIN_LIT_PIXELS,
    replicates: int = Scorecard.replicates,
    confidence: float = Scorecard.confidence,
) -> Scorecard:
    """Score predictions on a split of a dataset.

    Parameters
    ----------
    predictions : a CSV, Parquet, NPZ or HDF5 file, or columns by name; several for several training runs of one algorithm
    dataset : an open dataset, or its folder
    split : that is scored; the training split is allowed with a warning
    contest : whether the predictions name test frames as the published folder of a contest does. The dataset is the one with
        the labels and the key
    min_lit_pixels : least number of lit pixels of a frame with a target that counts

    Other Parameters
    ----------------
    replicates : draws of the bootstrap over encounters
    confidence : probability of the intervals

    Returns
    -------
    Scorecard

    Raises
    ------
    DatasetError
        For predictions that are damaged, of another dataset or of another split, and for a contest without its key.
    """
    several = [predictions] if isinstance(predictions, str | os.PathLike | Mapping) else list(predictions)
    if not several:
        raise DatasetError("score: no predictions; give a file")
    opened = dataset if isinstance(dataset, Dataset) else Dataset(dataset)
    if contest and split != CONTEST_SPLIT:
        raise DatasetError(f"score: a contest scores the split '{CONTEST_SPLIT}', not '{split}'; leave the split out")
    if split == "train":
        warn("score: the split 'train' is scored; what an algorithm was trained on does not tell how good it is")
    frames = opened.split(split)
    if split not in opened.labelled_splits:
        raise DatasetError(
            f"{opened.folder}: the labels of '{split}' are hidden; send the predictions to those who published it, or score "
            "by the dataset that has the labels"
        )
    columns = {name: frames.column(name) for name in COLUMNS}
    truth = FrameTruth.from_columns(columns, opened.classes, opened.models, min_lit_pixels)
    others = {name: opened.split(name).column("sample") for name in opened.splits if name != split}
    keys = np.stack([truth.sample, truth.step, truth.draw], axis=1)
    if contest:
        published = read_key(opened.folder).number_frames(truth.sample, truth.draw)
        keys, others = np.stack([published, truth.step, np.zeros_like(published)], axis=1), {}
    runs: list[tuple[Predictions, np.ndarray]] = []
    for number, source in enumerate(several):
        given = _take_predictions(source, number, opened)
        runs.append((given, match_frames(given, keys, others, split)))
    needs_surfaces = any(given.position_m is not None for given, _ in runs)
    benchmark = Benchmark(
        truth=truth,
        pixels=frames,
        part_classes=opened.part_classes,
        surfaces=_sample_surfaces(opened, truth) if needs_surfaces else {},
        symmetries=opened.symmetries,
        identity=opened.constants.sha256,
        split=split,
    )
    run_scores = tuple(score_run(given, rows, benchmark) for given, rows in runs)
    tasks = [tuple(merit.name for merit in run.merits) for run in run_scores]
    for run, names in zip(run_scores, tasks, strict=True):
        if names != tasks[0]:
            raise DatasetError(
                f"{run.name}: predicts other things than {run_scores[0].name}; give runs of one algorithm"
            )
    return Scorecard(benchmark, run_scores, replicates, confidence)


def _take_predictions(given: PredictionSource, number: int, dataset: Dataset) -> Predictions:
    """Load one set of predictions, and check that it is about the dataset."""
    if isinstance(given, Mapping):
        return check_predictions(given, dataset.classes, f"predictions {number + 1}")
    predictions = load_predictions(Path(given), dataset.classes, _find_limits(dataset))
    known = dataset.constants.sha256
    stated = predictions.dataset.strip().lower()
    if stated and (len(stated) < _LEAST_HASH or not known.startswith(stated)):
        raise DatasetError(
            f"{predictions.name}: is about the dataset {stated:.12}, and {dataset.folder} is {known[:12]}; "
            "score it with its own"
        )
    return predictions


def _find_limits(dataset: Dataset) -> PredictionLimits:
    """Return the most that a file of predictions for a dataset holds: each frame once, and its images of 64 bits."""
    frames = dataset.split(dataset.splits[0])
    images = frames.read([0], [name for name in PIXELS if name in frames.names])
    row_bytes = _ROW_BYTES + _CLASS_BYTES * len(dataset.classes) + sum(8 * image.size for image in images.values())
    return PredictionLimits.of(sum(record.frames for record in dataset.records), row_bytes)


def _sample_surfaces(dataset: Dataset, truth: FrameTruth) -> dict[int, ModelSurface]:
    """Sample the surface of each model of a split, from the first sample that has it.

    Returns
    -------
    Surfaces by number of the model; none, with a warning, where the meshes cannot be found.
    """
    try:
        plan = make_plan(dataset.folder / SPEC_FILE)
        if plan.sha256 != dataset.constants.sha256:
            raise DatasetError(f"{dataset.folder}: a mesh or {SPEC_FILE} has changed since it was made")
        surfaces = {}
        for model in np.unique(truth.model_id[truth.model_id >= 0]).tolist():
            sample = draw_sample(plan, int(truth.sample[np.flatnonzero(truth.model_id == model)[0]]))
            if sample.target is not None:
                surfaces[model] = ModelSurface(sample_mesh(sample.scenario.corners_of(sample.target)))
    except RsoLidarError as error:
        warn(f"score: no ADD and ADD-S without the models' surfaces ({error})")
        return {}
    return surfaces
