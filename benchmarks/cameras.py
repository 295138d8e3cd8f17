"""A camera beside the lidar: frames and datasets of both sensors beside those of the lidar alone."""

import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

import rso_lidar as rl
from benchmarks import labelled
from benchmarks.clock import pairs, quartiles
from benchmarks.report import Findings, Target, table

SCENARIO = "examples/tdrs_approach.toml"
FRAME = 539  # at 300 m
START_UTC = "2024-09-17T03:00:00Z"  # the Sun is behind the lidar
WANTED = 3.0  # frames of the lidar
CAMERA = """
[[camera]]
name = "nav"
carrier = "ptu"
mount = { position_m = [0, 0.2, 0] }
exposure_ms = 0.2
lens = { fov_deg = 2.5, f_number = 4 }
"""
CASES = (
    ("grey", ""),
    ("grey, sharp shadows", "has_penumbra = false\n"),
    ("three bands", 'bands = "rgb"\n'),
)
SUN = "world.sun_direction=[-1, 0.3, 0.4]"  # behind the lidar, to the side
IN_DATASET = 'camera=[{name="nav",mount={position_m=[0,0.2,0]},exposure_ms=0.2,%slens={fov_deg=2.5,f_number=4}}]'
WANTED_SHARE = 0.5  # of the rate of a dataset of the lidar alone


def load(camera: str = "") -> rl.Scenario:
    """Return the approach with a camera, or with the lidar alone."""
    text = Path(SCENARIO).read_text(encoding="utf-8")
    return rl.Scenario.loads(text + camera, settings=(f"time.start_utc={START_UTC}",))


def flash(scenario: rl.Scenario, threads: int) -> Any:
    """Return a function that makes the frame at 300 m again and again."""
    simulation = rl.Simulation(scenario, frames=[FRAME], commanded=False, threads=threads)
    truth = simulation.advance().truth
    return lambda: rl.flash(scenario, truth, scenario.rng(FRAME), threads, index=FRAME)


def make_pairs(keys: str, rounds: int, each: int) -> tuple[np.ndarray, float, float]:
    """Make datasets of the lidar alone and of both sensors in turns, with two workers.

    Parameters
    ----------
    keys : of the camera, as TOML that ends in a comma
    rounds, each : number of turns, and of frames of each of seven craft in a turn

    Returns
    -------
    Frames per second (turn, alone_both), and kB of a frame with the lidar alone and with both.
    """
    whole = labelled.spec(each, prediction=True)
    specs = whole.replace(set=(SUN,)), whole.replace(set=(SUN, IN_DATASET % keys))
    rates, size_kb = [], [0.0, 0.0]
    with tempfile.TemporaryDirectory() as kept:
        for turn in range(rounds):
            folders = [Path(kept, f"{turn}-{k}") for k in range(2)]
            rates.append([labelled.run_labelled(asked, folder) for asked, folder in zip(specs, folders, strict=True)])
            for k, folder in enumerate(folders):
                records = rl.dataset.open(folder).records
                size_kb[k] = 1e-3 * sum(entry.size_bytes for entry in records) / sum(entry.frames for entry in records)
    return np.array(rates), *size_kb


def run_datasets(*, quick: bool) -> tuple[str, Target]:
    """Return the table of datasets with a camera, and what was wanted of them."""
    rows, share = [], 0.0
    for name, keys in (("grey", ""), ("grey, sharp shadows", "has_penumbra=false,")):
        print(f"cameras: dataset, {name}", file=sys.stderr)
        rates, alone_kb, both_kb = make_pairs(keys, 1 if quick else 5, 6 if quick else 16)
        ratio = rates[:, 1] / rates[:, 0]
        numbers = f"{np.median(rates[:, 0]):.1f}", f"{np.median(rates[:, 1]):.1f}", quartiles(ratio)
        rows.append((name, *numbers, f"{alone_kb:.0f}", f"{both_kb:.0f}"))
        share = share or float(np.median(ratio))
    head = ("camera of 512 x 512 pixels", "lidar alone [frames/s]", "both [frames/s]", "both over the lidar alone")
    wanted = f"at least {WANTED_SHARE:g} of the lidar's rate"
    target = Target("a dataset of lidar and camera", wanted, f"{share:.2f}", share >= WANTED_SHARE)
    return table((*head, "lidar alone [kB]", "both [kB]"), rows), target


def run(*, quick: bool) -> Findings:
    """Return what a pair of sensors costs, over the lidar alone."""
    rows, goal = [], 0.0
    for threads in (1, 2):
        alone = flash(load(), threads)
        for name, keys in CASES:
            print(f"cameras: {name}, {threads} threads", file=sys.stderr)
            taken = pairs(flash(load(CAMERA.replace("lens =", f"{keys}lens =")), threads), alone, 3 if quick else 9)
            ratio = taken[:, 0] / taken[:, 1]
            rows.append((name, str(threads), f"{1e3 * taken[:, 1].mean():.1f}", quartiles(ratio)))
            if name == "grey" and threads == 1:
                goal = float(sorted(ratio)[len(ratio) // 2])
    head = ("camera of 512 x 512 pixels", "threads", "lidar alone [ms]", "both over the lidar alone")
    wanted = f"at most {WANTED:g} of a lidar frame"
    target = Target("a lidar frame with a camera of 512 x 512", wanted, f"{goal:.2f}", goal <= WANTED)
    datasets, goal_of_datasets = run_datasets(quick=quick)
    return Findings({"cameras": table(head, rows), "cameras in datasets": datasets}, [target, goal_of_datasets])
