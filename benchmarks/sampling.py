"""What it costs to know the light of pixels: rays in rounds beside a fixed grid of 16, and beside one of equal error."""

import sys
import time
from collections.abc import Callable
from typing import Any

import numpy as np

import rso_lidar as rl
from benchmarks import scenes
from benchmarks.clock import quartiles
from benchmarks.report import Findings, Target, table
from rso_lidar import motion, optics, sampling
from rso_lidar.records import Truth
from rso_lidar.simulation import flash

RANGES_M = (300.0, 1500.0, 3000.0)
WANTED = {300.0: 1.3}  # CPU of a flash over that with 16 rays
WANTED_OF_EQUAL = {1500.0: 0.35}  # CPU of sampling over that of a grid with the same error
SIDES = (4, 6, 8, 12, 16, 20, 24, 32, 40)
FINEST = 64


def run(*, quick: bool) -> Findings:
    """Return the cost of a flash and of its sampling at several ranges."""
    rows, targets = [], []
    for range_m in RANGES_M:
        print(f"sampling: TDRS, {range_m:g} m", file=sys.stderr)
        free = scenes.single("tdrs", range_m, 1, rl.Lidar(receiver=rl.Receiver(fov_deg=scenes.FOV_DEG, f_number=2.8)))
        grid = scenes.single("tdrs", range_m, 1)
        truth, turns = first_truth(free), 3 if quick else 9
        of_flash = ratios(lambda: flash(free, truth, free.rng(0), 1), lambda: flash(grid, truth, grid.rng(0), 1), turns)
        side, error = equal_side(free, truth)
        lens = free.lidar.receiver
        equal = lens.replace(rays_per_pixel=side**2, min_rays_per_target=0)
        of_equal = ratios(lambda: cast(free, truth, lens), lambda: cast(free, truth, equal), turns)
        rays = [len(cast(free, truth, one).rays.pixel) for one in (lens, grid.lidar.receiver, equal)]
        rows.append(
            (
                f"TDRS, {range_m:g} m",
                f"{rays[0]:,}",
                f"{rays[1]:,}",
                quartiles(of_flash),
                f"{100.0 * error:.1f} %",
                f"{side} × {side}: {rays[2]:,}",
                quartiles(of_equal),
            )
        )
        for what, wanted, found in (
            ("a flash that knows its error, over one with 16 rays per pixel", WANTED, of_flash),
            ("its sampling, over the fixed grid with the same error", WANTED_OF_EQUAL, of_equal),
        ):
            if range_m in wanted:
                limit = wanted[range_m]
                met = float(np.median(found)) <= limit
                targets.append(
                    Target(f"TDRS, {range_m:g} m: {what}", f"at most {limit} ×", f"{quartiles(found)} ×", met)
                )
    header = ("scene", "rays", "with 16", "flash / with 16", "error", "grid of equal error", "sampling / that grid")
    return Findings({"sampling": table(header, rows)}, targets)


def first_truth(scenario: rl.Scenario) -> Truth:
    """Return where everything is at the first flash."""
    world: Any = {"local": scenario.is_local, "sun_direction": scenario.world.sun_direction}
    course = motion.Course(scenario.bodies, scenario.epochs(np.arange(1)), **world)
    aim = motion.Aim(scenario.pan_tilt, scenario.lidar.mount, scenario.bodies, *scenario.span, **world)
    return aim.at(course.at(0, None), None, scenario.rng(0, 1))


def cast(scenario: rl.Scenario, truth: Truth, receiver: rl.Receiver) -> Any:
    """Return the hits of one flash, cast on one thread."""
    return sampling.cast_pixels(receiver, scenario.lidar.laser, scenario.surfaces, truth, 1)


def ratios(ours: Callable[[], Any], other: Callable[[], Any], turns: int) -> np.ndarray:
    """Return the CPU times of one over those of the other, in turns on this thread."""
    ours(), other()
    spans = np.empty((turns, 2))
    for turn in range(turns):
        for column, work in enumerate((ours, other)):
            start = time.thread_time()
            work()
            spans[turn, column] = time.thread_time() - start
    return spans[:, 0] / spans[:, 1]


def equal_side(scenario: rl.Scenario, truth: Truth) -> tuple[int, float]:
    """Return the side of the coarsest fixed grid that is as good, and the error [1], weighted by light."""
    lens, laser = scenario.lidar.receiver, scenario.lidar.laser

    def pixels(receiver: rl.Receiver) -> np.ndarray:
        light = optics.collect(cast(scenario, truth, receiver), laser, receiver)
        return np.bincount(light.pixel, light.photons, lens.n_rows * lens.n_cols)

    true = pixels(lens.replace(rays_per_pixel=FINEST**2, min_rays_per_target=0))
    lit = true > 0.0

    def error(photons: np.ndarray) -> float:
        return float(np.sqrt(((photons - true)[lit] ** 2 / true[lit]).sum() / true.sum()))

    own = error(pixels(lens))
    for side in SIDES:
        if error(pixels(lens.replace(rays_per_pixel=side**2, min_rays_per_target=0))) <= own:
            return side, own
    return SIDES[-1], own
