"""Train the shape classifier on one noise draw of each pose, on two, and on more, and compare the accuracies.

A recorded frame is one draw of its noise. The dataset has a second draw of each pose, and for every pixel the probability
that it reports and the standard deviation of its range. From these, any number of further draws is made without a
simulation. All rows but the last use features of range only. `python examples/learning/noise.py FOLDER --seeds 5`
"""

import argparse

import numpy as np
from arguments import run
from frames import FRAME_COLUMNS, Returns, directions, find_group, load_returns
from shape import INTENSITY, classifier, measure_shape

import rso_lidar as rl
from rso_lidar.dataset.torch import RedrawNoise
from rso_lidar.errors import DatasetError

REDRAW = RedrawNoise()  # the augmentation of `rl.dataset.torch`, which needs no torch


def draw_returns(folder: str, split: str, frames: np.ndarray, times: int, rng: np.random.Generator) -> Returns:
    """Draw the noise of frames again from the labels, and find the returns of the target among the reports.

    Parameters
    ----------
    folder, split : of the dataset.
    frames : their numbers.
    times : number of draws of each frame.
    rng : random generator.
    """
    part = rl.dataset.open(folder).split(split)
    points, pixels, bright, counts, reports = [], [], [], [], []
    sight: dict[bytes, np.ndarray] = {}
    for frame in frames:
        one = {name: values[0] for name, values in part.read([int(frame)], (*REDRAW.needs, "intrinsics_px")).items()}
        key = one["intrinsics_px"].tobytes()
        if key not in sight:
            sight[key] = directions(one["range_m"].shape, one["intrinsics_px"])
        for _ in range(times):
            again = REDRAW(one, rng)
            pixel = np.argwhere(np.isfinite(again["range_m"]))
            at = tuple(pixel.T)
            point, intensity = again["range_m"][at][:, None] * sight[key][at], again["intensity_counts"][at]
            kept = find_group(point, intensity.astype(np.float32))
            points.append(point[kept])
            pixels.append(pixel[kept])
            bright.append(intensity[kept])
            counts.append(int(kept.sum()))
            reports.append(len(pixel))
    rows = np.repeat(frames, times)
    return Returns(
        start=np.concatenate([[0], np.cumsum(counts)]),
        point_m=np.concatenate(points).astype(np.float32),
        pixel=np.concatenate(pixels).astype(np.int16),
        intensity=np.concatenate(bright).astype(np.float32),
        reports=np.array(reports),
        columns={name: np.asarray(part.column(name))[rows] for name in FRAME_COLUMNS},
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("dataset", help="folder that `rso-lidar dataset make` wrote, with draws = 2")
    parser.add_argument("--seeds", type=int, default=5, help="number of forests of each row, two or more")
    parser.add_argument("--times", type=int, default=8, help="number of outcomes that are drawn of each pose")
    options = parser.parse_args()
    draw = np.asarray(rl.dataset.open(options.dataset).split("train").column("draw"))
    first = np.flatnonzero(draw == 0)
    if len(first) == len(draw):
        raise DatasetError(f"{options.dataset}: has one noise draw of each pose: make a dataset with draws = 2")
    train, test = load_returns(options.dataset, "train"), load_returns(options.dataset, "test")
    measured = measure_shape(train)
    shape_only = np.delete(np.arange(measured.shape[1]), INTENSITY)
    drawn = draw_returns(options.dataset, "train", first, options.times, np.random.default_rng(1))
    redrawn = measure_shape(drawn)
    truth = train.columns["class_id"]
    copies = np.repeat(first, 1 + options.times)  # tells what the draws add from what more rows in a leaf do
    ways = {
        "one draw": (measured[first][:, shape_only], truth[first], shape_only),
        f"one draw, {1 + options.times} copies": (measured[copies][:, shape_only], truth[copies], shape_only),
        "two draws": (measured[:, shape_only], truth, shape_only),
        f"one draw and {options.times} more from the labels": (
            np.concatenate([measured[first], redrawn])[:, shape_only],
            np.concatenate([truth[first], drawn.columns["class_id"]]),
            shape_only,
        ),
        "one draw, with intensity": (measured[first], truth[first], np.arange(measured.shape[1])),
    }
    measured_test = measure_shape(test)
    columns = test.columns
    lit, few = columns["lit_pixels"] >= 1, columns["reporting_pixels"] <= 100
    for name, (features, classes, used) in ways.items():
        right = np.array(
            [
                classifier(seed).fit(features, classes).predict(measured_test[:, used]) == columns["class_id"]
                for seed in range(1, options.seeds + 1)
            ]
        )
        all_of, faint = right[:, lit].mean(axis=1), right[:, lit & few].mean(axis=1)
        print(
            f"{name:36} {all_of.mean():.1%} ± {all_of.std(ddof=1):.1%} of all,"
            f" {faint.mean():.1%} ± {faint.std(ddof=1):.1%} up to 100 reporting pixels"
        )


if __name__ == "__main__":
    run(main)
