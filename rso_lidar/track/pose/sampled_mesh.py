"""A target's mesh as points with normals, in body axes, at the angles of its hinges."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, SupportsFloat

import numpy as np

from rso_lidar.errors import ScenarioError, did_you_mean

if TYPE_CHECKING:
    from scipy.spatial.transform import Rotation


@dataclass(frozen=True)
class MeshHinge:
    """A hinge of a mesh: its facets turn right-handed about `axis` (any length) through `position_m` [m], body axes."""

    name: str
    position_m: tuple[float, float, float]
    axis: tuple[float, float, float]

    @property
    def direction(self) -> np.ndarray:
        """Unit vector (xyz) of the hinge line in body axes."""
        axis = np.array(self.axis, dtype=float)
        direction: np.ndarray = axis / np.linalg.norm(axis)
        return direction

    def turn(self, points_m: np.ndarray, angle_rad: float) -> np.ndarray:
        """Turn points about the hinge.

        Parameters
        ----------
        points_m : (…, xyz) in body axes [m]
        angle_rad : right-handed angle [rad]

        Returns
        -------
        the turned points (…, xyz) [m]
        """
        at = np.array(self.position_m)
        turned: np.ndarray = at + (points_m - at) @ self.make_rotation(angle_rad).as_matrix().T
        return turned

    def make_rotation(self, angle_rad: float) -> Rotation:
        """Return the rotation about the hinge line, in body axes.

        Parameters
        ----------
        angle_rad : right-handed angle [rad]
        """
        from scipy.spatial.transform import Rotation

        return Rotation.from_rotvec(angle_rad * self.direction)


@dataclass(frozen=True, eq=False)
class SampledMesh:
    """Points (point, 3) [m] spread evenly over a mesh, in body axes, with their facets' unit normals.

    Of a mesh with hinges, `hinge_of` (point) is the index of the hinge that carries each point, -1 for the body.
    `hinge_angles_rad` (hinge) are the angles at which the points stand, and `at_zero` is the mesh with all of them at zero.
    """

    points_m: np.ndarray
    normals: np.ndarray
    hinges: tuple[MeshHinge, ...] = ()
    hinge_of: np.ndarray | None = None
    hinge_angles_rad: tuple[float, ...] = ()
    at_zero: SampledMesh | None = None

    @cached_property
    def tree(self) -> Any:
        """Points as scipy's k-d tree."""
        from scipy.spatial import cKDTree

        return cKDTree(self.points_m)

    @cached_property
    def part_trees(self) -> tuple[tuple[np.ndarray, Any], ...]:
        """Numbers of the points of the body and of each hinge, and these points as scipy's k-d tree."""
        from scipy.spatial import cKDTree

        assert self.hinge_of is not None
        numbers = [np.flatnonzero(self.hinge_of == hinge) for hinge in range(-1, len(self.hinges))]
        return tuple((some, cKDTree(self.points_m[some])) for some in numbers)

    @cached_property
    def middle_m(self) -> np.ndarray:
        """Mean of the points (xyz) [m]."""
        middle: np.ndarray = self.points_m.mean(axis=0)
        return middle

    @cached_property
    def principal_axes(self) -> np.ndarray:
        """Unit vectors (axis, xyz) of the principal axes of the points, that of the least spread first."""
        off = self.points_m - self.middle_m
        axes: np.ndarray = np.linalg.eigh(np.einsum("ni,nj->ij", off, off))[1].T
        return axes

    @property
    def long_axis(self) -> np.ndarray:
        """Unit vector (xyz) along which the points spread most."""
        longest: np.ndarray = self.principal_axes[-1]
        return longest

    @cached_property
    def radius_m(self) -> float:
        """Distance of the farthest point from the mean [m]."""
        return float(np.sqrt(((self.points_m - self.middle_m) ** 2).sum(axis=1).max()))

    def turn_hinges(self, angles_rad: Mapping[str, float]) -> SampledMesh:
        """Return the mesh with its hinges at other angles; itself where no angle is given.

        Parameters
        ----------
        angles_rad : angle of each hinge by its name [rad], right-handed from the mesh at zero; those not named stay

        Raises
        ------
        ScenarioError
            If there is no hinge of a name, or an angle is not finite
        """
        names = [hinge.name for hinge in self.hinges]
        for name, angle_rad in angles_rad.items():
            if name not in names:
                known = f" (known: {', '.join(names)})" if names else "; the mesh has no hinges"
                raise ScenarioError(f"icp: no hinge named '{name}'{did_you_mean(name, names)}{known}")
            if np.ndim(angle_rad) or not isinstance(angle_rad, SupportsFloat) or not np.isfinite(float(angle_rad)):
                raise ScenarioError(
                    f"icp: hinge {name}: {angle_rad!r:.40} is no angle; give a finite number in radians"
                )
        if not angles_rad:
            return self
        angles = tuple(float(angles_rad.get(name, at)) for name, at in zip(names, self.hinge_angles_rad, strict=True))
        points, normals = self.locate(np.arange(len(self.points_m)), angles)
        return replace(self, points_m=points, normals=normals, hinge_angles_rad=angles, at_zero=self.at_zero or self)

    def find_nearest(
        self, points_m: np.ndarray, angles_rad: Sequence[float] | np.ndarray | None = None
    ) -> tuple[np.ndarray, np.ndarray]:
        """Find the nearest point of the mesh for each of some points.

        Parameters
        ----------
        points_m : points (n, xyz) in body axes [m]
        angles_rad : of the hinges [rad]; None for those at which the points of the mesh stand

        Returns
        -------
        distances (n) [m] and numbers (n) of the nearest points
        """
        if not self.hinges:
            neighbours: tuple[np.ndarray, np.ndarray] = self.tree.query(points_m)
            return neighbours
        angles = self.hinge_angles_rad if angles_rad is None else angles_rad
        apart, nearest = self.find_nearest_on_part(points_m, -1)
        for hinge, angle_rad in enumerate(angles):
            here, number = self.find_nearest_on_part(points_m, hinge, angle_rad)
            closer = here < apart
            apart[closer], nearest[closer] = here[closer], number[closer]
        return apart, nearest

    def locate(self, numbers: np.ndarray, angles_rad: Sequence[float] | np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return points (n, xyz) [m] and normals of the mesh in body axes.

        Parameters
        ----------
        numbers : of the points (n)
        angles_rad : of the hinges [rad]
        """
        zero = self.at_zero or self
        points, normals = zero.points_m[numbers], zero.normals[numbers]
        for number, (hinge, angle_rad) in enumerate(zip(self.hinges, angles_rad, strict=True)):
            assert self.hinge_of is not None
            carried = self.hinge_of[numbers] == number
            points[carried] = hinge.turn(points[carried], angle_rad)
            normals[carried] = hinge.make_rotation(angle_rad).apply(normals[carried])
        return points, normals

    def find_nearest_on_part(
        self, points_m: np.ndarray, part: int, angle_rad: float = 0.0
    ) -> tuple[np.ndarray, np.ndarray]:
        """Find the nearest point of the body or of what a hinge carries, for each of some points.

        Parameters
        ----------
        points_m : points (n, xyz) in body axes [m]
        part : index of the hinge, -1 for the body
        angle_rad : angle of the hinge [rad]

        Returns
        -------
        distances (n) [m], infinite where the part has no points, and numbers (n) of the nearest points
        """
        numbers, tree = (self.at_zero or self).part_trees[part + 1]
        if not len(numbers):
            return np.full(len(points_m), np.inf), np.zeros(len(points_m), dtype=int)
        if part >= 0:
            points_m = self.hinges[part].turn(points_m, -angle_rad)
        apart, nearest = tree.query(points_m)
        return apart, numbers[nearest]


def sample_mesh(
    corners_m: np.ndarray,
    count: int = 20_000,
    rng: np.random.Generator | None = None,
    *,
    hinges: Sequence[MeshHinge] = (),
    hinge_of_facet: np.ndarray | None = None,
) -> SampledMesh:
    """Sample points evenly over the area of a mesh.

    Parameters
    ----------
    corners_m : corners (facet, 3, xyz) of its facets [m], with all hinges at zero
    count : number of points
    rng : random generator for the points; None for a fixed sequence
    hinges : of the mesh, about which some of its facets turn
    hinge_of_facet : (facet) index of the hinge that carries each facet, -1 for the body; required with hinges

    Returns
    -------
    points and normals of the mesh, in its axes

    Raises
    ------
    ScenarioError
        If the corners have another shape, or the hinges of the facets do not match
    """
    corners = np.asarray(corners_m, dtype=float)
    if corners.ndim != 3 or corners.shape[1:] != (3, 3) or not len(corners):
        raise ScenarioError(f"icp: the corners of facets are (facet, 3, xyz), not {corners.shape}")
    rng = rng or np.random.Generator(np.random.Philox(count))
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    double = np.sqrt((normal**2).sum(axis=1))
    facet = rng.choice(len(corners), count, p=double / double.sum())
    a, b = np.sort(rng.random((2, count)), axis=0)  # even over a triangle
    first, second, third = (corners[facet, k] for k in range(3))
    points = a[:, None] * first + (b - a)[:, None] * second + (1.0 - b)[:, None] * third
    normals = normal[facet] / double[facet, None]
    if not hinges:
        return SampledMesh(points, normals)
    of_facet = _check_hinges(hinges, hinge_of_facet, len(corners))
    return SampledMesh(points, normals, tuple(hinges), of_facet[facet], (0.0,) * len(hinges))


def _check_hinges(hinges: Sequence[MeshHinge], hinge_of_facet: np.ndarray | None, facets: int) -> np.ndarray:
    """Check the hinges of a mesh, and return the hinge of each facet (facet), -1 for the body."""
    of_facet = np.asarray(-1 if hinge_of_facet is None else hinge_of_facet)
    if of_facet.shape != (facets,) or of_facet.min() < -1 or of_facet.max() >= len(hinges):
        raise ScenarioError(
            f"icp: hinge_of_facet: needs an index from -1 to {len(hinges) - 1} for each of {facets} facets; correct it"
        )
    if len({hinge.name for hinge in hinges}) != len(hinges):
        raise ScenarioError("icp: two hinges have the same name; rename one")
    for hinge in hinges:
        if not (np.isfinite([*hinge.axis, *hinge.position_m]).all() and np.any(hinge.axis)):
            raise ScenarioError(f"icp: hinge {hinge.name}: needs a finite position and an axis that is not zero")
    return of_facet


def spread_rotations(count: int) -> list[Rotation]:
    """Return rotations that are even over all rotations (super-Fibonacci spiral, Alexa 2022)."""
    from scipy.spatial.transform import Rotation

    s = np.arange(count) + 0.5
    t = s / count
    alpha, beta = 2.0 * np.pi * s / np.sqrt(2.0), 2.0 * np.pi * s / 1.533751168755204288118041413
    near, far = np.sqrt(t), np.sqrt(1.0 - t)
    quaternions = np.stack([near * np.sin(alpha), near * np.cos(alpha), far * np.sin(beta), far * np.cos(beta)], axis=1)
    return [Rotation.from_quat(quaternion) for quaternion in quaternions]


def measure_visible_centroid(model: SampledMesh, directions: int = 60, cells: int = 32) -> tuple[float, float, float]:
    """Measure the offset of the visible centroid of a model from its origin, over all viewing directions.

    Parameters
    ----------
    model : of the target
    directions : number of viewing directions
    cells : cells per side of the grid about the model; the nearest point in each cell is visible

    Returns
    -------
    mean along the line of sight [m], negative toward the lidar; its standard deviation [m]; rms across it per axis [m]
    """
    along, across = [], []
    width = 2.0 * model.radius_m / cells
    for rotation in spread_rotations(directions):
        shown = rotation.apply(model.points_m)
        place = np.floor((shown[:, :2] - rotation.apply(model.middle_m)[:2]) / width).astype(int) + cells
        cell = place[:, 0] * (2 * cells) + place[:, 1]
        order = np.lexsort((shown[:, 2], cell))
        nearest = order[np.flatnonzero(np.diff(cell[order], prepend=-1))]
        middle = shown[nearest].mean(axis=0)
        along.append(middle[2])
        across.append(middle[:2])
    return float(np.mean(along)), float(np.std(along)), float(np.sqrt(np.mean(np.square(across))))
