"""The arguments of the baselines. This module does not import torch, because shape.py and presence.py do not need it."""

from __future__ import annotations

import argparse


def parse(what: str, epochs: int = 0, flags: tuple[str, ...] = (), draws: bool = False) -> argparse.Namespace:
    """Read the arguments of a baseline.

    Parameters
    ----------
    what : the module's docstring.
    epochs : default number of epochs; 0 for a baseline without epochs.
    flags : names of further switches.
    draws : whether there is an option for the number of noise draws.
    """
    parser = argparse.ArgumentParser(description=what, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("dataset", help="folder that `rso-lidar dataset make` wrote")
    parser.add_argument("-o", "--output", default="predictions.npz", help="file of predictions for the test split")
    parser.add_argument(
        "--seed", type=int, default=1, help="random seed of first weights, batches and the validation split"
    )
    parser.add_argument("--most", type=int, help="greatest number of frames of each split, for a quick trial")
    if draws:
        parser.add_argument("--draws", type=int, default=1, help="number of noise draws of each pose to train on")
    if epochs:
        parser.add_argument("--epochs", type=int, default=epochs)
        parser.add_argument("--threads", type=int, default=1)
    for flag in flags:
        parser.add_argument(f"--{flag.replace('_', '-')}", action="store_true")
    return parser.parse_args()
