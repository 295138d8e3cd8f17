"""Attitudes of one body before one camera: the probability that it is found in them, and the worst."""

from __future__ import annotations

import math
from collections.abc import Sequence
from concurrent.futures import Executor
from contextlib import ExitStack
from itertools import product
from typing import Self

import numpy as np

from rso_lidar import units
from rso_lidar.detector import report_probability
from rso_lidar.errors import ScenarioError, suppress_warnings
from rso_lidar.records import Truth
from rso_lidar.scenario import (
    Finding,
    Lidar,
    Scenario,
    cast_surfaces,
    list_run_attitudes,
    move_target,
    open_aspects,
    preview_mission,
    spread_attitudes,
)

_TRIED, _FEW_PLACES = 256, 4  # attitudes that are tried for the worst, and places in the pixel grid for each
# Of them so many are looked at more closely, at so many places; and of these so many are turned.
_WORST, _PLACES, _STARTS = 10, 12, 2
_TURNS_DEG = (15.0, 8.0, 4.0, 2.0)  # by which they are turned
_MOST_RAYS = 60_000  # of one cast: a near body fills many pixels, and is found by each of them

Attitude = tuple[int, np.ndarray]  # a row of the preview, which gives the hinges, and lidar_from_body (3, 3)
_MOST_ALIGNED_DEG = 10.0  # an axis closer than this to a direction is described as pointing there


