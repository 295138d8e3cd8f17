"""What a target is made of, as far as a view of it in space needs: the corners of its facets and the edges one sees."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

SHARP_COS = 0.9  # cosine of the angle between two facets (26 degrees) below which their edge is drawn
MOST_EDGES = 2500  # the longest; more would blacken a small picture


@dataclass(frozen=True, eq=False)
class Shape:
    """Facets that turn with some axes: `corners_m` (facet, 3, xyz) [m] in the axes named `axes`, such as ``tdrs.array``."""

    axes: str
    corners_m: np.ndarray

    @property
    def target(self) -> str:
        """Name of the target that the shape is, or is a part of."""
        return self.axes.partition(".")[0]

    @cached_property
    def radius_m(self) -> float:
        """Distance [m] of the farthest corner from the origin of the axes."""
        return float(np.sqrt((self.corners_m**2).sum(axis=-1).max(initial=0.0)))

    @cached_property
    def normals(self) -> np.ndarray:
        """Unit normals of the facets (facet, xyz) by winding, zero for a facet without area."""
        first_side, second_side = (self.corners_m[:, k] - self.corners_m[:, 0] for k in (1, 2))
        normals = np.cross(first_side, second_side)
        length = np.sqrt((normals**2).sum(axis=-1, keepdims=True))
        return np.asarray(normals / np.where(length > 0, length, 1.0))

    @cached_property
    def edges_m(self) -> np.ndarray:
        """Ends (edge, 2, xyz) [m] of the edges where the surface ends or bends sharply; the longest `MOST_EDGES`.

        Corners closer than a millionth of the radius are one: in many files no facet shares its corners with the next.
        """
        if not len(self.corners_m):
            return np.zeros((0, 2, 3))
        grid = np.round(self.corners_m.reshape(-1, 3) / (1e-6 * max(self.radius_m, 1e-9))).astype(np.int64)
        _, first, place = np.unique(grid, axis=0, return_index=True, return_inverse=True)
        corner = place.reshape(-1, 3)
        pairs = np.sort(np.concatenate([corner[:, [0, 1]], corner[:, [1, 2]], corner[:, [2, 0]]]), axis=1)
        facet = np.tile(np.arange(len(corner)), 3)
        real = pairs[:, 0] != pairs[:, 1]
        pairs, facet = pairs[real], facet[real]
        edges, edge, count = np.unique(pairs, axis=0, return_inverse=True, return_counts=True)
        order = np.argsort(edge.reshape(-1), kind="stable")
        starts = np.cumsum(count) - count
        first_facet, last_facet = facet[order[starts]], facet[order[starts + count - 1]]
        bend = np.abs(
            (self.normals[first_facet] * self.normals[last_facet]).sum(axis=-1)
        )  # winding does not tell which side is outside
        seen = (count != 2) | (bend < SHARP_COS)
        ends = self.corners_m.reshape(-1, 3)[first[edges[seen]]]
        length = ((ends[:, 1] - ends[:, 0]) ** 2).sum(axis=-1)
        return np.asarray(ends[np.argsort(-length, kind="stable")[:MOST_EDGES]])
