"""Predictions of an algorithm, checked, and matched with the frames that they are about."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from rso_lidar.dataset.scoring.prediction_file import PIXELS, PredictionLimits, read_columns
from rso_lidar.errors import DatasetError, did_you_mean, warn

KEYS = ("sample", "step", "draw")
_POSE = ("x_m", "y_m", "z_m", "qx", "qy", "qz", "qw")
_SCORE = "score."
_MOST = 1e12  # of a number of a pose


@dataclass(frozen=True, eq=False)
class Predictions:
    """Predictions, one row per frame; what an algorithm does not predict is None.

    `keys` (frame, 3) are sample, step and draw. `class_id` (frame) is the predicted class, -1 for none, and `class_scores`
    (frame, class) are scores of the classes. `present_score` (frame) is the confidence that a target is in the frame.
    `position_m` and `quaternion_xyzw` are the pose lidar_from_target, NaN for none. `pixels` holds arrays
    (frame, row, col) by name.
    """

    name: str
    keys: np.ndarray
    class_id: np.ndarray | None
    class_scores: np.ndarray | None
    present_score: np.ndarray | None
    position_m: np.ndarray | None
    quaternion_xyzw: np.ndarray | None
    pixels: Mapping[str, Any]
    dataset: str = ""


def load_predictions(path: str | Path, classes: Sequence[str], most: PredictionLimits | None = None) -> Predictions:
    """Load a file of predictions and check it.

    Parameters
    ----------
    path : of a CSV, Parquet, NPZ or HDF5 file
    most : that the file may hold (None: 1 GiB of columns)

    Raises
    ------
    DatasetError
        For a file that cannot be read, an unknown class, a number that is not finite, or a frame that occurs twice.
    """
    columns, identity = read_columns(Path(path)) if most is None else read_columns(Path(path), most)
    return check_predictions(columns, classes, str(path), identity)


def check_predictions(
    columns: Mapping[str, Any], classes: Sequence[str], name: str = "predictions", dataset: str = ""
) -> Predictions:
    """Check columns of predictions.

    Parameters
    ----------
    dataset : identity of the dataset that they are about; empty if it is not known

    Raises
    ------
    DatasetError
        As `load_predictions`.
    """
    _check_names(columns, classes, name)
    size = len(columns["sample"])
    keys = np.stack(
        [_read_whole(columns[key], key, name) if key in columns else np.zeros(size, np.int64) for key in KEYS], axis=1
    )
    _check_duplicates(keys, name)
    scores = None
    if any(column.startswith(_SCORE) for column in columns):
        scores = np.stack(
            [
                _read_numbers(columns[f"{_SCORE}{class_name}"], f"{_SCORE}{class_name}", name, keys)
                for class_name in classes
            ],
            axis=1,
        )
    chosen = _read_classes(columns["class"], classes, name, keys) if "class" in columns else None
    if chosen is None and scores is not None:
        chosen = scores.argmax(axis=1) if size else np.zeros(0, np.int64)
    position_m = quaternion_xyzw = None
    if "x_m" in columns:
        position_m, quaternion_xyzw = _read_pose(columns, name, keys)
    for layer in PIXELS:
        if layer in columns and (kind := getattr(columns[layer], "dtype", np.dtype(object))).kind not in "biuf":
            raise DatasetError(f"{name}: {layer} has values of {kind}; give an array of real numbers")
    return Predictions(
        name=name,
        keys=keys,
        class_id=chosen,
        class_scores=scores,
        present_score=_read_numbers(columns["present"], "present", name, keys) if "present" in columns else None,
        position_m=position_m,
        quaternion_xyzw=quaternion_xyzw,
        pixels={layer: columns[layer] for layer in PIXELS if layer in columns},
        dataset=dataset,
    )


def match_frames(
    predictions: Predictions, truth_keys: np.ndarray, others: Mapping[str, np.ndarray], split: str
) -> np.ndarray:
    """Find the row of the prediction of each frame.

    Parameters
    ----------
    truth_keys : (frame, 3) sample, step and draw of the frames of the split
    others : (sample) samples of the other splits, by name

    Returns
    -------
    Rows (frame), -1 where the prediction is missing.

    Raises
    ------
    DatasetError
        If a prediction is of another split, or of no frame at all.
    """
    rows = {key: number for number, key in enumerate(map(tuple, predictions.keys.tolist()))}
    matched_rows = np.array([rows.pop(key, -1) for key in map(tuple, truth_keys.tolist())], dtype=np.int64)
    if rows:
        key = next(iter(rows))
        for other, samples in others.items():
            if key[0] in set(samples.tolist()):
                raise DatasetError(
                    f"{predictions.name}: {describe_frame(key)} is of the split '{other}', and the split '{split}' is "
                    f"scored; predict the frames of '{split}' only"
                )
        raise DatasetError(
            f"{predictions.name}: {describe_frame(key)} is not in the dataset ({len(rows):,} such rows); is it another one?"
        )
    return matched_rows


def describe_frame(key: Sequence[int]) -> str:
    """Format the identity of a frame.

    >>> describe_frame((12, 0, 1))
    'sample 12, step 0, draw 1'
    """
    return ", ".join(f"{name} {value}" for name, value in zip(KEYS, key, strict=True))


def _check_names(columns: Mapping[str, Any], classes: Sequence[str], name: str) -> None:
    """Check the names of columns, and warn of those that are not read."""
    if "sample" not in columns:
        guess = did_you_mean("sample", columns)
        raise DatasetError(f"{name}: no column 'sample'{guess}; it identifies the frame, with 'step' and 'draw'")
    scored = [column.removeprefix(_SCORE) for column in columns if column.startswith(_SCORE)]
    for class_name in scored:
        if class_name not in classes:
            raise DatasetError(
                f"{name}: {_SCORE}{class_name}: unknown class '{class_name}'{did_you_mean(class_name, classes)} "
                f"(known: {', '.join(classes)})"
            )
    for class_name in classes if scored else ():
        if class_name not in scored:
            raise DatasetError(
                f"{name}: no column '{_SCORE}{class_name}'; give one for each class, 0 for one never predicted"
            )
    pose = [column for column in _POSE if column in columns]
    lacking = [column for column in _POSE if column not in columns]
    if pose and lacking:
        raise DatasetError(f"{name}: has {pose[0]} but no {lacking[0]}; a pose needs {', '.join(_POSE)}")
    known = {*KEYS, *_POSE, *PIXELS, "class", "present", *(f"{_SCORE}{class_name}" for class_name in classes)}
    ignored = [column for column in columns if column not in known]
    if not (set(columns) & known) - set(KEYS):
        guess = next((suggestion for column in ignored if (suggestion := did_you_mean(column, sorted(known)))), "")
        raise DatasetError(f"{name}: predicts nothing{guess}; add class, score.<class>, present, a pose or pixels")
    if ignored:
        guess = next(
            (suggestion for column in ignored if (suggestion := did_you_mean(column, sorted(known - set(columns))))), ""
        )
        warn(f"{name}: ignored: {', '.join(ignored)}{guess}")


def _check_duplicates(keys: np.ndarray, name: str) -> None:
    """Refuse a frame that occurs twice."""
    order = np.lexsort(keys.T[::-1])
    same = np.flatnonzero((keys[order][1:] == keys[order][:-1]).all(axis=1))
    if len(same):
        raise DatasetError(f"{name}: {describe_frame(keys[order[same[0]]].tolist())} occurs twice; keep one row")


def _read_whole(values: Any, column: str, name: str) -> np.ndarray:
    """Return a column of whole numbers."""
    numbers = _convert(values, column, name)
    bad = np.flatnonzero(~(np.isfinite(numbers) & (numbers == np.trunc(numbers)) & (np.abs(numbers) < 2**53)))
    if len(bad):
        raise DatasetError(f"{name}: row {bad[0] + 1}: {column} is {numbers[bad[0]]:g}; give a whole number")
    return numbers.astype(np.int64)


def _read_numbers(values: Any, column: str, name: str, keys: np.ndarray) -> np.ndarray:
    """Return a column of finite numbers; keys (frame, 3) name the frame of an error."""
    numbers = _convert(values, column, name)
    bad = np.flatnonzero(~np.isfinite(numbers))
    if len(bad):
        raise DatasetError(
            f"{name}: {describe_frame(keys[bad[0]].tolist())}: {column} is {numbers[bad[0]]:g}; give a finite number, or "
            "leave the row out (it counts as a failure)"
        )
    return numbers


def _convert(values: Any, column: str, name: str) -> np.ndarray:
    """Return a column as numbers; an empty cell is NaN."""
    cells = np.asarray(values)
    if cells.ndim != 1:
        raise DatasetError(f"{name}: {column} has shape {cells.shape}; give one number for each frame")
    if cells.dtype.kind in "biuf":
        return cells.astype(float)
    texts = ["nan" if cell is None else str(cell).strip() or "nan" for cell in cells.tolist()]
    try:
        return np.array(texts, dtype=float)
    except ValueError:
        for row, text in enumerate(texts, 1):
            try:
                float(text)
            except ValueError:
                raise DatasetError(f"{name}: row {row}: {column} is '{text:.40}'; give a number") from None
        raise


def _read_classes(values: Any, classes: Sequence[str], name: str, keys: np.ndarray) -> np.ndarray:
    """Return numbers of classes from their names; an empty name is -1."""
    numbers = {class_name: number for number, class_name in enumerate(classes)} | {"": -1}
    words = ["" if cell is None else str(cell).strip() for cell in np.asarray(values).tolist()]
    for word, key in zip(words, keys.tolist(), strict=True):
        if word not in numbers:
            raise DatasetError(
                f"{name}: {describe_frame(key)}: unknown class '{word:.60}'{did_you_mean(word, classes)} (known: "
                f"{', '.join(classes)})"
            )
    return np.array([numbers[word] for word in words], dtype=np.int64)


def _read_pose(columns: Mapping[str, Any], name: str, keys: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return positions (frame, 3) and unit quaternions (frame, 4); NaN where a row gives none."""
    values = np.stack([_convert(columns[column], column, name) for column in _POSE], axis=1)
    known = np.isfinite(values)
    for bad, what in (
        ((np.abs(values) > _MOST).any(axis=1), "has a pose that is not finite, or too large"),
        (known.any(axis=1) & ~known.all(axis=1), "has a part of a pose"),
        (
            known.all(axis=1) & (np.linalg.norm(np.clip(np.nan_to_num(values[:, 3:]), -1, 1), axis=1) < 1e-6),
            "has a quaternion of zero",
        ),
    ):
        if bad.any():
            key = keys[np.flatnonzero(bad)[0]].tolist()
            raise DatasetError(
                f"{name}: {describe_frame(key)} {what}; give all of {', '.join(_POSE)}, or leave them empty (a failure)"
            )
    quaternion = values[:, 3:] / np.linalg.norm(values[:, 3:], axis=1, keepdims=True)
    return values[:, :3], quaternion