class AttitudeSearch:
    """Probabilities of one body before one camera, at any range; a context manager, which may hold workers."""

    def __init__(
        self,
        lidar: Lidar,
        scenario: Scenario,
        number: int,
        finding: Finding,
        attitudes: int,
        *,
        in_run: bool,
        executor: Executor | None = None,
    ) -> None:
        """Prepare the attitudes, and the threads or workers that evaluate them."""
        with suppress_warnings():
            self._preview = preview_mission(scenario)
        self._lidar, self._scenario, self._number = lidar, scenario, number
        self._surfaces = scenario.surfaces_of(number)
        self.radius_m = self._preview.targets[number].radius_m
        matrices, self._phases = spread_attitudes(attitudes)
        self._attitudes: list[Attitude] = [(0, matrix) for matrix in matrices]
        self._others: list[Attitude] = [(0, matrix) for matrix in list_facing_attitudes()]
        if in_run:
            self._attitudes = list_run_attitudes(self._preview, scenario.target[number].name, attitudes)
            self._others = []
            if not self._attitudes:
                raise ScenarioError("attitudes of the run: the lidar is always at the target's origin; leave them out")
        self._known: dict[tuple[float, int], float] = {}
        self._context = ExitStack()
        self._find = self._context.enter_context(open_aspects(self._surfaces, number, finding, executor))

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        self._context.close()

    def over_attitudes(self, range_m: float, n: int) -> float:
        """Return the probability at a range [m], the mean over the first `n` attitudes, or some of a run's."""
        n = min(n, len(self._attitudes))
        if (range_m, n) not in self._known:
            some = np.linspace(0, len(self._attitudes) - 1, n).round().astype(int) if not self._others else range(n)
            probabilities, _ = self._evaluate([self._attitudes[k] for k in some], range_m, self._phases[:n])
            self._known[range_m, n] = float(probabilities.mean())
        return self._known[range_m, n]

    def of_attitude(self, attitude: Attitude, range_m: float, n: int) -> float:
        """Return the probability of one attitude at a range [m], the mean over `n` places in the pixel grid."""
        probabilities, _ = self._evaluate([attitude] * n, range_m, spread_attitudes(n)[1])
        return float(probabilities.mean())

    def find_worst(self, range_m: float) -> Attitude:
        """Find the attitude of least probability at a range [m]; of equal ones that with the fewest photons.

        Attitudes are tried at a few places in the pixel grid. Those in which a face, an edge or a corner of the body's box
        faces the lidar are among them. The worst ones are then turned by smaller and smaller angles, as long as that makes
        them worse.
        """
        from scipy.spatial.transform import Rotation

        tried = self._rank([*self._attitudes[:_TRIED], *self._others], range_m, _FEW_PLACES)[:_WORST]
        ranked = self._rank([attitude for attitude, _ in tried], range_m, _PLACES)
        if not self._others:  # attitudes of a run
            return ranked[0][0]
        ends = []
        for worst, value in ranked[:_STARTS]:
            for turn_deg in _TURNS_DEG:
                turns = Rotation.from_rotvec(np.vstack([np.eye(3), -np.eye(3)]) * turn_deg, degrees=True).as_matrix()
                beside, lower = self._rank([(worst[0], turn @ worst[1]) for turn in turns], range_m, _PLACES)[0]
                if lower < value:
                    worst, value = beside, lower
            ends.append((value, worst))
        return min(ends, key=lambda end: end[0])[1]

    def _rank(
        self, attitudes: Sequence[Attitude], range_m: float, n: int
    ) -> list[tuple[Attitude, tuple[float, float]]]:
        """Rank attitudes at a range [m] from the worst, with their probabilities and photons, over `n` grid places."""
        places = np.tile(spread_attitudes(n)[1], (len(attitudes), 1))
        probabilities, photons = self._evaluate([attitude for attitude in attitudes for _ in range(n)], range_m, places)
        means = np.stack([probabilities.reshape(-1, n).mean(axis=1), photons.reshape(-1, n).mean(axis=1)], axis=1)
        order = np.lexsort([means[:, 1], means[:, 0]])
        return [(attitudes[k], (float(means[k, 0]), float(means[k, 1]))) for k in order]

    def is_by_pixel(self, range_m: float) -> bool:
        """Return whether the detector gives the probability of each pixel for this body at a range [m]."""
        lidar = follow_gate(self._lidar, range_m)
        there = self._place(self._attitudes[0], range_m, np.zeros(2))
        light = cast_surfaces(lidar, self._surfaces, there, self._number, 1).light
        return report_probability(lidar.detector, light, np.ones(len(light.pixel), bool)) is not None

    def _evaluate(
        self, attitudes: Sequence[Attitude], range_m: float, phases: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return probabilities and photons of attitudes at a range [m]; phases (attitude, right_down) in the pixel grid."""
        lidar = follow_gate(self._lidar, range_m)
        truths = [self._place(attitude, range_m, phase) for attitude, phase in zip(attitudes, phases, strict=True)]
        covered = math.pi * (self.radius_m / range_m / lidar.receiver.pixel_tangent) ** 2
        finest = max(math.isqrt(int(_MOST_RAYS / max(covered, 1.0))), 1)
        return self._find(lidar, truths, finest)

    def _place(self, attitude: Attitude, range_m: float, phase: np.ndarray) -> Truth:
        """Return the truth of the body in one pose at a range [m], at a place (right_down) in the pixel grid."""
        row, turned = attitude
        place_m = place_body(self._lidar, range_m, phase)
        return move_target(self._scenario, self._number, self._preview.truth.at(row), place_m, turned)


def place_body(lidar: Lidar, range_m: float, phase: np.ndarray) -> np.ndarray:
    """Return the place (xyz) [m] in lidar axes of a body at a range, beside the boresight by parts of a pixel."""
    x, y = phase * lidar.receiver.pixel_tangent
    place_m: np.ndarray = np.array([x, y, 1.0]) * (range_m / math.sqrt(1.0 + x * x + y * y))
    return place_m


def follow_gate(lidar: Lidar, range_m: float) -> Lidar:
    """Return the instrument with a range in the middle of its gate; the same without a gate."""
    traits = lidar.detector.traits
    if not traits.is_gated:
        return lidar
    opens_m = max(range_m - 0.5 * (traits.sees_to_m - traits.sees_from_m), 0.0)
    return lidar.with_settings({"gate_delay_ns": opens_m / units.RANGE_PER_DELAY_M_S / units.NS})


def list_facing_attitudes() -> np.ndarray:
    """Return the attitudes (attitude, 3, 3) in which a face, an edge or a corner of the body's box faces the lidar."""
    directions = [np.array(signs, dtype=float) for signs in product((-1, 0, 1), repeat=3) if any(signs)]
    return np.array([face_direction(direction / np.linalg.norm(direction)) for direction in directions])


def face_direction(toward: np.ndarray) -> np.ndarray:
    """Return lidar_from_body, a matrix (3, 3), of a body on the boresight with one direction toward the lidar.

    Parameters
    ----------
    toward : (xyz) unit vector in body axes
    """
    across = np.cross(toward, np.eye(3)[np.abs(toward).argmin()])
    across /= np.linalg.norm(across)
    return np.array([across, np.cross(-toward, across), -toward])


def describe_facing(lidar_from_body: np.ndarray) -> str:
    """Describe which body axis faces the lidar, for a body on the boresight.

    >>> describe_facing(face_direction(np.array([0.0, 0.0, 1.0])))
    '+z faces the lidar'
    """
    toward = -lidar_from_body[2]  # the lidar is at −z of its own axes, seen from the body
    order = np.argsort(-np.abs(toward), kind="stable")
    first, second = (f"{'+' if toward[k] > 0.0 else '−'}{'xyz'[k]}" for k in order[:2])
    off_deg = math.acos(min(abs(float(toward[order[0]])), 1.0)) / units.DEG
    if off_deg < 0.5:
        return f"{first} faces the lidar"
    if off_deg < _MOST_ALIGNED_DEG:
        return f"{first} faces the lidar within {off_deg:.0f}°"
    return f"{first} faces the lidar, tilted by {off_deg:.0f}° toward {second}"
