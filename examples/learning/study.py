"""Tables and pictures of a classification study: means and spreads over seeds, and the figures 16 and 17 of the paper.

`python examples/learning/study.py FOLDER resnet_1.npz resnet_2.npz … -o resnet` reads predictions of one baseline with
several seeds, prints tables, and draws precision against recall by class, recall against lit pixels, and confusion.
"""

import argparse
from itertools import pairwise
from pathlib import Path

import numpy as np
from arguments import run

import rso_lidar as rl
from rso_lidar.errors import DatasetError
from rso_lidar.picture import colour_maps, figures, palette, save_figure

COLUMNS = ("sample", "step", "draw", "class_id", "present", "lit_pixels", "reporting_pixels")
LIT = (1, 10, 30, 100, 300, 1000, 20000)


def load_scores(path: str, truth: dict[str, np.ndarray], name: str = "scores") -> np.ndarray:
    """Return the scores (frame, class) of a file of predictions in the order of the frames of the split.

    Parameters
    ----------
    path : of the file.
    truth : columns of the test split.
    name : of the array; `present` (frame) is another.
    """
    if not Path(path).is_file():
        raise DatasetError(f"{path}: no such file: write it with a baseline first")
    try:
        predictions = np.load(path, allow_pickle=False)
    except (ValueError, OSError):
        predictions = None
    if not isinstance(predictions, np.lib.npyio.NpzFile):
        raise DatasetError(f"{path}: is no NPZ of predictions: write it with a baseline first")
    with predictions as file:
        if name not in file:
            raise DatasetError(f"{path}: has no {name}: give a file of a baseline that predicts it")
        rows = {key: k for k, key in enumerate(zip(*(file[name].tolist() for name in COLUMNS[:3]), strict=True))}
        asked = list(zip(*(truth[name].tolist() for name in COLUMNS[:3]), strict=True))
        absent = sum(key not in rows for key in asked)
        if absent:
            raise DatasetError(f"{path}: {absent} frames of test are absent: give predictions for this dataset")
        order = [rows[key] for key in asked]
        return file[name][order]


def tabulate(right: np.ndarray, truth: dict[str, np.ndarray], classes: tuple[str, ...]) -> None:
    """Print accuracy by light and by class.

    Parameters
    ----------
    right : (seed, frame) whether the class is right.
    truth : columns of the test split.
    classes : names by number.
    """
    lit, reports = truth["lit_pixels"], truth["reporting_pixels"]
    groups = {"all with a lit pixel": lit >= 1, "over 100 reporting pixels": reports > 100}
    groups |= {f"{low} to {high - 1} lit pixels": (lit >= low) & (lit < high) for low, high in pairwise(LIT)}
    groups |= {name: (truth["class_id"] == k) & (lit >= 1) for k, name in enumerate(classes)}
    for name, some in groups.items():
        if some.any():
            each = right[:, some].mean(axis=1)
            spread = each.std(ddof=1) if len(each) > 1 else 0.0
            print(f"{name:28} {some.sum():6,} frames {each.mean():7.1%} ± {spread:.1%}")


def draw(path: str, scores: np.ndarray, truth: dict[str, np.ndarray], classes: tuple[str, ...]) -> None:
    """Draw the figures 16 and 17 of the paper, and which classes are confused, up to 100 lit pixels and above.

    Parameters
    ----------
    path : of the picture.
    scores : (seed, frame, class).
    truth : columns of the test split.
    classes : names by number.
    """
    from sklearn.metrics import average_precision_score, precision_recall_curve

    figure = figures.new_figure(figures.PAGE_IN, 9.0, "Classification of frames")
    axes = figure.subplots(2, 2)
    lit = truth["lit_pixels"]
    some = lit >= 1
    right = scores.argmax(axis=2) == truth["class_id"]
    edges = np.geomspace(4, 3000, 12)
    middle = np.sqrt(edges[1:] * edges[:-1])
    for k, name in enumerate(classes):
        colour, style = figures.colour_of(k)
        mine = truth["class_id"] == k
        precision, recall, _ = precision_recall_curve(mine[some], scores[0, some, k])
        average = np.mean([average_precision_score(mine[some], one[some, k]) for one in scores])
        axes[0, 0].plot(recall, precision, color=colour, ls=style, label=f"{name} ({average:.3f})")
        within = [mine & (lit >= low) & (lit < high) for low, high in pairwise(edges)]
        shares = [right[:, group].mean() if group.sum() >= 5 else np.nan for group in within]
        axes[0, 1].plot(middle, shares, "o", ms=3, color=colour, ls=style, label=name)
    figures.style_axes(axes[0, 0], "All frames with a lit pixel (average precision)", "Recall", "Precision")
    figures.style_axes(axes[0, 1], "Recall against lit pixels", "Lit pixels", "Recall")
    axes[0, 1].set_xscale("log")
    axes[0, 1].axvline(100.0, color=palette.RULE, lw=figures.THIN_PT)
    figures.draw_legend(axes[0, 0])
    for axis, group, title in (
        (axes[1, 0], some & (lit <= 100), "up to 100 lit pixels"),
        (axes[1, 1], lit > 100, "over 100 lit pixels"),
    ):
        table = np.zeros((len(classes), len(classes)))
        for one in scores:
            np.add.at(table, (truth["class_id"][group], one[group].argmax(axis=1)), 1.0)
        table /= np.maximum(table.sum(axis=1, keepdims=True), 1.0)
        shown = axis.imshow(table, cmap=colour_maps.AMOUNT_RAMP, vmin=0, vmax=1)
        for (row, col), value in np.ndenumerate(table):
            if value >= 0.005:
                ink = palette.choose_ink(shown.to_rgba(value)[:3])
                axis.text(col, row, f"{value:.0%}", ha="center", va="center", fontsize=figures.SMALL_PT, color=ink)
        axis.set_xticks(range(len(classes)), classes, rotation=45, ha="right")
        axis.set_yticks(range(len(classes)), classes)
        figures.style_axes(axis, f"Confusion, {title}", "Predicted", "True")
        axis.grid(visible=False)
    save_figure(figure, path)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("dataset", help="folder that `rso-lidar dataset make` wrote")
    parser.add_argument("predictions", nargs="+", help="predictions of one baseline, one file for each seed")
    parser.add_argument("-o", "--output", help="picture; none if omitted")
    options = parser.parse_args()
    data = rl.dataset.open(options.dataset)
    split = data.split("test")
    truth = {name: np.asarray(split.column(name)) for name in COLUMNS}
    scores = np.stack([load_scores(path, truth) for path in options.predictions])
    tabulate(scores.argmax(axis=2) == truth["class_id"], truth, data.classes)
    if options.output:
        draw(str(Path(options.output).with_suffix(".png")), scores, truth, data.classes)


if __name__ == "__main__":
    run(main)
