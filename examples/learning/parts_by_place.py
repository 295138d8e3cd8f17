"""Predict the common part class of each return from its place on the craft and its neighbours, with a random forest.

Each return is described by its place along the principal axes of the craft [m], its distance and offset in range from the
middle, its brightness and that of its neighbours, how flat and how tilted the surface is there, and the shape features of
the whole frame. `python examples/learning/parts_by_place.py FOLDER --runs 5 -o place.npz`
"""

from pathlib import Path

import numpy as np
from arguments import parse, run
from frames import Returns, load_returns
from predictions import write
from scipy.spatial import cKDTree
from shape import measure_shape

import rso_lidar as rl

LABEL = "part_class_id"
NEIGHBOURS = 9  # returns of a surface about each, itself included: 3 x 3 pixels
MOST_OF_A_CLASS = 6000  # returns to train on, so that solar arrays, 60 % of all, do not drown the rest
TREES = 60


def measure_places(returns: Returns) -> np.ndarray:
    """Return features (return, feature) of the returns of all frames."""
    whole = np.nan_to_num(measure_shape(returns), nan=-1.0)
    blocks = [
        np.column_stack([_measure(returns, k), np.repeat(whole[k : k + 1], n, axis=0)]).astype(np.float32)
        for k, n in enumerate(returns.count)
        if n
    ]
    return np.concatenate(blocks)


def _measure(returns: Returns, frame: int) -> np.ndarray:
    point = returns.point_m[returns.of(frame)].astype(float)
    far, off = np.linalg.norm(point, axis=1), point - point.mean(axis=0)
    along = off @ np.linalg.eigh(off.T @ off / len(point))[1][:, ::-1]
    along *= np.where((along**3).sum(axis=0) < 0.0, -1.0, 1.0)  # the longer tail is ahead
    count = min(len(point), NEIGHBOURS)
    distance, near = (part.reshape(len(point), -1) for part in cKDTree(point).query(point, k=count))
    around = point[near] - point[near].mean(axis=1, keepdims=True)
    spread, axes = np.linalg.eigh(np.einsum("nki,nkj->nij", around, around) / count)
    facing = np.abs(np.einsum("ni,ni->n", axes[:, :, 0], point / far[:, None]))
    bright = np.log(returns.intensity[returns.of(frame)]) + 2.0 * np.log(np.median(far) / 1000.0)
    return np.column_stack(
        [
            along, np.abs(along), np.linalg.norm(off, axis=1), far - np.median(far), bright, bright[near].mean(axis=1),
            bright - np.median(bright), np.sqrt(np.maximum(spread, 0.0)), facing, distance[:, -1],
        ]
    )  # fmt: skip


def choose_returns(label: np.ndarray, classes: int, seed: int) -> np.ndarray:
    """Choose returns to train on: at most `MOST_OF_A_CLASS` of each part class.

    Parameters
    ----------
    label : part class (return), -1 for none.
    classes : number of part classes.
    seed : of the choice.
    """
    rng = np.random.default_rng(seed)
    return np.concatenate([rng.permutation(np.flatnonzero(label == k))[:MOST_OF_A_CLASS] for k in range(classes)])


def main() -> None:
    from sklearn.ensemble import ExtraTreesClassifier

    options = parse(__doc__, draws=True, runs=True)
    data, path = rl.dataset.open(options.dataset), Path(options.output)
    train = load_returns(options.dataset, "train", (LABEL,), options.most, options.draws)
    test = load_returns(options.dataset, "test", (LABEL,), options.most)
    train = train.take(np.flatnonzero(train.has_craft))
    features, asked = measure_places(train), measure_places(test)
    label, classes = train.labels[LABEL], len(data.part_classes)
    shape = data.split("test").read([0], ["range_m"])["range_m"].shape[1:]
    on_target = test.labels[LABEL] >= 0
    share = np.bincount(label[label >= 0], minlength=classes)
    for seed in range(options.seed, options.seed + options.runs):
        chosen = choose_returns(label, classes, seed)
        forest = ExtraTreesClassifier(TREES, min_samples_leaf=3, max_features=0.3, random_state=seed)
        forest.fit(features[chosen], label[chosen])
        # The square root of how much more frequent a class is than in training, as in the weights of parts.py.
        weight = np.sqrt(share[forest.classes_] / np.bincount(label[chosen], minlength=classes)[forest.classes_])
        named = forest.classes_[(forest.predict_proba(asked) * weight).argmax(axis=1)]
        print(f"part of {(named == test.labels[LABEL])[on_target].mean():.1%} of {on_target.sum():,} returns named")
        maps = np.full((len(test), *shape), -1, np.int8)
        maps[(np.repeat(np.arange(len(test)), test.count), *test.pixel.T)] = named
        place = path if options.runs == 1 else path.with_stem(f"{path.stem}_{seed}")
        write(str(place), options.dataset, test, part_class_id=maps)


if __name__ == "__main__":
    run(main)
