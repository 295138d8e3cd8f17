"""Compare lidar, camera and both over range and Sun angle: tables, and a figure with means and spreads over seeds.

`python examples/learning/sensors.py FOLDER --lidar lidar_?.npz --camera camera_?.npz --both both_?.npz -o sensors.png`
reads predictions of benchmark.py, one file for each seed.
"""

import argparse
from itertools import pairwise

import numpy as np
from arguments import run
from study import COLUMNS, load_scores

import rso_lidar as rl
from rso_lidar.errors import DatasetError
from rso_lidar.picture import figures, save_figure
from rso_lidar.units import DEG

SENSORS = ("lidar", "camera", "both")
FALSE_ALARMS = 0.05  # share of the frames without a target that are called
RANGES_M = (150.0, 300.0, 500.0, 800.0, 1300.0, 2000.0, 3000.0)
ANGLES_DEG = (0.0, 30.0, 60.0, 90.0, 120.0, 150.0, 180.0)


def find_sun_angle_deg(sun_direction: np.ndarray, position_m: np.ndarray) -> np.ndarray:
    """Return the angle at the target between the Sun and the sensors (frame) [deg]: 0 where the Sun is behind them.

    Parameters
    ----------
    sun_direction : unit vectors (frame, 3) in lidar axes.
    position_m : of the target (frame, 3) in lidar axes.
    """
    toward_sensor = -position_m / np.linalg.norm(position_m, axis=1, keepdims=True)
    return np.arccos(np.clip((sun_direction * toward_sensor).sum(axis=1), -1.0, 1.0)) / DEG


def find_called(present: np.ndarray, is_present: np.ndarray) -> np.ndarray:
    """Return which frames are called (run, frame), at a threshold that calls one in twenty of those without a target.

    Parameters
    ----------
    present : scores (run, frame).
    is_present : (frame) whether there is a target.
    """
    threshold = np.quantile(present[:, ~is_present], 1.0 - FALSE_ALARMS, axis=1, method="lower")
    return present > threshold[:, None]


def tabulate(answers: dict[str, np.ndarray], groups: dict[str, np.ndarray], title: str) -> None:
    """Print shares of frames by sensor and group, with the standard deviation over runs.

    Parameters
    ----------
    answers : (run, frame) by sensor.
    groups : (frame) by name.
    title : of the table.
    """
    print(f"{title:28} frames " + "".join(f"{name:>17}" for name in answers))
    for name, some in groups.items():
        if not some.any():
            continue
        words = [f"{some.sum():7,} "]
        for right in answers.values():
            each = right[:, some].mean(axis=1)
            words.append(f"{each.mean():9.1%} ± {each.std(ddof=1) if len(each) > 1 else 0.0:.1%}")
        print(f"{name:28}" + " ".join(words))


def draw(
    path: str, answers: dict[str, dict[str, np.ndarray]], places: dict[str, np.ndarray], craft: np.ndarray
) -> None:
    """Draw the share of frames with the right class, and of craft that are found, over range and Sun angle.

    Parameters
    ----------
    path : of the picture.
    answers : (run, frame) by question and sensor.
    places : range [m] and Sun angle [deg] of the frames, by name.
    craft : (frame) whether there is a craft.
    """
    figure = figures.new_figure(figures.PAGE_IN, 6.4, "What each sensor is good for")
    axes = figure.subplots(2, 2, sharey=True)
    for row, (question, by_sensor) in enumerate(answers.items()):
        for col, (name, edges) in enumerate({"Range, m": RANGES_M, "Sun angle, deg": ANGLES_DEG}.items()):
            middle = [np.sqrt(a * b) if col == 0 else (a + b) / 2.0 for a, b in pairwise(edges)]
            for k, (sensor, right) in enumerate(by_sensor.items()):
                colour, style = figures.colour_of(k)
                some = [craft & (places[name] >= a) & (places[name] < b) for a, b in pairwise(edges)]
                each = np.array(
                    [right[:, group].mean(axis=1) if group.any() else np.nan * right[:, 0] for group in some]
                )
                spread = each.std(axis=1, ddof=1) if right.shape[0] > 1 else None
                axes[row, col].errorbar(
                    middle, each.mean(axis=1), spread, fmt="o", ls=style, ms=3, color=colour, label=sensor, capsize=2
                )
            figures.style_axes(axes[row, col], question, name, "Share of frames")
            axes[row, col].set_ylim(0.0, 1.02)
            if col == 0:
                axes[row, col].set_xscale("log")
                axes[row, col].set_xticks([200, 500, 1000, 2000], ["200", "500", "1000", "2000"])
                axes[row, col].minorticks_off()
            else:
                axes[row, col].set_xticks(ANGLES_DEG)
    figures.draw_legend(axes[0, 0])
    save_figure(figure, path)


def begin_parser(what: str) -> argparse.ArgumentParser:
    """Return a parser for a dataset and the predictions by each sensor.

    Parameters
    ----------
    what : the docstring of the script.
    """
    parser = argparse.ArgumentParser(description=what, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("dataset", help="folder that `rso-lidar dataset make` wrote")
    for sensor in SENSORS:
        parser.add_argument(
            f"--{sensor}", nargs="+", default=[], metavar="FILE", help="predictions, a file for each seed"
        )
    return parser


def list_files(options: argparse.Namespace) -> dict[str, list[str]]:
    """Return the files of predictions by sensor."""
    files = {sensor: getattr(options, sensor) for sensor in SENSORS if getattr(options, sensor)}
    if not files:
        raise DatasetError("predictions: none are given: give --lidar, --camera or --both")
    return files


def main() -> None:
    parser = begin_parser(__doc__)
    parser.add_argument("-o", "--output", help="picture; none if omitted")
    options = parser.parse_args()
    files = list_files(options)
    split = rl.dataset.open(options.dataset).split("test")
    columns = (*COLUMNS, "range_to_target_m", "sun_direction", "position_m")
    truth = {name: np.asarray(split.column(name)) for name in columns}
    craft = truth["present"] > 0
    answers: dict[str, dict[str, np.ndarray]] = {"Right class": {}, "Found, false alarms 5 %": {}}
    for sensor, paths in files.items():
        scores = np.stack([load_scores(path, truth) for path in paths])
        present = np.stack([load_scores(path, truth, "present") for path in paths])
        answers["Right class"][sensor] = scores.argmax(axis=2) == truth["class_id"]
        answers["Found, false alarms 5 %"][sensor] = find_called(present, craft)
    angle = np.where(craft, 0.0, np.nan)
    angle[craft] = find_sun_angle_deg(truth["sun_direction"][craft], truth["position_m"][craft])
    places = {"Range, m": truth["range_to_target_m"], "Sun angle, deg": angle}
    for question, by_sensor in answers.items():
        groups = {"all": craft, "100 reporting pixels or more": craft & (truth["reporting_pixels"] >= 100)}
        for name, edges in {"Range, m": RANGES_M, "Sun angle, deg": ANGLES_DEG}.items():
            groups |= {
                f"{name}: {a:.0f} to {b:.0f}": craft & (places[name] >= a) & (places[name] < b)
                for a, b in pairwise(edges)
            }
        tabulate(by_sensor, groups, question)
    if options.output:
        draw(options.output, answers, places, craft)


if __name__ == "__main__":
    run(main)
