"""Tabulation of sunlight and air on a target over all directions."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from rso_lidar.parallel import run_in_threads
from rso_lidar.records import FacetTable, grid_directions
from rso_lidar.scene.surface_forces.exposure import FacetPoints, find_free, spread_points
from rso_lidar.scene.surface_forces.facet_laws import GasLaw, find_light_coefficients
from rso_lidar.scene.surfaces.surface import Surface

Poses = Sequence[tuple[np.ndarray, np.ndarray]]
_GRAZING = 0.02  # cosine of the ray by which a facet that is turned from the flow is asked whether air reaches it
_THERMAL = (
    2.0  # over the speed ratio: turned away by a larger cosine, a facet gets less than 1e-3 / s of the air's flux
)


class _Placed(NamedTuple):
    """Points of all surfaces in body axes: position [m], normal and their product [m] (xyz, point), area [m2], part."""

    position: np.ndarray
    normal: np.ndarray
    arm: np.ndarray
    area: np.ndarray
    part: np.ndarray
    poses: Poses


@dataclass(frozen=True, eq=False)
class FacetLoads:
    """What computes force and torque on a target from one direction, by its facets.

    Parameters
    ----------
    surfaces : surfaces of the target: that of its body, then those of its hinges
    specular, diffuse : (part) shares of sunlight that each part reflects as a mirror, and by Lambert's law
    gas : law of the air
    place : gives the origins [m] and rotations of the surfaces in body axes for a direction (xyz) toward the Sun. None:
        all surfaces are in body axes
    points : number of points on the facets, about
    """

    surfaces: Sequence[Surface]
    specular: np.ndarray
    diffuse: np.ndarray
    gas: GasLaw
    place: Callable[[np.ndarray], Poses] | None = None
    points: int = 4096

    def __post_init__(self) -> None:
        area = sum(surface.area_m2 for surface in self.surfaces)
        spread = [spread_points(s, max(int(self.points * s.area_m2 / area), 1)) for s in self.surfaces]
        object.__setattr__(self, "_spread", tuple(spread))

    def compute(self, direction: np.ndarray) -> np.ndarray:
        """Compute the loads of sunlight and of air from one direction.

        Parameters
        ----------
        direction : unit vector (xyz) toward the Sun, or along the velocity through the air, in body axes

        Returns
        -------
        (4, xyz) f8: force [m2] and torque [m3] of sunlight over its pressure, then of air over its dynamic pressure
        """
        position, normal, arm, area, part, poses = self._place(direction)
        cosine = direction @ normal
        side = np.where(cosine < 0.0, -1.0, 1.0)
        facing, cosine = normal * side, np.abs(cosine)
        toward = np.broadcast_to(direction[:, None], normal.shape)
        lit = area * find_free(position, facing, toward, self.surfaces, poses)
        along, outward = find_light_coefficients(cosine, self.specular[part], self.diffuse[part])
        light = lit * along, lit * outward * side
        along, outward = self.gas.find_coefficients(cosine)
        air = lit * along, lit * outward * side
        # Molecules move about, and so reach the sides that are turned a little from the flow.
        rear = np.flatnonzero(cosine < _THERMAL / self.gas.speed_ratio)
        back, leaning = -facing[:, rear], cosine[rear]
        lifted = toward[:, rear] + (leaning + _GRAZING) * back
        lifted /= np.linalg.norm(lifted, axis=0)
        reached = area[rear] * find_free(position[:, rear], back, lifted, self.surfaces, poses)
        along, outward = self.gas.find_coefficients(-leaning)
        air[0][rear] += reached * along
        air[1][rear] -= reached * outward * side[rear]
        rows = []
        for toward_source, along_normal in (light, air):
            rows.append(-(toward_source.sum() * direction + normal @ along_normal))
            rows.append(-(np.cross(position @ toward_source, direction) + arm @ along_normal))
        return np.array(rows)

    def _place(self, direction: np.ndarray) -> _Placed:
        """Return the points in body axes for a direction (xyz); those of a target without hinges are kept."""
        kept: _Placed | None = getattr(self, "_kept", None)
        if kept is not None:
            return kept
        still = [(np.zeros(3), np.eye(3))] * len(self.surfaces)
        poses = still if self.place is None else self.place(direction)
        spread: tuple[FacetPoints, ...] = self._spread  # type: ignore[attr-defined]
        position = np.concatenate(
            [r @ p.position + o[:, None] for p, (o, r) in zip(spread, poses, strict=True)], axis=1
        )
        normal = np.concatenate([r @ p.normal for p, (_, r) in zip(spread, poses, strict=True)], axis=1)
        area, part = np.concatenate([p.area for p in spread]), np.concatenate([p.part for p in spread])
        placed = _Placed(position, normal, np.cross(position, normal, axis=0), area, part, poses)
        if self.place is None:
            object.__setattr__(self, "_kept", placed)
        return placed


def tabulate_loads(loads: FacetLoads, step_deg: float = 7.5, threads: int | None = None) -> FacetTable:
    """Tabulate the loads of sunlight and of air on a target over all directions.

    Parameters
    ----------
    loads : what computes them from one direction
    step_deg : angle between directions, about [deg]

    Other Parameters
    ----------------
    threads : number of threads (None: one for each core)

    Returns
    -------
    FacetTable
        in the target's body axes, torques about its origin
    """
    rows = max(round(180.0 / step_deg), 4)
    directions = grid_directions(rows, 2 * rows)
    bands = run_in_threads(threads, lambda row: np.array([loads.compute(way) for way in directions[row]]), range(rows))
    table = np.array(bands)
    return FacetTable(*(table[:, :, k] for k in range(4)))


def measure_error(loads: FacetLoads, table: FacetTable, count: int = 200) -> tuple[float, float]:
    """Compare a table with loads that are computed directly, between its directions.

    Parameters
    ----------
    loads, table : of one target
    count : number of directions, spread evenly over the sphere

    Returns
    -------
    greatest error of the force of sunlight, and of air, over the greatest force in the table
    """
    k = np.arange(count) + 0.5
    z, turn = 1.0 - 2.0 * k / count, np.pi * (1.0 + 5.0**0.5) * k
    flat = np.sqrt(1.0 - z**2)
    ways = np.column_stack([flat * np.cos(turn), flat * np.sin(turn), z])
    direct = np.array([loads.compute(way) for way in ways])
    errors = []
    for column, tabulated, whole in (
        (0, table.find_light_load(ways)[0], table.light_force_m2),
        (2, table.find_air_load(ways)[0], table.air_force_m2),
    ):
        greatest = float(np.linalg.norm(whole, axis=-1).max())
        errors.append(float(np.linalg.norm(tabulated - direct[:, column], axis=-1).max()) / greatest)
    return errors[0], errors[1]
