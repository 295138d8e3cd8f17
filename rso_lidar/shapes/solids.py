"""Closed solids with outward facets, and how they are joined, drawn along a line and skinned. Metres, NumPy only."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np

from rso_lidar.pose import dot
from rso_lidar.units import DEG

Point = Sequence[float]

_TIE = 1e-6  # components of a unit vector that differ by less count as equal, so that rounding decides nothing


class Solid(NamedTuple):
    """A closed surface of triangles: `vertices` (n, 3) [m] and `facets` (k, 3), wound so that normals point outward."""

    vertices: np.ndarray
    facets: np.ndarray

    def move(self, x: float = 0.0, y: float = 0.0, z: float = 0.0) -> Solid:
        """Return the solid shifted by a displacement.

        Parameters
        ----------
        x, y, z : displacement [m]
        """
        return Solid(self.vertices + np.array([x, y, z], dtype=float), self.facets)

    def turn(self, axis: str, angle_deg: float) -> Solid:
        """Return the solid turned about an axis through the origin.

        Parameters
        ----------
        axis : "x", "y" or "z"
        angle_deg : right-handed angle [deg]
        """
        i, j = {"x": (1, 2), "y": (2, 0), "z": (0, 1)}[axis]
        cos, sin = math.cos(angle_deg * DEG), math.sin(angle_deg * DEG)
        vertices = self.vertices.copy()
        vertices[:, i] = cos * self.vertices[:, i] - sin * self.vertices[:, j]
        vertices[:, j] = sin * self.vertices[:, i] + cos * self.vertices[:, j]
        return Solid(vertices, self.facets)

    def facing(self, direction: Point) -> Solid:
        """Return the solid turned so that its +z points along a direction, and its +x is normal to y (or to x).

        Parameters
        ----------
        direction : (x, y, z) of any length
        """
        z = np.asarray(direction, dtype=float)
        z = z / np.linalg.norm(z)
        side = np.array([0.0, 1.0, 0.0]) if abs(z[1]) < 0.9 else np.array([1.0, 0.0, 0.0])
        x = np.cross(side, z)
        x /= np.linalg.norm(x)
        return Solid(self.vertices @ np.array([x, np.cross(z, x), z]), self.facets)

    def mirror(self, axis: str) -> Solid:
        """Return the solid mirrored across a plane through the origin; facets still face outward.

        Parameters
        ----------
        axis : "x", "y" or "z", the normal of the plane
        """
        sign = np.array([-1.0 if name == axis else 1.0 for name in "xyz"])
        return Solid(self.vertices * sign, self.facets[:, ::-1])

    def volume_m3(self) -> float:
        """Return the enclosed volume [m3]; negative where facets face inward."""
        return math.fsum(self.tetrahedra_m3().tolist())  # exactly rounded, so that every processor finds the same

    def tetrahedra_m3(self) -> np.ndarray:
        """Return the signed volumes (facet) [m3] of the tetrahedra from the origin to each facet."""
        a, b, c = (self.vertices[self.facets[:, k]] for k in range(3))
        return dot(a, np.cross(b, c)) / 6.0


def join(*solids: Solid) -> Solid:
    """Join several closed solids to one; they may interpenetrate.

    Parameters
    ----------
    *solids : closed solids, in the order of their vertices and facets in the result

    Returns
    -------
    Solid
        All vertices and facets of the solids, unchanged.
    """
    starts = np.cumsum([0, *(len(solid.vertices) for solid in solids)])
    return Solid(
        np.concatenate([solid.vertices for solid in solids]),
        np.concatenate([solid.facets + start for solid, start in zip(solids, starts[:-1], strict=True)]),
    )


def pipe(points_m: Iterable[Point], radius_m: float, sides: int = 8) -> Solid:
    """Return a bar of round section along a polyline, closed at both ends.

    Parameters
    ----------
    points_m : of the polyline
    radius_m : of the section
    sides : facets around; few make a polygon
    """
    points = np.asarray(list(points_m), dtype=float)
    steps = np.diff(points, axis=0)
    steps /= np.linalg.norm(steps, axis=1, keepdims=True)
    tangents = np.concatenate([steps[:1], steps[:-1] + steps[1:], steps[-1:]])
    tangents /= np.linalg.norm(tangents, axis=1, keepdims=True)
    slant = np.abs(tangents[0])
    across, before = np.eye(3)[np.argmax(slant < slant.min() + _TIE)], tangents[0]
    angle = (np.arange(sides) + 0.5) * (2.0 * math.pi / sides)
    sections = []
    for point, tangent in zip(points, tangents, strict=True):
        # The shortest turn from one tangent to the next, so that the bar does not twist (Bishop 1975, Am. Math. Monthly 82)
        across = across - (before + tangent) * ((across @ tangent) / (1.0 + before @ tangent))
        across = across - tangent * (across @ tangent)
        across, before = across / np.linalg.norm(across), tangent
        up = np.cross(tangent, across)
        sections.append(point + radius_m * (np.outer(np.cos(angle), across) + np.outer(np.sin(angle), up)))
    return skin(sections)


def skin(outlines_m: Sequence[Sequence[Point] | np.ndarray]) -> Solid:
    """Return the solid inside a skin over several outlines, closed by fans over the first and the last outline.

    Parameters
    ----------
    outlines_m : (outline, corner, 3) points [m], with equal numbers of corners, corresponding corners in the same
        place. Either sense of the outlines is allowed: facets are turned outward
    """
    outlines = np.asarray(outlines_m, dtype=float)
    number, corners = outlines.shape[:2]
    facets = []
    for ring_index in range(number - 1):
        low, high = ring_index * corners, (ring_index + 1) * corners
        for k in range(corners):
            after = (k + 1) % corners
            facets += [(low + k, low + after, high + after), (low + k, high + after, high + k)]
    last = (number - 1) * corners
    for k in range(1, corners - 1):
        facets += [(0, k + 1, k), (last, last + k, last + k + 1)]
    solid = Solid(outlines.reshape(-1, 3), np.array(facets))
    return solid if solid.volume_m3() > 0.0 else Solid(solid.vertices, solid.facets[:, ::-1])
