"""What happens in a dispersed flight: nearest approach, collision, keep-out, field of view, detection."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from rso_lidar.scenario import Lidar, Scenario
from rso_lidar.study.budgets.range_budget import budget

_RANGES = 160  # of a link budget, between which detection is interpolated
_MOST_LENSES = 24  # budgets for lenses of a schedule; the nearest in time serves between


def find_nearest_m(position_m: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the least distance of each path from the origin, along straight lines between its samples.

    Parameters
    ----------
    position_m : (run, time, 3) positions [m]

    Returns
    -------
    distance_m : (run,) [m]
    place : (run,) time of it, in samples from the first
    """
    step = np.diff(position_m, axis=1)
    square = np.sum(step * step, axis=2)
    share = -np.sum(position_m[:, :-1] * step, axis=2) / np.where(square > 0.0, square, 1.0)
    share = np.clip(share, 0.0, 1.0)
    between = position_m[:, :-1] + share[..., None] * step
    distance = np.sqrt(np.sum(between * between, axis=2))
    first = np.argmin(distance, axis=1)
    runs = np.arange(len(position_m))
    return distance[runs, first], first + share[runs, first]


def find_off_axis_rad(
    position_m: np.ndarray, nominal_m: np.ndarray, bias_rad: np.ndarray, *, follows_target: bool
) -> np.ndarray:
    """Return the angle between boresight and target (run, time) [rad].

    Parameters
    ----------
    position_m, nominal_m : (run, time, 3) and (time, 3) position of the lidar relative to the target [m]
    bias_rad : (run, 2) constant error of the boresight about two axes across it [rad]
    follows_target : whether the lidar points at the target, not at where the nominal flight would see it
    """
    bias = np.sqrt(np.sum(bias_rad**2, axis=1))[:, None]
    if follows_target:
        return np.broadcast_to(bias, position_m.shape[:2])
    toward, planned = -position_m, np.broadcast_to(-nominal_m, position_m.shape)
    across = np.cross(planned, toward)
    # two axes across the planned line of sight: one in the plane of the cross-track axis, and the other
    first = np.cross(planned, [0.0, 0.0, 1.0])
    first /= np.maximum(np.linalg.norm(first, axis=-1, keepdims=True), 1e-300)
    second = np.cross(planned, first)
    second /= np.maximum(np.linalg.norm(second, axis=-1, keepdims=True), 1e-300)
    angle = np.arctan2(np.linalg.norm(across, axis=-1), np.sum(planned * toward, axis=-1))
    size = np.maximum(np.linalg.norm(across, axis=-1), 1e-300)
    turned = [
        angle * np.sum(across * axis, axis=-1) / size - bias_rad[:, k : k + 1] for k, axis in enumerate((first, second))
    ]
    off: np.ndarray = np.hypot(*turned)
    return off


def make_detection(
    scenario: Scenario, time_s: np.ndarray, range_m: tuple[float, float]
) -> Callable[[int, np.ndarray, np.ndarray], np.ndarray]:
    """Return the probability that a flash detects the target, as a function of range and energy.

    It is that of the link budget for one facet: as large as a side of the target, of its dimmest material, in a pixel of
    its own or a part of one.

    Parameters
    ----------
    scenario : whose instrument is used, with its schedule
    time_s : (time,) instants of the samples [s]
    range_m : least and greatest range [m]

    Returns
    -------
    function of the index of a sample, ranges (run,) [m] and relative energies (run,)
        it returns probabilities (run,)
    """
    lidars = [scenario.instrument.at(float(at_s)) for at_s in time_s]
    lenses: list[Lidar] = []
    number = np.empty(len(lidars), dtype=int)
    for k, lidar in enumerate(lidars):
        if lidar not in lenses and len(lenses) < _MOST_LENSES:
            lenses.append(lidar)
        number[k] = lenses.index(lidar) if lidar in lenses else len(lenses) - 1
    grid = np.geomspace(max(range_m[0], 0.5), max(range_m[1], 1.0) * 1.01, _RANGES)
    whole = budget(scenario.replace(lidar=scenario.lidar.replace(schedule=None)), range_m=grid)
    curves = [
        budget(scenario.replace(lidar=lens.replace(schedule=None)), range_m=grid, facet_m2=whole.target_area_m2).curves[
            0
        ]
        for lens in lenses
    ]
    armed = [curve.detection_probability > 0.0 for curve in curves]
    tables = []
    for curve, is_armed in zip(curves, armed, strict=True):
        light = np.log(np.maximum(curve.photons, 1e-300))
        order = np.argsort(light[is_armed], kind="stable")
        tables.append((light, light[is_armed][order], curve.detection_probability[is_armed][order]))

    def find(sample: int, at_m: np.ndarray, energy: np.ndarray) -> np.ndarray:
        """Return the probability that one flash detects the target (run,).

        Parameters
        ----------
        sample : index of the sample
        at_m : (run,) ranges [m]
        energy : (run,) pulse energy over that of the scenario
        """
        light, known, chance = tables[number[sample]]
        if not len(known):
            return np.zeros_like(at_m)
        photons = np.interp(np.log(np.maximum(at_m, grid[0])), np.log(grid), light) + np.log(energy)
        is_armed = np.interp(at_m, grid, armed[number[sample]].astype(float)) > 0.0
        made: np.ndarray = np.where(is_armed, np.interp(photons, known, chance), 0.0)
        return made

    return find
