"""Files of predictions for the test split of a dataset, which `rso-lidar dataset score` reads."""

from pathlib import Path

import numpy as np
from frames import Returns

import rso_lidar as rl


def write(path: str, folder: str, returns: Returns, **arrays: np.ndarray) -> None:
    """Write an NPZ file: the identity of each frame, and arrays (frame, …) such as scores (frame, class) or present.

    Parameters
    ----------
    path : of the file.
    folder : of the dataset, whose names of classes go with `scores`.
    returns : of the frames that are predicted.
    **arrays : predictions by name.
    """
    identity = {name: returns.columns[name] for name in ("sample", "step", "draw")}
    if "scores" in arrays:
        identity["classes"] = np.array(rl.dataset.open(folder).classes)
    np.savez_compressed(Path(path), **identity, **arrays)
    print(f"{path}: {len(returns):,} frames; score them with `rso-lidar dataset score {path} --dataset {folder}`")


def accuracy(returns: Returns, scores: np.ndarray) -> str:
    """Return the accuracy of a classifier in words: of all frames with a lit pixel, and by reporting pixels."""
    columns = returns.columns
    right = scores.argmax(axis=1) == columns["class_id"]
    lit = (columns["present"] > 0) & (columns["lit_pixels"] >= 1)
    words = [f"accuracy {right[lit].mean():.1%} of {lit.sum():,} frames with a lit pixel"]
    for low, high in ((0, 10), (10, 30), (30, 100), (100, 1 << 30)):
        some = lit & (columns["reporting_pixels"] > low) & (columns["reporting_pixels"] <= high)
        name = f"{low + 1} to {high}" if high < 1 << 30 else f"over {low}"
        words.append(f"{name} reporting pixels: {right[some].mean() if some.any() else np.nan:.1%} of {some.sum():,}")
    return "; ".join(words)
