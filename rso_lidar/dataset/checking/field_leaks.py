"""Leaks of fields: where numbers that only name or place a frame tell its class, range, attitude or place in the image.

A forest learns with one half of the samples to predict a label from one field, and predicts the other half. How well the
predictions agree with these labels is compared with their agreement when labels are exchanged among samples of a split. If a
field tells nothing, all exchanges are equally likely, whatever the forest learned: the probability of a false alarm is exact
(permutation test; Good, "Permutation, Parametric and Bootstrap Tests of Hypotheses", 2005).
"""

from __future__ import annotations

import importlib.util
import json
from collections.abc import Mapping, Sequence

import numpy as np

from rso_lidar.dataset.reading.random_access import Dataset, Split
from rso_lidar.dataset.shards.layout import name_camera_array

_NAMED = ("sample", "step", "draw", "seed", "frame_number", "time_s", "sensor_id", "intrinsics_px")
_LABELS = ("class_id", "model_id", "range_to_target_m", "quaternion_xyzw", "position_m")
_CHANCE = 1e-3  # of a false alarm in a whole check, over all fields and labels
_MOST_SAMPLES = 2000  # that are tested, so that a check takes seconds
_LEAST_SAMPLES = 24  # with a label; assumed: fewer teach a forest nothing
_MOST_PERIOD = 64  # of the remainders of whole numbers that a forest is shown; assumed
_TREES, _LEAST_IN_LEAF = 32, 3  # assumed
_FIRST_EXCHANGES = 99  # after which most fields without a leak are done
_BLOCK = 500  # exchanges in memory at once


def has_forest() -> bool:
    """Return whether the library of the forest, scikit-learn, is installed."""
    return importlib.util.find_spec("sklearn") is not None


def search_fields(dataset: Dataset) -> list[str]:
    """Find fields of a dataset that tell a label: its identities, times and sensors, and its files and places in them.

    One frame of each sample is tested, chosen at random.

    Returns
    -------
    One line for each field and label.
    """
    rng = np.random.default_rng(0)
    fields = (*_NAMED, *_list_image_fields(dataset))
    tables = [_read_fields(dataset.split(name), fields, rng) for name in dataset.labelled_splits]
    if not tables:
        return []
    columns = {name: np.concatenate([table[name] for table in tables]) for name in tables[0]}
    split = np.repeat(np.arange(len(tables)), [len(table["sample"]) for table in tables])
    focal_px, center_px = columns["intrinsics_px"][:, :2], columns["intrinsics_px"][:, 2:]
    with np.errstate(invalid="ignore", divide="ignore"):
        along = columns["position_m"]
        labels = {
            "class": columns.pop("class_id"),
            "model": columns.pop("model_id"),
            "range": np.log(columns.pop("range_to_target_m"))[:, None],
            "attitude": _make_matrices(columns.pop("quaternion_xyzw")),
            "place in the image": along[:, :2] / along[:, 2:] * focal_px / (center_px + 0.5),  # 1 at the edge
        }
    del columns["position_m"]
    if len(np.unique(labels["model"])) == len(np.unique(labels["class"])):
        del labels["model"]  # each class is one model
    return find_field_leaks(columns, labels, split)


def _list_image_fields(dataset: Dataset) -> list[str]:
    """List the fields of the cameras beside the lidar. An auto exposure is a reading, which may depend on the target."""
    fields = []
    for name in dataset.cameras:
        tables = [json.loads(cameras[name].table) for cameras in dataset.constants.cameras.values()]
        is_reading = any("auto_exposure" in table for table in tables)
        named = ("start_s", "intrinsics_px") if is_reading else ("start_s", "intrinsics_px", "exposure_s")
        fields += [name_camera_array(name, field) for field in named]
    return fields


def _read_fields(split: Split, fields: Sequence[str], rng: np.random.Generator) -> dict[str, np.ndarray]:
    """Read the fields and labels of one random frame of each sample of a split."""
    columns = {name: split.column(name) for name in (*fields, *_LABELS)}
    frames = [record.frames for record in split.records]
    status = [(split.folder / record.path).stat() for record in split.records]
    listed = {
        "number of the file": np.arange(len(frames)),
        "size of the file": np.array([entry.st_size for entry in status]),
        "time of the file": np.array([entry.st_mtime for entry in status]),
    }
    columns |= {name: np.repeat(values, frames) for name, values in listed.items()}
    columns["place in the file"] = np.concatenate([np.arange(count) for count in frames])
    order = rng.permutation(len(split))
    _, first = np.unique(columns["sample"][order], return_index=True)
    return {name: values[order[first]] for name, values in columns.items()}


