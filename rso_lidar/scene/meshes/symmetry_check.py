"""Deviation of a mesh from a symmetry: distances between its surface and the same surface after a rotation."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from rso_lidar.records import Symmetry
from rso_lidar.scene.meshes.mesh import Mesh

PRECISION_M = 0.05  # of one range of the sensor of Fuller et al., sec. 5
_SIZE_FRACTION = 0.01  # of the longest side: the limit for craft that are small against the precision
_SAMPLES, _NEIGHBOURS = 60_000, 12  # points on the surface, and nearest points whose facets are compared
_QUERIES, _POOLED = 6_000, 36_000  # points for each rotation, and for all rotations of a continuous group together
_STEPS_DEG = (
    40.1  # between the angles at which a body of revolution is compared: none is a multiple of a simple fraction
)
_SEED = 17


@dataclass(frozen=True)
class SymmetryDeviation:
    """Distances between a surface and itself after the rotation of a group that changes it most.

    For a body of revolution, the distances after rotations by many angles are pooled.

    Attributes
    ----------
    mean_m, most_m, nearly_all_m : mean, 90th and 99th percentile over the area [m]
    limit_m : largest distance that a lidar does not notice in one pixel [m]
    """

    mean_m: float
    most_m: float
    nearly_all_m: float
    limit_m: float

    @property
    def is_symmetric(self) -> bool:
        """Whether a lidar cannot distinguish the rotations.

        The limit is the precision of one range, 5 cm, or 1 % of the longest side if that is less. 90 % of the area must
        agree within it, and 99 % within four times as much. Craft become recognisable at about a hundred pixels (Fuller et
        al., sec. 5), of which about one then differs by more than 4 sigma.
        """
        return self.most_m <= self.limit_m and self.nearly_all_m <= 4.0 * self.limit_m


def measure_symmetry(mesh: Mesh, symmetry: Symmetry) -> SymmetryDeviation:
    """Measure the deviation of a mesh from a symmetry.

    Points are drawn uniformly over the surface, and rotated. The distance of a rotated point from the surface is the least
    exact distance from the facets of its 12 nearest points. Materials are not compared. The random seed is fixed.

    Parameters
    ----------
    mesh : in metres
    symmetry : group of rotations, in the axes of the mesh

    Returns
    -------
    SymmetryDeviation
    """
    from scipy.spatial import cKDTree
    from scipy.spatial.transform import Rotation
    from trimesh import triangles

    closest_point: Any = triangles.closest_point  # trimesh has no types

    corners = mesh.vertices[mesh.facets]
    points, facet = _draw_points(corners, np.random.Generator(np.random.Philox(_SEED)))
    tree, rotations = cKDTree(points), symmetry.rotations_xyzw(_STEPS_DEG)[1:]
    is_continuous = symmetry.is_sphere or symmetry.fold == 0
    count = _POOLED // len(rotations) if is_continuous else _QUERIES
    distances = []
    for rotation, shift_m in zip(rotations, symmetry.translations_m(rotations), strict=True):
        turned = Rotation.from_quat(rotation).apply(points[:count]) + shift_m
        nearest = facet[tree.query(turned, k=_NEIGHBOURS)[1]]
        places = np.repeat(turned, _NEIGHBOURS, axis=0)
        distance_m = np.linalg.norm(closest_point(corners[nearest.ravel()], places) - places, axis=1)
        distances.append(distance_m.reshape(-1, _NEIGHBOURS).min(axis=1))
    compared = [np.concatenate(distances)] if is_continuous else distances
    mean_m = max(float(deviations_m.mean()) for deviations_m in compared)
    most_m, nearly_all_m = np.max(
        [np.percentile(deviations_m, (90.0, 99.0)) for deviations_m in compared], axis=0
    ).tolist()
    limit_m = min(PRECISION_M, _SIZE_FRACTION * float(mesh.size_m.max()))
    return SymmetryDeviation(mean_m, most_m, nearly_all_m, limit_m)


def _draw_points(corners: np.ndarray, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Draw points uniformly over a surface, in random order; return them (point, xyz) and the facet of each (point).

    Parameters
    ----------
    corners : (facet, 3, xyz)
    """
    areas = 0.5 * np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    summed = np.cumsum(areas)
    strata = (rng.permutation(_SAMPLES) + rng.random(_SAMPLES)) * (summed[-1] / _SAMPLES)
    facet = np.minimum(np.searchsorted(summed, strata), len(areas) - 1)
    root, share = np.sqrt(rng.random(_SAMPLES)), rng.random(_SAMPLES)
    weights = np.stack([1.0 - root, root * (1.0 - share), root * share], axis=1)
    return np.einsum("pk,pki->pi", weights, corners[facet]), facet
