"""What it costs to know the light of pixels: error, rays and CPU time of a default flash, on TDRS across the field.

The error is measured against a lattice of 4,096 rays in each pixel. An oracle shows how few rays would do: it knows the
error of each pixel with 4, 8, 16, ... rays, and gives rays to where they reduce the error most.
"""

import math
import sys
import time
from collections.abc import Sequence

import numpy as np

import rso_lidar as rl
from benchmarks import scenes
from benchmarks.clock import pairs, quartiles
from benchmarks.report import Findings, Target, table
from rso_lidar import optics, sampling, scene
from rso_lidar.records import Hits, Rays, Truth
from rso_lidar.simulation import flash

RANGES_M = (300.0, 1500.0, 3000.0)
# At most: CPU of a flash over one with 16 rays per pixel, of sampling over one cast of its rays, rays over the oracle's.
WANTED_FLASH = {300.0: 1.8, 3000.0: 1.5}
WANTED_SAMPLING = 1.4
WANTED_RAYS = 2.0
COUNTS = tuple(2**power for power in range(2, 13))  # rays per pixel of the lattices; the last is the reference
CHUNK = 2**21  # rays of a lattice that are cast together
DIMMEST = 1e-3  # dimmer pixels, against the brightest, weigh as if they had so much light


def run(*, quick: bool) -> Findings:
    """Return rays, error and cost of the default sampling at several ranges."""
    rows, targets = [], []

    def judge(what: str, limit: float | None, measured: str, median: float) -> None:
        if limit is not None:
            targets.append(Target(what, f"at most {limit:g} ×", f"{measured} ×", median <= limit))

    for range_m in RANGES_M:
        name = f"TDRS, {range_m:g} m"
        print(f"sampling: {name}", file=sys.stderr)
        scenario, truth = first_flash(range_m)
        hits = cast(scenario, truth)
        lattices = [lattice_light(scenario, truth, count) for count in COUNTS]
        error = rms_error(pixel_light(scenario, hits), lattices[-1])
        fewest = oracle_rays(lattices, error)
        of_flash, of_sampling = cpu_ratios(scenario, truth, hits.rays, 5 if quick else 11)
        n_rays = len(hits.rays.pixel)
        of_rays = n_rays / fewest
        rows.append(
            (
                name,
                f"{100.0 * error:.1f} %",
                f"{n_rays:,}",
                f"{fewest:,}",
                f"{of_rays:.2f}",
                quartiles(of_sampling),
                quartiles(of_flash),
            )
        )
        judge(
            f"{name}: a default flash, over one with 16 rays per pixel",
            WANTED_FLASH.get(range_m),
            quartiles(of_flash),
            float(np.median(of_flash)),
        )
        judge(
            f"{name}: its sampling, over casting its rays in one call",
            WANTED_SAMPLING,
            quartiles(of_sampling),
            float(np.median(of_sampling)),
        )
        judge(f"{name}: its rays, over those of an oracle", WANTED_RAYS, f"{of_rays:.2f}", of_rays)
    header = ("scene", "error", "rays", "oracle's rays", "rays / oracle's", "sampling / one cast", "flash / with 16")
    return Findings({"sampling": table(header, rows)}, targets)


def first_flash(range_m: float) -> tuple[rl.Scenario, Truth]:
    """Return a scenario with the default sampling, and where everything is at its first flash."""
    receiver = rl.Receiver(fov_deg=scenes.FOV_DEG, f_number=2.8)
    scenario = scenes.single("tdrs", range_m, 1, rl.Lidar(receiver=receiver))
    return scenario, next(rl.simulate(scenario)).truth


def cast(scenario: rl.Scenario, truth: Truth) -> Hits:
    """Cast the rays of one flash, on one thread."""
    return sampling.cast_pixels(scenario.lidar.receiver, scenario.lidar.laser, scenario.surfaces, truth, 1)


