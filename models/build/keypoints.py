"""Keypoints of the shipped models, derived from their solids: corners of bodies, ends of panels, centres of dishes, tips.

All are on the surface. A body has the eight vertices that reach farthest towards the corners of its bounding box, named
by the signs of x, y and z (``bus_ppm``); the shell of a stage counts as one body. A solar wing has the corners of the
smallest rectangle about it, half way through its outermost edge: two at its root, nearer to the middle of the body, and two
at its tip. A dish has the point of its concave side on its axis. A boom has its farthest vertex.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping

import numpy as np

from rso_lidar.records import Keypoint, PartClass
from rso_lidar.shapes import Solid

_BODIES = ("bus", "tank", "cabin", "skin", "shard", "foil", "plate", "solar_substrate")  # the first that a craft has
_SHELLS = {"tank": ("tank", "skirt_aft", "skirt_forward", "instrument_section"), "cabin": ("cabin", "heat_shield")}
_PANELS = "solar_substrate"  # begins the names of the parts that carry cells
_DISHES = ("antenna_high_gain", "antenna_single_access", "antenna_space_ground", "antenna_ka_band", "antenna_radar")
_DIGITS = 5  # of a position in metres: 10 µm
_SIGNS = {1: "p", -1: "m"}


def find_keypoints(parts: Mapping[str, Solid], classes: Mapping[str, PartClass]) -> tuple[Keypoint, ...]:
    """Find the keypoints of a craft in the axes of its mesh."""
    body = next((name for name in _BODIES if name in parts), None)
    if body is None:
        return ()
    points: list[tuple[str, str, np.ndarray]] = []
    vertices = np.concatenate([parts[part].vertices for part in _SHELLS.get(body, (body,)) if part in parts])
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    middle = 0.5 * (low + high)
    for signs in itertools.product((1, -1), repeat=3):
        name = "".join(_SIGNS[sign] for sign in signs)
        points.append((f"{body}_{name}", body, _reach(vertices, (vertices - middle) / (high - low), signs)))
    for part, solid in parts.items():
        if part.startswith(_PANELS) and part != body:
            wing = part.replace(_PANELS, "solar_array")
            points += [(f"{wing}_{end}", part, corner) for end, corner in _find_ends(solid.vertices, middle).items()]
        elif part.startswith(_DISHES):
            points.append((f"{part}_centre", part, _find_centre(solid)))
        elif classes[part] == "boom" and part.startswith("boom"):
            far = np.round(np.linalg.norm(solid.vertices - middle, axis=1), _DIGITS)
            points.append((f"{part}_tip", part, solid.vertices[int(np.argmax(far))]))
    return tuple(
        Keypoint(name=name, part=part, position_m=tuple(round(float(x), _DIGITS) + 0.0 for x in position))
        for name, part, position in points
    )


def _reach(vertices: np.ndarray, scaled: np.ndarray, signs: tuple[int, ...]) -> np.ndarray:
    """Return the vertex (xyz) that reaches farthest in a direction; of equal ones the first in the file.

    Parameters
    ----------
    vertices : (vertex, xyz) [m]
    scaled : (vertex, axis), coordinates over the extents
    signs : of the direction along each axis
    """
    reach = np.round(scaled @ np.array(signs, dtype=float), 9)
    corner: np.ndarray = vertices[int(np.argmax(reach))]
    return corner


def _find_ends(vertices: np.ndarray, middle: np.ndarray) -> dict[str, np.ndarray]:
    """Return the corners (xyz) of a flat part, half way through it: those of the smallest rectangle about it in its plane.

    Parameters
    ----------
    middle : (xyz) of the body, which tells root from tip [m]
    """
    from scipy.spatial import ConvexHull

    center = 0.5 * (vertices.min(axis=0) + vertices.max(axis=0))
    _, _, axes = np.linalg.svd(vertices - center, full_matrices=False)
    flat = (vertices - center) @ axes[:2].T
    hull = flat[ConvexHull(flat).vertices]
    edges = np.roll(hull, -1, axis=0) - hull
    best: tuple[float, np.ndarray] | None = None
    for edge in edges / np.linalg.norm(edges, axis=1, keepdims=True):
        turn = np.array([edge, [-edge[1], edge[0]]])
        extent = np.ptp(hull @ turn.T, axis=0)
        if best is None or extent.prod() < best[0] * (1.0 - 1e-6):
            best = float(extent.prod()), turn
    assert best is not None
    plane = best[1] @ axes[:2]
    placed = (vertices - center) @ plane.T
    out = plane @ (center - middle)
    along = int(np.argmax(np.abs(out)))
    tip = 1 if out[along] >= 0.0 else -1
    scaled = (placed - 0.5 * (placed.max(axis=0) + placed.min(axis=0))) / np.ptp(placed, axis=0)
    corners: dict[str, np.ndarray] = {}
    for end, sign in (("root", -tip), ("tip", tip)):
        pair = [_find_edge(vertices, scaled[:, [along, 1 - along]] @ np.array([sign, side])) for side in (-1, 1)]
        pair.sort(key=_get_place)
        corners |= {f"{end}_{number}": corner for number, corner in enumerate(pair, 1)}
    return corners


def _get_place(corner: np.ndarray) -> list[float]:
    """Return a rounded position, to sort by: the sense of a singular vector is arbitrary."""
    rounded: list[float] = np.round(corner, _DIGITS).tolist()
    return rounded


def _find_edge(vertices: np.ndarray, reach: np.ndarray) -> np.ndarray:
    """Return the middle (xyz) of the vertices that reach farthest, which is half way through the corner of a plate.

    Parameters
    ----------
    vertices : (vertex, xyz) [m]
    reach : (vertex), how far each reaches
    """
    outer = vertices[reach > reach.max() - 1e-6]
    middle: np.ndarray = 0.5 * (outer.min(axis=0) + outer.max(axis=0))
    return middle


def _find_centre(solid: Solid) -> np.ndarray:
    """Return the point (xyz) of a dish on its axis, on the side to which it is concave.

    The axis is the direction of the least extent through the middle of the bounds.
    """
    corners = solid.vertices[solid.facets]
    _, _, axes = np.linalg.svd(solid.vertices - solid.vertices.mean(axis=0), full_matrices=False)
    placed = solid.vertices @ axes.T
    start = 0.5 * (placed.max(axis=0) + placed.min(axis=0))
    start[2] = 0.0
    heights = _cross_line(corners @ axes.T, start[:2])
    rim = 0.5 * (placed[:, 2].max() + placed[:, 2].min())
    start[2] = heights[int(np.argmin(np.abs(heights - rim)))] if len(heights) else rim
    center: np.ndarray = start @ axes
    return center


def _cross_line(corners: np.ndarray, at: np.ndarray) -> np.ndarray:
    """Return the heights at which facets (facet, corner, xyz) are crossed by a line along z through a point (xy)."""
    a, b, c = (corners[:, k, :2] - at for k in range(3))
    weights = np.stack([b[:, 0] * c[:, 1] - b[:, 1] * c[:, 0], c[:, 0] * a[:, 1] - c[:, 1] * a[:, 0]], axis=1)
    weights = np.column_stack([weights, a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]])
    inside = (weights >= 0.0).all(axis=1) | (weights <= 0.0).all(axis=1)
    inside &= np.abs(weights.sum(axis=1)) > 0.0
    share = weights[inside] / weights[inside].sum(axis=1, keepdims=True)
    heights: np.ndarray = np.sort((share * corners[inside, :, 2]).sum(axis=1))
    return heights
