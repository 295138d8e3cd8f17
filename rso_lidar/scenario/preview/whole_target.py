"""Whether a target is found: the probability that enough pixels report it, in enough of several flashes; its attitudes.

A flash is a target in one attitude at one place in the pixel grid. Where the detector has a closed form for the light of
its pixels, they are independent, and at least m of them report by Poisson's binomial law. Otherwise flashes are simulated
through the whole detector. The n flashes of k-of-n have one attitude and place: they follow each other faster than the
target turns. So k of n is computed for each attitude and place, and averaged over these afterwards.
"""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor, ThreadPoolExecutor
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from functools import partial

import numpy as np

from rso_lidar import optics
from rso_lidar.detector import at_least, detect, estimate_k_of_n, k_of_n, mark_reports, report_probability
from rso_lidar.pose import Link
from rso_lidar.processes import send_function
from rso_lidar.records import Truth
from rso_lidar.scenario.mission.mission import Mission
from rso_lidar.scenario.preview.aspects import build_truth, collect_attitudes, link_surfaces, rotation_between
from rso_lidar.scenario.preview.geometry import Preview
from rso_lidar.scenario.preview.returns import TargetReturns, cast_surfaces, limit_fineness
from rso_lidar.scenario.tables.finding import Finding
from rso_lidar.scenario.tables.lidar import Lidar
from rso_lidar.scene import Surface

_FLASHES = 8  # simulated for each of many attitudes and places, without a closed form; at least those of k of n
_FIRST = 16  # of them after which no more are simulated if the target was found in all or in none
_ENERGIES = 7  # nodes of the Gauss-Hermite rule over the energy of a pulse
_SEED = 616  # random seed of the simulated flashes
_ROOT = 1.134_724_138_401_519_5  # x⁶ = x + 1: the ratio of the additive sequence in five dimensions (Roberts 2018)


def find_probability(
    lidar: Lidar, seen: TargetReturns, finding: Finding, *, stream: int = 0, tried: int = _FLASHES
) -> float:
    """Compute the probability that a target is found in one attitude at one place in the pixel grid.

    Parameters
    ----------
    lidar : the instrument that is in force
    seen : the light of one flash
    finding : when the target counts as found
    stream : number of the stream of random numbers, for simulated flashes
    tried : number of flashes that are simulated without a closed form; fewer if the target is found in all or in none

    Returns
    -------
    float
        Probability of k of n flashes; its standard error is at most 0.5 over the root of `tried` where it is simulated.
    """
    if seen.pixel.size < finding.pixels:
        return 0.0
    mine = seen.hits.target[seen.light.hit] == seen.number
    probability = _solve_flash(lidar, seen, mine, finding.pixels)
    if probability is not None:
        return float(k_of_n(np.array(probability), finding.needed, finding.flashes))
    rng = np.random.Generator(np.random.Philox(np.random.SeedSequence(_SEED, spawn_key=(stream,))))
    most, succeeded, n_tried = max(tried, finding.flashes), 0, 0
    while n_tried < most:
        succeeded += count_reports(lidar, seen, mine, rng) >= finding.pixels
        n_tried += 1
        if n_tried >= max(_FIRST, finding.flashes) and succeeded in (0, n_tried):
            break
    return estimate_k_of_n(succeeded, n_tried, finding.needed, finding.flashes)


def _solve_flash(lidar: Lidar, seen: TargetReturns, mine: np.ndarray, pixels: int) -> float | None:
    """Solve the probability that at least `pixels` pixels report in one flash; None without a closed form.

    All pixels of a flash have its energy in common, the mean over the pulses that the detector averages. Its jitter is
    integrated over.

    Parameters
    ----------
    mine : (return) whether it comes from the target
    """
    jitter = lidar.laser.energy_jitter_fraction / math.sqrt(lidar.detector.traits.pulses)
    factors, weights = np.ones(1), np.ones(1)
    if jitter > 0.0:
        nodes, weights = np.polynomial.hermite_e.hermegauss(_ENERGIES)
        factors, weights = np.maximum(1.0 + jitter * nodes, 1e-3), weights / weights.sum()
    mean_probability = 0.0
    for factor, weight in zip(factors.tolist(), weights.tolist(), strict=True):
        light = seen.light if factor == 1.0 else replace(seen.light, photons=seen.light.photons * factor)
        probability = report_probability(lidar.detector, light, mine)
        if probability is None:
            return None
        mean_probability += weight * at_least(probability, pixels)
    return mean_probability