def cpu_ratios(scenario: rl.Scenario, truth: Truth, rays: Rays, n: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the CPU times of a flash over one with 16 rays per pixel, and of sampling over one cast of its rays."""
    lens, surfaces = scenario.lidar.receiver, scenario.surfaces
    fixed = scenario.replace(lidar=scenario.lidar.replace(receiver=lens.replace(rays_per_pixel=16)))
    flashes = pairs(
        lambda: flash(scenario, truth, scenario.rng(0), 1),
        lambda: flash(fixed, truth, fixed.rng(0), 1),
        n,
        time.thread_time,
    )
    casts = pairs(
        lambda: cast(scenario, truth),
        lambda: scene.cast(rays, surfaces, truth, 1, aperture_m=lens.aperture_m),
        n,
        time.thread_time,
    )
    return flashes[:, 0] / flashes[:, 1], casts[:, 0] / casts[:, 1]


def pixel_light(scenario: rl.Scenario, hits: Hits) -> np.ndarray:
    """Return the expected photons (pixel,) of a flash."""
    lens = scenario.lidar.receiver
    light = optics.collect(hits, scenario.lidar.laser, lens)
    return np.bincount(light.pixel, light.photons, lens.n_rows * lens.n_cols)


def lattice_light(scenario: rl.Scenario, truth: Truth, n: int) -> np.ndarray:
    """Return the expected photons (pixel,) by a golden-ratio lattice of n rays in each pixel that the target may touch."""
    lens = scenario.lidar.receiver
    extent = scene.extent(scenario.surfaces, truth)
    inner = np.floor(extent.low[0] / lens.pixel_tangent + 0.5 * lens.n_cols).astype(int)
    outer = np.ceil(extent.high[0] / lens.pixel_tangent + 0.5 * lens.n_cols).astype(int)
    cols, rows = (np.arange(max(low, 0), min(high, lens.n_cols)) for low, high in zip(inner, outer, strict=True))
    inside = (rows[:, None] * lens.n_cols + cols).ravel()
    points = np.arange(n)
    right, down = (points + 0.5) / n, np.mod(0.5 + points * 0.5 * (math.sqrt(5.0) - 1.0), 1.0)
    photons = np.zeros(lens.n_rows * lens.n_cols)
    for pixels in np.array_split(inside, math.ceil(len(inside) * n / CHUNK)):
        x, y = lens.tangents_at(
            ((pixels % lens.n_cols)[:, None] + right).ravel(), ((pixels // lens.n_cols)[:, None] + down).ravel()
        )
        direction = np.stack((x, y, np.ones_like(x)))
        direction /= np.linalg.norm(direction, axis=0)
        rays = Rays(lens.shape, direction.T, np.repeat(pixels, n), np.full(x.size, 1.0 / n))
        photons += pixel_light(scenario, scene.cast(rays, scenario.surfaces, truth, None, aperture_m=lens.aperture_m))
    return photons


def pixel_errors(light: np.ndarray, true: np.ndarray) -> np.ndarray:
    """Return the squared error of each pixel, weighted by its light; their sum is the square of the rms error."""
    return (light - true) ** 2 / np.maximum(true, DIMMEST * true.max()) / true.sum()


def rms_error(light: np.ndarray, true: np.ndarray) -> float:
    """Return the relative rms error [1] of pixels' light, weighted by light."""
    return float(np.sqrt(pixel_errors(light, true).sum()))


def oracle_rays(lattices: Sequence[np.ndarray], error: float) -> int:
    """Return how many rays reach an rms error where each lit pixel gets the lattice of equal marginal gain.

    `lattices` hold the light (pixel,) by each of `COUNTS` rays per pixel; the last is the truth.
    """
    lit = lattices[-1] > 0.0
    squared = np.stack([pixel_errors(light, lattices[-1])[lit] for light in lattices])
    counts, every = np.array(COUNTS), np.arange(np.count_nonzero(lit))
    low, high = 0.0, 2.0 * max(COUNTS) / error**2 * len(every)
    while high - low > 1e-6 * high:  # rays that a unit of squared error is worth
        worth = 0.5 * (low + high)
        chosen = np.argmin(counts[:, None] + worth * squared, axis=0)
        low, high = (low, worth) if squared[chosen, every].sum() <= error**2 else (worth, high)
    return int(counts[np.argmin(counts[:, None] + high * squared, axis=0)].sum())
