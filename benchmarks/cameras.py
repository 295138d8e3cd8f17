"""A camera beside the lidar: frames of both sensors beside frames of the lidar alone."""

import sys
from pathlib import Path
from typing import Any

import rso_lidar as rl
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


def load(camera: str = "") -> rl.Scenario:
    """Return the approach with a camera, or with the lidar alone."""
    text = Path(SCENARIO).read_text(encoding="utf-8")
    return rl.Scenario.loads(text + camera, settings=(f"time.start_utc={START_UTC}",))


def flash(scenario: rl.Scenario, threads: int) -> Any:
    """Return a function that makes the frame at 300 m again and again."""
    simulation = rl.Simulation(scenario, frames=[FRAME], commanded=False, threads=threads)
    truth = simulation.advance().truth
    return lambda: rl.flash(scenario, truth, scenario.rng(FRAME), threads, index=FRAME)


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
    return Findings({"cameras": table(head, rows)}, [target])
