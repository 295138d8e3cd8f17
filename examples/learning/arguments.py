"""The arguments of the baselines, and one line for an error that the user can cure.

This module does not import torch, because shape.py and presence.py do not need it.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable
from pathlib import Path
from typing import NoReturn

import rso_lidar as rl

_EXTRA = ("torch", "sklearn", "captum")  # libraries that the extra installs


def stop(message: str) -> NoReturn:
    """Print a message *where: what: what to do* and exit with status 2."""
    print(message, file=sys.stderr)
    sys.exit(2)


def run(main: Callable[[], None]) -> None:
    """Run a script; for bad input or a library that is absent, print one line and exit with status 2."""
    try:
        main()
    except ModuleNotFoundError as error:
        if error.name not in _EXTRA:
            raise
        stop(f"{error.name}: is not installed: pip install 'rso-lidar[learn]'")
    except rl.RsoLidarError as error:
        stop(str(error))


def _positive(text: str) -> int:
    if not text.isdecimal() or int(text) < 1:
        raise argparse.ArgumentTypeError(f"{text}: is not a positive whole number")
    return int(text)


def _predictions_path(text: str) -> str:
    path = Path(text)
    if path.suffix != ".npz" or not path.parent.is_dir():
        raise argparse.ArgumentTypeError(f"{text}: is not a file NAME.npz in an existing folder")
    return text


def parse(
    what: str,
    epochs: int = 0,
    flags: tuple[str, ...] = (),
    draws: bool = False,
    runs: bool = False,
    sensors: tuple[str, ...] = (),
    also: bool = True,
) -> argparse.Namespace:
    """Read the arguments of a baseline.

    Parameters
    ----------
    what : the module's docstring.
    epochs : default number of epochs; 0 for a baseline without epochs.
    flags : names of further switches.
    draws : whether there is an option for the number of noise draws.
    runs : whether there is an option for the number of trainings.
    sensors : names to choose from, for a baseline of the benchmark.
    also : whether a baseline with `sensors` predicts other datasets, too, and takes crops if it has epochs.
    """
    parser = argparse.ArgumentParser(description=what, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("dataset", help="folder that `rso-lidar dataset make` wrote")
    parser.add_argument(
        "-o",
        "--output",
        type=_predictions_path,
        default="predictions.npz",
        help="file of predictions for the test split",
    )
    parser.add_argument(
        "--seed", type=int, default=1, help="random seed of first weights, batches and the validation split"
    )
    parser.add_argument("--most", type=_positive, help="greatest number of frames of each split, for a quick trial")
    if draws:
        parser.add_argument("--draws", type=_positive, default=1, help="number of noise draws of each pose to train on")
    if runs:
        parser.add_argument("--runs", type=_positive, default=1, help="number of trainings, with seeds from --seed on")
    if sensors:
        parser.add_argument("--sensor", choices=sensors, default=sensors[0], help="what the frames are seen with")
    if sensors and also:
        parser.add_argument(
            "--also", action="append", default=[], metavar="FOLDER", help="predict the test of this dataset, too"
        )
    if sensors and also and epochs:
        parser.add_argument("--size", type=int, choices=(32, 64), default=64, help="rows and columns of a crop")
        parser.add_argument(
            "--width", type=_positive, default=16, help="channels of the first stage of ResNet-18; the original has 64"
        )
    if epochs:
        parser.add_argument("--epochs", type=_positive, default=epochs)
        parser.add_argument("--threads", type=_positive, default=1)
    for flag in flags:
        parser.add_argument(f"--{flag.replace('_', '-')}", action="store_true")
    return parser.parse_args()