def count_reports(lidar: Lidar, seen: TargetReturns, mine: np.ndarray, rng: np.random.Generator) -> int:
    """Simulate the detector for one flash, and count the pixels that report the target, by its returns (return)."""
    pulses = lidar.detector.traits.pulses
    fired, late_s, jitter = lidar.laser.fire_pulses(rng, pulses)
    light = seen.light
    if fired is not lidar.laser:
        share = fired.energy_mj / lidar.laser.energy_mj
        light = replace(light, photons=light.photons * share, late_s=late_s)
    _, light = optics.average_pulses([(seen.hits, light)], pulses, jitter)
    reading, _ = detect(light, lidar.detector, rng)
    return int(mark_reports(reading, light, mine).sum())


def find_aspects(
    lidar: Lidar,
    surfaces: Sequence[Surface],
    number: int,
    truths: Sequence[Truth],
    finding: Finding,
    finest: int | None = None,
) -> tuple[np.ndarray, np.ndarray]:
    """Cast a flash onto some surfaces for each of several truths, and compute with which probability a target is found.

    Parameters
    ----------
    lidar : the instrument that is in force
    surfaces : of the target, and of what may hide it
    number : of the target
    truths : attitudes and places
    finding : when the target counts as found
    finest : greatest number of rays along a pixel's side (None: the receiver's number)

    Returns
    -------
    probability : (truth) that the target is found.
    photons : (truth) expected from the target in all pixels.
    """
    with open_aspects(surfaces, number, finding) as find:
        return find(lidar, truths, finest)


Aspects = Callable[[Lidar, Sequence[Truth], int | None], tuple[np.ndarray, np.ndarray]]


@contextmanager
def open_aspects(
    surfaces: Sequence[Surface], number: int, finding: Finding, executor: Executor | None = None
) -> Iterator[Aspects]:
    """Yield a function that does as `find_aspects`, for many calls: surfaces are sent to the workers once.

    Parameters
    ----------
    surfaces, number, finding : as for `find_aspects`
    executor : whose workers cast the flashes (None: threads of this process)

    Yields
    ------
    callable
        Called with the instrument, the truths and the greatest number of rays; returns probabilities and photons.
    """
    with ExitStack() as stack:
        workers = executor or stack.enter_context(ThreadPoolExecutor(os.cpu_count() or 1))
        sent = stack.enter_context(send_function(partial(_find_some, surfaces, number, finding), workers))

        def find(lidar: Lidar, truths: Sequence[Truth], finest: int | None) -> tuple[np.ndarray, np.ndarray]:
            pairs = np.array(sent.map_parts(list(enumerate(truths)), lidar, finest))
            return pairs[:, 0], pairs[:, 1]

        yield find


def _find_some(
    surfaces: Sequence[Surface],
    number: int,
    finding: Finding,
    numbered: Sequence[tuple[int, Truth]],
    lidar: Lidar,
    finest: int | None,
) -> list[tuple[float, float]]:
    """Return probability and photons of some truths, each with its number, that of its stream of random numbers."""
    pairs = []
    for stream, truth in numbered:
        seen = cast_surfaces(lidar, surfaces, truth, number, finest)
        pairs.append((find_probability(lidar, seen, finding, stream=stream), float(seen.photons.sum())))
    return pairs


def move_target(mission: Mission, number: int, there: Truth, place_m: np.ndarray, turned: np.ndarray) -> Truth:
    """Return a truth that holds one target only, in another pose, with its hinges as they are.

    Parameters
    ----------
    mission : what is flown
    number : of the target
    there : the truth that gives the hinge angles
    place_m, turned : lidar_from_target, as translation (3) [m] and matrix (3, 3)
    """
    return build_truth(there.time_s, link_surfaces(mission, number, there, place_m, turned))