def _make_matrices(quaternion_xyzw: np.ndarray) -> np.ndarray:
    """Return the elements (sample, 9) of rotation matrices of quaternions (sample, 4), NaN where these are."""
    from scipy.spatial.transform import Rotation

    matrices = np.full((len(quaternion_xyzw), 9), np.nan)
    known = np.isfinite(quaternion_xyzw).all(axis=1)
    if known.any():
        matrices[known] = Rotation.from_quat(quaternion_xyzw[known]).as_matrix().reshape(-1, 9)
    return matrices


def find_field_leaks(
    fields: Mapping[str, np.ndarray], labels: Mapping[str, np.ndarray], split: np.ndarray
) -> list[str]:
    """Find fields from which a forest predicts labels.

    Parameters
    ----------
    fields : numbers (sample) or short vectors (sample, component) by name
    labels : whole numbers of groups (sample), or vectors (sample, component) of floats, NaN where a sample has none, by name
    split : (sample) number of the split, within which labels are exchanged

    Returns
    -------
    One line for each field and label.
    """
    varied = {name: values for name, values in fields.items() if len(values) and np.any(values != values[:1])}
    level = _CHANCE / max(1, len(varied) * len(labels))
    lines = []
    for name, values in varied.items():
        features = _list_features(values)
        for label, truth in labels.items():
            line = _test_field(features, truth, split, level)
            if line:
                lines.append(f"{name} tells the {label}: {line}; keep it from what learns, and from a contest")
    return lines


def _list_features(values: np.ndarray) -> np.ndarray:
    """Return what a forest is shown of a field (sample, feature).

    These are its values, how many samples share them and the gap to the next lower one, and remainders of whole numbers.
    """
    features = []
    for column in np.atleast_2d(values.T):
        levels, place, counts = np.unique(column, return_inverse=True, return_counts=True)
        gaps = np.diff(levels.astype(float), prepend=float(levels[0]))
        features += [place.astype(float), counts[place].astype(float), gaps[place]]
        if column.dtype.kind in "iu":
            features += [(column % period).astype(float) for period in range(2, _MOST_PERIOD + 1)]
    return np.stack(features, axis=1)


def _test_field(features: np.ndarray, truth: np.ndarray, split: np.ndarray, level: float) -> str:
    """Return how well features (sample, feature) predict a label, or an empty text where that may be chance."""
    from sklearn.ensemble import ExtraTreesRegressor

    is_group = truth.ndim == 1
    rows = np.flatnonzero(np.isfinite(truth if is_group else truth.sum(axis=1)))
    if len(rows) < _LEAST_SAMPLES:
        return ""
    rng = np.random.default_rng(0)
    rows = rng.permutation(rows)[:_MOST_SAMPLES]  # the halves depend on no label
    targets = (truth[rows, None] == np.unique(truth[rows])).astype(float) if is_group else truth[rows].astype(float)
    spread = targets.std(axis=0)
    if not spread.any():
        return ""
    targets = (targets - targets.mean(axis=0))[:, spread > 0] / (1.0 if is_group else spread[spread > 0])
    half = len(rows) // 2
    rest = half + np.argsort(split[rows[half:]], kind="stable")
    forest = ExtraTreesRegressor(_TREES, min_samples_leaf=_LEAST_IN_LEAF, max_features=0.4, random_state=0)
    forest.fit(features[rows[:half]], targets[:half].squeeze())
    predicted = forest.predict(features[rows[rest]]).reshape(len(rest), -1)
    true, ends = targets[rest], np.unique(split[rows[rest]], return_counts=True)[1].cumsum()
    if not _is_beyond_chance(predicted - predicted.mean(axis=0), true, ends, level, rng):
        return ""
    if is_group:
        hits = np.mean(predicted.argmax(axis=1) == true.argmax(axis=1))
        guess = np.bincount(true.argmax(axis=1)).max() / len(true)
        return f"a forest predicts it in {hits:.0%} of {len(true):,} samples, and the most frequent is right in {guess:.0%}"
    together = np.corrcoef(predicted.ravel(), true.ravel())[0, 1]
    return f"predictions of a forest for {len(true):,} samples have the correlation {together:.2f} with it"


def _is_beyond_chance(
    predicted: np.ndarray, true: np.ndarray, ends: np.ndarray, level: float, rng: np.random.Generator
) -> bool:
    """Return whether predictions agree with the truth better than with any of so many exchanged truths that `level` is kept.

    Parameters
    ----------
    predicted, true : (sample, component), the first with mean zero
    ends : (split) number of samples of each split and of all before it, within which truths are exchanged
    """
    agreement = predicted @ true.T  # (sample, exchanged sample)
    own, sample, left = float(np.trace(agreement)), np.arange(len(true)), int(np.ceil(1.0 / level))
    for block in (_FIRST_EXCHANGES, *[_BLOCK] * -(-left // _BLOCK)):
        parts = np.split(sample, ends[:-1])
        order = np.hstack([rng.permuted(np.tile(part, (block, 1)), axis=1) for part in parts])
        if np.any(agreement[sample, order].sum(axis=1) >= own):
            return False
    return True
