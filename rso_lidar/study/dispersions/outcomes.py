"""What happens in a dispersed flight: nearest approach, collision, keep-out, field of view, detection."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from rso_lidar.mission_analysis import budget
from rso_lidar.scenario import Lidar, Scenario, is_in_field, place_hull, preview_mission

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


class Sight:
    """Which parts of the target are in the field of the lidar of dispersed runs, at the samples of the flight.

    The lidar is that of the scenario, with its mounts, drive and `point`. In a run it is turned by the smallest rotation
    from the line of sight of the scenario to the one that the run points along. The target has the attitude of the scenario.

    Parameters
    ----------
    scenario : what is flown
    target : name of the target
    samples : greatest number of samples, at the first and the last frame and evenly between them
    """

    def __init__(self, scenario: Scenario, target: str, samples: int) -> None:
        preview = preview_mission(scenario, samples)
        poses, count, axes = preview.truth.poses, len(preview.time_s), f"{target}.rtn"
        number = [candidate.name for candidate in scenario.target].index(target)
        place_m, matrix = poses.place(axes, "lidar")
        place_m = np.broadcast_to(place_m, (count, 3))
        self._lidar_from_rtn = np.swapaxes(np.broadcast_to(matrix, (count, 3, 3)), 1, 2)
        self._lever_m = place_m - poses.place(axes, "follower")[0]
        self._toward = -place_m / np.linalg.norm(place_m, axis=1, keepdims=True)
        self._hull_m = place_hull(scenario.surfaces_of(number), poses, axes, count)
        lidars = [scenario.instrument.at(float(at_s)) for at_s in preview.time_s]
        self._half_field = np.array([lidar.receiver.field_edge for lidar in lidars])

    def find_held(
        self, position_m: np.ndarray, aimed_from_m: np.ndarray, bias_rad: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return whether the target's origin is in the field (run, time), and whether its whole hull is.

        Parameters
        ----------
        position_m : (run, time, 3) of the follower relative to the target, rtn axes [m]
        aimed_from_m : (run, time, 3) or (time, 3) where pointing takes the follower to be [m]
        bias_rad : (run, 2) constant error of the boresight, to the right and down [rad]
        """
        from scipy.spatial.transform import Rotation

        aimed = -(aimed_from_m + self._lever_m)
        aimed = np.broadcast_to(aimed / np.linalg.norm(aimed, axis=-1, keepdims=True), position_m.shape)
        turn = Rotation.from_rotvec(
            np.stack([bias_rad[:, 1], -bias_rad[:, 0], 0.0 * bias_rad[:, 0]], axis=1)
        ).as_matrix()
        origin, whole = (np.empty(position_m.shape[:2], dtype=bool) for _ in range(2))
        for k, (toward, half_field) in enumerate(zip(self._toward, self._half_field, strict=True)):
            # the smallest rotation that takes `aimed` to `toward`, then the axes of the lidar, then its error
            middle = aimed[:, k] + toward
            share = 1.0 / np.maximum(1.0 + aimed[:, k] @ toward, 1e-12)[:, None, None]
            back = np.eye(3) - middle[:, :, None] * middle[:, None, :] * share
            back = back + 2.0 * toward[:, None] * aimed[:, k, None, :]
            seen = turn @ (self._lidar_from_rtn[k] @ back)  # (run, 3, 3)
            at_m = -(position_m[:, k] + self._lever_m[k])
            place_m = np.einsum("rij,rj->ri", seen, at_m)
            origin[:, k] = is_in_field(place_m, half_field)
            # A sphere about the origin holds the hull. Only where it crosses an edge of the field is the hull looked at.
            depth_m = (half_field * place_m[:, 2:] - np.abs(place_m[:, :2])) / np.sqrt(1.0 + half_field**2)
            radius_m = 1.001 * np.linalg.norm(self._hull_m[:, k], axis=1).max()  # beyond any rounding
            whole[:, k] = np.all(depth_m > radius_m, axis=1)
            crossed = np.flatnonzero(~whole[:, k] & np.all(depth_m > -radius_m, axis=1))
            points = (at_m[crossed, None] + self._hull_m[:, k]) @ np.swapaxes(seen[crossed], 1, 2)
            whole[crossed, k] = is_in_field(points, half_field).all(axis=1)
        return origin, whole


def make_detection(
    scenario: Scenario, time_s: np.ndarray, range_m: tuple[float, float]
) -> Callable[[int, np.ndarray, np.ndarray], np.ndarray]:
    """Return the probability that a flash detects the target, as a function of range and energy.

    It is that of the link budget for one facet: as large as a side of the target, of its dimmest material, in a pixel of
    its own or a part of one.

    Parameters
    ----------
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
        probability: np.ndarray = np.where(is_armed, np.interp(photons, known, chance), 0.0)
        return probability

    return find
