"""Primitives from which the builders assemble a craft: closed solids with outward facets. Metres, NumPy only."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

import numpy as np

from rso_lidar.shapes import Point, Solid, join, pipe

_AXIS_M = 1e-9  # points of a profile closer to the axis count as on it; rounding errors are below 1e-13 m


def box(size_m: Point, center_m: Point = (0.0, 0.0, 0.0)) -> Solid:
    """Return a box of size (x, y, z) [m] about a centre [m].

    >>> box((1, 2, 3)).volume_m3()
    6.0
    """
    half_x, half_y, half_z = (0.5 * side for side in size_m)
    outline = [(-half_x, -half_y), (half_x, -half_y), (half_x, half_y), (-half_x, half_y)]
    return prism(outline, -half_z, half_z).move(*center_m)


def box_between(low: Point, high: Point) -> Solid:
    """Return the box between two opposite corners [m]."""
    return box([b - a for a, b in zip(low, high, strict=True)], [0.5 * (a + b) for a, b in zip(low, high, strict=True)])


def prism(outline_m: Iterable[Point], bottom_m: float, top_m: float) -> Solid:
    """Extrude a convex outline.

    Parameters
    ----------
    outline_m : points (x, y), counter-clockwise seen from +z
    bottom_m, top_m : z of the ends
    """
    outline = np.asarray(list(outline_m), dtype=float)
    n = len(outline)
    low, high = (np.column_stack([outline, np.full(n, z)]) for z in (bottom_m, top_m))
    facets = []
    for k in range(n):
        after = (k + 1) % n
        facets += [(k, after, n + after), (k, n + after, n + k)]
    for k in range(1, n - 1):
        facets += [(0, k + 1, k), (n, n + k, n + k + 1)]
    return Solid(np.concatenate([low, high]), np.array(facets))


def revolve(profile_m: Iterable[Point], sides: int = 32) -> Solid:
    """Revolve a profile of (radius, z) about +z.

    A profile that begins and ends on the axis encloses a body. Any other profile is closed by its last and first
    points and makes a ring. Either sense of the profile is allowed.
    """
    profile = [(float(radius) if abs(radius) > _AXIS_M else 0.0, float(z)) for radius, z in profile_m]
    solid_body = profile[0][0] == 0.0 and profile[-1][0] == 0.0
    angle = np.arange(sides) * (2.0 * math.pi / sides)
    rings: list[np.ndarray] = []
    vertices: list[tuple[float, float, float]] = []
    for radius, z in profile:
        first = len(vertices)
        if radius == 0.0:
            vertices.append((0.0, 0.0, z))
            rings.append(np.full(sides, first))
        else:
            vertices += [(radius * math.cos(a), radius * math.sin(a), z) for a in angle]
            rings.append(first + np.arange(sides))
    facets: list[tuple[int, int, int]] = []
    for below, above in zip(rings, rings[1:] if solid_body else rings[1:] + rings[:1], strict=False):
        for k in range(sides):
            after = (k + 1) % sides
            if below[k] != below[after]:
                facets.append((below[k], below[after], above[after]))
            if above[k] != above[after]:
                facets.append((below[k], above[after], above[k]))
    solid = Solid(np.array(vertices), np.array(facets, dtype=int))
    return solid if solid.volume_m3() > 0.0 else Solid(solid.vertices, solid.facets[:, ::-1])


def cylinder(radius_m: float, bottom_m: float, top_m: float, sides: int = 32) -> Solid:
    """Return a cylinder about +z.

    Parameters
    ----------
    radius_m : of the cylinder
    bottom_m, top_m : z of the ends
    sides : facets around
    """
    return frustum(radius_m, radius_m, bottom_m, top_m, sides)


def frustum(bottom_radius_m: float, top_radius_m: float, bottom_m: float, top_m: float, sides: int = 32) -> Solid:
    """Return a truncated cone about +z; a radius of 0 makes a tip.

    Parameters
    ----------
    bottom_radius_m, top_radius_m : radii of the ends
    bottom_m, top_m : z of the ends
    sides : facets around
    """
    profile = [(0.0, bottom_m), (bottom_radius_m, bottom_m), (top_radius_m, top_m), (0.0, top_m)]
    return revolve([point for k, point in enumerate(profile) if k in (0, 3) or point[0] > _AXIS_M], sides)


def ring(inner_m: float, outer_m: float, bottom_m: float, top_m: float, sides: int = 48) -> Solid:
    """Return a flat ring about +z of rectangular section.

    Parameters
    ----------
    inner_m, outer_m : radii
    bottom_m, top_m : z of the ends
    sides : facets around
    """
    return revolve([(inner_m, bottom_m), (outer_m, bottom_m), (outer_m, top_m), (inner_m, top_m)], sides)


def torus(radius_m: float, wire_radius_m: float, sides: int = 48, around: int = 8) -> Solid:
    """Return a ring about +z of round section.

    Parameters
    ----------
    radius_m : of the ring
    wire_radius_m : of its section
    sides, around : facets along the ring and around its section
    """
    turn = [2.0 * math.pi * k / around for k in range(around)]
    return revolve([(radius_m + wire_radius_m * math.cos(a), wire_radius_m * math.sin(a)) for a in turn], sides)


def wall(inner_profile_m: Sequence[Point], thickness_m: float, sides: int = 48) -> Solid:
    """Return a thin wall of revolution, open at both ends.

    Parameters
    ----------
    inner_profile_m : points (radius, z) of the inner side
    thickness_m : added away from the axis
    sides : facets around
    """
    outer = [(radius + thickness_m, z) for radius, z in reversed(inner_profile_m)]
    return revolve([*inner_profile_m, *outer], sides)


def dish(diameter_m: float, focal_length_m: float, thickness_m: float, rings: int = 14, sides: int = 64) -> Solid:
    """Return a paraboloid reflector, vertex at the origin, opening to +z: front surface z = r^2 / (4 f).

    Parameters
    ----------
    diameter_m, focal_length_m, thickness_m : of the reflector
    rings, sides : facets along the radius and around
    """
    radii = [0.5 * diameter_m * k / rings for k in range(rings + 1)]
    front = [(radius, radius**2 / (4.0 * focal_length_m)) for radius in radii]
    return revolve([*front, *((radius, z - thickness_m) for radius, z in reversed(front))], sides)


def dome(radius_m: float, height_m: float, rings: int = 10, sides: int = 48) -> Solid:
    """Return half an ellipsoid with its flat side at z = 0.

    Parameters
    ----------
    radius_m : at z = 0
    height_m : of the top
    rings, sides : facets along the height and around
    """
    turn = [0.5 * math.pi * k / rings for k in range(rings)]
    curve = [(radius_m * math.cos(a), height_m * math.sin(a)) for a in turn]
    return revolve([(0.0, 0.0), *curve, (0.0, height_m)], sides)


def ball(radius_m: float, center_m: Point = (0.0, 0.0, 0.0), splits: int = 2) -> Solid:
    """Return an icosphere: an icosahedron whose facets are divided in four repeatedly, with all vertices on the sphere.

    Parameters
    ----------
    radius_m, center_m : of the sphere [m]
    splits : number of divisions
    """
    golden = 0.5 * (1.0 + math.sqrt(5.0))
    corners = [(a, b * golden, 0.0) for a in (-1.0, 1.0) for b in (-1.0, 1.0)]
    points = np.array([np.roll(corner, shift) for shift in range(3) for corner in corners])
    edge = {(i, j) for i in range(12) for j in range(12) if i != j and np.linalg.norm(points[i] - points[j]) < 2.1}
    facets = np.array(
        [(i, j, k) for i, j in sorted(edge) for k in range(j + 1, 12) if i < j and {(i, k), (j, k)} <= edge]
    )
    normal = np.cross(points[facets[:, 1]] - points[facets[:, 0]], points[facets[:, 2]] - points[facets[:, 0]])
    inward = np.einsum("ij,ij->i", normal, points[facets[:, 0]]) < 0.0
    facets[inward] = facets[inward][:, ::-1]
    for _ in range(splits):
        sides = np.sort(facets[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
        unique, where = np.unique(sides, axis=0, return_inverse=True)
        middle = len(points) + where.reshape(-1, 3)
        points = np.concatenate([points, points[unique].mean(axis=1)])
        a, b, c = facets.T
        ab, bc, ca = middle.T
        corner_triples = [(a, ab, ca), (b, bc, ab), (c, ca, bc), (ab, bc, ca)]
        facets = np.concatenate([np.column_stack(triple) for triple in corner_triples])
    points = radius_m * points / np.linalg.norm(points, axis=1, keepdims=True)
    return Solid(points + np.asarray(center_m, dtype=float), facets)


def tube(start_m: Point, end_m: Point, radius_m: float, sides: int = 8) -> Solid:
    """Return a round bar between two points.

    Parameters
    ----------
    start_m, end_m : ends of its axis
    radius_m : of the bar
    sides : facets around
    """
    return pipe([start_m, end_m], radius_m, sides)


def lattice(x_m: Sequence[float], y_m: Sequence[float], opened: Iterable[tuple[int, int]], thickness_m: float) -> Solid:
    """Return a flat plate with rectangular windows, centred on z = 0.

    Parameters
    ----------
    x_m, y_m : ascending lines that divide the plate into cells [m]
    opened : cells (column, row) that are windows; solid cells must not meet at a corner only
    thickness_m : of the plate [m]
    """
    columns, rows = len(x_m) - 1, len(y_m) - 1
    windows = set(opened)
    filled = {(i, j) for i in range(columns) for j in range(rows)} - windows
    stride = rows + 1
    layer = (columns + 1) * stride
    xy = np.array([(x, y) for x in x_m for y in y_m], dtype=float)
    half = 0.5 * thickness_m
    vertices = np.concatenate([np.column_stack([xy, np.full(layer, z)]) for z in (-half, half)])
    facets = []
    for i, j in sorted(filled):
        corners = [i * stride + j, (i + 1) * stride + j, (i + 1) * stride + j + 1, i * stride + j + 1]
        a, b, c, d = corners
        facets += [(layer + a, layer + b, layer + c), (layer + a, layer + c, layer + d), (a, c, b), (a, d, c)]
        for k, beside in enumerate([(i, j - 1), (i + 1, j), (i, j + 1), (i - 1, j)]):
            if beside not in filled:
                e, f = corners[k], corners[(k + 1) % 4]
                facets += [(e, f, layer + f), (e, layer + f, layer + e)]
    used, renumbered = np.unique(np.array(facets), return_inverse=True)
    return Solid(vertices[used], renumbered.reshape(-1, 3))


def tiles(size_m: Point, count: tuple[int, int], gap_m: float, center_m: Point = (0.0, 0.0, 0.0)) -> Solid:
    """Return a field of equal boxes separated by gaps.

    Parameters
    ----------
    size_m : of the whole field
    count : boxes along x and along y
    gap_m : between boxes
    center_m : of the field
    """
    nx, ny = count
    step_x, step_y = (size_m[0] + gap_m) / nx, (size_m[1] + gap_m) / ny
    tile = (step_x - gap_m, step_y - gap_m, size_m[2])
    places = [((i - 0.5 * (nx - 1)) * step_x, (j - 0.5 * (ny - 1)) * step_y) for i in range(nx) for j in range(ny)]
    return join(*(box(tile, (x, y, 0.0)) for x, y in places)).move(*center_m)