def list_run_attitudes(preview: Preview, name: str, n: int) -> list[tuple[int, np.ndarray]]:
    """List the attitudes that a target has to the line of sight in a run.

    Parameters
    ----------
    preview : of the mission
    name : of the target
    n : number of rows of the preview, spread evenly; a row may be listed several times

    Returns
    -------
    list of (int, numpy.ndarray)
        Row of the preview, and lidar_from_target (3, 3) with the target turned onto the boresight; empty where the lidar is
        always at the target's origin.
    """
    rows = len(preview.time_s)
    places, turns = preview.truth.poses.place("lidar", name)
    places, turns = np.broadcast_to(places, (rows, 3)), np.broadcast_to(turns, (rows, 3, 3))
    apart = np.flatnonzero(np.linalg.norm(places, axis=1) > 0.0)
    if not apart.size:
        return []
    chosen = apart[np.linspace(0, apart.size - 1, n).round().astype(int)]
    ahead = np.array([0.0, 0.0, 1.0])
    return [(int(row), rotation_between(places[row], ahead) @ turns[row]) for row in chosen]


def find_in_run(mission: Mission, preview: Preview, number: int, row: int, n: int) -> np.ndarray:
    """Compute the probabilities (aspect) that a target is found near one epoch of a run.

    Attitudes are those that the target has about this epoch. Places in the pixel grid are spread about its own place.
    """
    attitudes = collect_attitudes(mission, preview, number, row, n)
    time_s = float(preview.time_s[row])
    lidar = mission.instrument.at(time_s)
    phase, name = spread_attitudes(n)[1], mission.target[number].name
    truths = []
    mine = {surface.name for surface in mission.surfaces_of(number)}
    for k in range(n):
        poses, links = attitudes[k % len(attitudes)].poses, {}
        moved_m = np.append(phase[k] * lidar.receiver.pixel_tangent, 0.0) * poses.place("lidar", name)[0][2]
        for surface in mission.surfaces:
            place_m, matrix = poses.place("lidar", surface.name)
            links[surface.name] = Link((place_m + moved_m * (surface.name in mine), matrix), np.zeros(3), np.zeros(3))
        truths.append(build_truth(time_s, links))
    finest = limit_fineness(mission, truths[0], n)
    return find_aspects(lidar, mission.surfaces, number, truths, mission.finding, finest)[0]


def spread_attitudes(n: int) -> tuple[np.ndarray, np.ndarray]:
    """Return attitudes spread evenly over all rotations, each with a place in the pixel.

    The additive recurrence of Roberts (2018, "The unreasonable effectiveness of quasirandom sequences") gives points of low
    discrepancy in five dimensions. Three of them become a rotation, uniform over SO(3) (Shoemake 1992, Graphics Gems III,
    p. 124). Two are the place.

    Parameters
    ----------
    n : number of attitudes

    Returns
    -------
    matrix : (attitude, 3, 3) rotations.
    phase : (attitude, 2) places right and down of the middle [pixels], from −0.5 to 0.5.
    """
    steps = _ROOT ** -np.arange(1.0, 6.0)
    points = np.modf(0.5 + np.outer(np.arange(1, n + 1), steps))[0]
    u, v, w = points[:, 0], 2.0 * math.pi * points[:, 1], 2.0 * math.pi * points[:, 2]
    low, high = np.sqrt(1.0 - u), np.sqrt(u)
    x, y, z, s = low * np.sin(v), low * np.cos(v), high * np.sin(w), high * np.cos(w)
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * s), 2 * (x * z + y * s)],
        [2 * (x * y + z * s), 1 - 2 * (x * x + z * z), 2 * (y * z - x * s)],
        [2 * (x * z - y * s), 2 * (y * z + x * s), 1 - 2 * (x * x + y * y)],
    ]
    return np.moveaxis(np.array(rows), -1, 0), points[:, 3:] - 0.5
