"""Fragments of a break-up: torn plates, shards, pieces of panel and crumpled foil, each from a random seed."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Literal, NamedTuple, get_args

import numpy as np

from rso_lidar.errors import ScenarioError, did_you_mean
from rso_lidar.records import ShapeFamily, Taxonomy, classify_size
from rso_lidar.shapes.model import CraftModel, CraftPart
from rso_lidar.shapes.solids import Solid, join, pipe
from rso_lidar.shapes.torn_sheets import bend_solids, build_sheet, draw_outline

Kind = Literal["plate", "shard", "panel", "foil"]


class _Chunk(NamedTuple):
    """Part of a fragment before scaling, about 1 in radius."""

    solid: Solid
    material: str
    density_kg_m3: float


_SOURCE = (
    "A definition: no one fragment. Kinds after the shapes that break-up tests leave (Liou et al. 2013, DebriSat, 6th "
    "European Conference on Space Debris: flat and bent plates, needles, nuggets, flexible pieces)"
)
_ALUMINIUM_KG_M3 = 2700.0


def fragment(seed: int, longest_m: float, kind: Kind = "plate", name: str | None = None) -> CraftModel:
    """Build a fragment of a break-up; a seed always gives the same one.

    Every part is closed, and thickness scales with size.

    Parameters
    ----------
    seed : random seed, 0 or more
    longest_m : length of the longest side [m]
    kind : "plate" (torn and bent, with stiffeners), "shard" (a sliver), "panel" (honeycomb with its remaining solar
        cells) or "foil" (a crumpled sheet)
    name : of the model; by default ``fragment_<kind>_<seed>``

    Returns
    -------
    CraftModel
        With +x along the longest extent, +z along the thinnest, and the origin at the middle of the bounds.

        >>> float(fragment(7, 0.4, "shard").size_m.max().round(9))
        0.4

    Raises
    ------
    ScenarioError
        For an unknown kind, a length that is not positive, or a negative seed.
    """
    makers: dict[str, tuple[Callable[[np.random.Generator], dict[str, _Chunk]], ShapeFamily, float]] = {
        "plate": (_plate, "plate", 10.0),
        "shard": (_shard, "irregular", 30.0),
        "panel": (_panel, "plate", 10.0),
        "foil": (_foil, "irregular", 90.0),
    }
    if kind not in makers:
        known = ", ".join(get_args(Kind))
        raise ScenarioError(f"fragment: unknown kind '{kind}'{did_you_mean(kind, makers)} (known: {known})")
    if not (math.isfinite(longest_m) and longest_m > 0.0):
        raise ScenarioError(f"fragment: longest_m is {longest_m}; give a length above 0 m")
    if seed < 0:
        raise ScenarioError(f"fragment: seed is {seed}; give a whole number of 0 or more")
    make, family, fastest_deg_s = makers[kind]
    rng = np.random.Generator(np.random.Philox(np.random.SeedSequence(seed, spawn_key=(get_args(Kind).index(kind),))))
    pieces = _scaled(make(rng), longest_m)
    return CraftModel(
        name=name or f"fragment_{kind}_{seed}",
        what=f"Debris: {_WHAT[kind]}, {longest_m:g} m long (seed {seed})",
        source=_SOURCE,
        confidence="Made up, from a seed; materials and thicknesses are typical, masses follow from them",
        axes="+x along the longest extent, +z across the thinnest; origin at the middle of the bounds",
        pieces=pieces,
        taxonomy=Taxonomy(
            object_class="debris",
            subclass=f"fragment_{kind}",
            shape_family=family,
            size_class=classify_size(longest_m),
            stabilisation="tumbling",
            rate_deg_s=(0.5, fastest_deg_s),
        ),
    )


_WHAT: dict[str, str] = {
    "plate": "a torn and bent plate of aluminium",
    "shard": "a shard of aluminium",
    "panel": "a torn piece of a solar panel",
    "foil": "a crumpled sheet of insulation",
}


def _scaled(chunks: dict[str, _Chunk], longest_m: float) -> dict[str, CraftPart]:
    """Turn chunks to the principal axes of their vertices, centre them and scale them to a length."""
    points = np.concatenate([chunk.solid.vertices for chunk in chunks.values()])
    centered = points - points.mean(axis=0)
    _, axes = np.linalg.eigh(np.einsum("ij,ik->jk", centered, centered))
    order = np.argsort(-np.ptp(np.einsum("ij,jk->ik", points, axes), axis=0))
    x, z = axes[:, order[0]], axes[:, order[2]]
    x, z = (axis if axis[np.argmax(np.abs(axis))] > 0.0 else -axis for axis in (x, z))
    turn = np.column_stack([x, np.cross(z, x), z])
    bounds = np.einsum("ij,jk->ik", points, turn)
    low, high = bounds.min(axis=0), bounds.max(axis=0)
    scale, middle = longest_m / (high - low).max(), 0.5 * (low + high)
    parts = {}
    for name, (solid, material, density_kg_m3) in chunks.items():
        placed = Solid(scale * (np.einsum("ij,jk->ik", solid.vertices, turn) - middle), solid.facets)
        parts[name] = CraftPart(placed, material, density_kg_m3 * placed.volume_m3())
    return parts


def _plate(rng: np.random.Generator) -> dict[str, _Chunk]:
    """Return a plate with one cut edge, torn elsewhere, rolled and creased, with two stiffeners outside (-z)."""
    outline = draw_outline(rng, 6, 0.14, 0.70)
    outline[:, 1] = np.maximum(outline[:, 1], -0.40 + 0.004 * np.cos(9.0 * outline[:, 0]))
    skin, inside = build_sheet(outline, 0.010, 8), _polygon_test(outline)
    ribs = []
    for y in (-0.18, 0.20):
        ends = [next(x for x in np.arange(0.9, 0.0, -0.05) if inside(side * x, y)) for side in (-1, 1)]
        ribs.append(pipe([(x, y, -0.02) for x in np.linspace(-ends[0], ends[1], 25)], 0.035, 4))
    skin, rib = bend_solids(rng, [skin, join(*ribs)], 0.8 + 0.5 * rng.random(), 4, 0.35)
    return {
        "skin": _Chunk(skin, "aluminium", _ALUMINIUM_KG_M3),
        "stiffener": _Chunk(rib, "aluminium", _ALUMINIUM_KG_M3),
    }


def _refined(solid: Solid, longest: float = 0.10) -> Solid:
    """Halve the long edges of a solid until none is longer than `longest`."""
    vertices, facets = solid.vertices, solid.facets
    for _ in range(8):
        sides = np.sort(facets[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
        unique, where = np.unique(sides, axis=0, return_inverse=True)
        if np.linalg.norm(vertices[unique[:, 0]] - vertices[unique[:, 1]], axis=1).max() <= longest:
            break
        a, b, c = facets.T
        ab, bc, ca = (len(vertices) + where.reshape(-1, 3)).T
        vertices = np.concatenate([vertices, vertices[unique].mean(axis=1)])
        facets = np.concatenate([np.column_stack(t) for t in ((a, ab, ca), (b, bc, ab), (c, ca, bc), (ab, bc, ca))])
    return Solid(vertices, facets)


def _shard(rng: np.random.Generator) -> dict[str, _Chunk]:
    """Return a sliver: a faceted lump, long and thin, twisted, with a rough surface."""
    n, stations = 9, 22
    angle = np.arange(n) * (2.0 * math.pi / n)
    shape = 0.7 + 0.6 * rng.random(n)
    vertices = [np.array([[-1.0, 0.0, 0.0]])]
    twist, sway = 1.5 * (rng.random() - 0.5), 0.20 * (rng.random(2) - 0.5)
    for k in range(1, stations):
        s = 2.0 * k / stations - 1.0
        size = (0.05 + 0.24 * (1.0 - abs(s) ** 1.6)) * (0.85 + 0.30 * rng.random())
        radius = size * shape * (0.85 + 0.30 * rng.random(n))
        turned = angle + twist * s
        y = radius * np.cos(turned) + sway[0] * (1.0 - s * s) * 2.0
        z = 0.45 * radius * np.sin(turned) + sway[1] * (1.0 - s * s) * 2.0
        vertices.append(np.column_stack([np.full(n, s) + 0.03 * (rng.random(n) - 0.5), y, z]))
    vertices.append(np.array([[1.0, 0.0, 0.0]]))
    last = 1 + (stations - 1) * n
    facets = []
    for k in range(n):
        after = (k + 1) % n
        facets += [(0, 1 + after, 1 + k), (last, last - n + k, last - n + after)]
        for ring in range(stations - 2):
            a, b = 1 + ring * n, 1 + (ring + 1) * n
            facets += [(a + k, a + after, b + after), (a + k, b + after, b + k)]
    solid = Solid(np.concatenate(vertices), np.array(facets))
    return {"shard": _Chunk(solid, "aluminium", _ALUMINIUM_KG_M3)}


def _panel(rng: np.random.Generator) -> dict[str, _Chunk]:
    """Return a slab of honeycomb with one straight edge, torn elsewhere, and the remaining cells."""
    outline = draw_outline(rng, 5, 0.10, 0.75)
    outline[:, 1] = np.maximum(outline[:, 1], -0.50 + 0.004 * np.cos(7.0 * outline[:, 0]))  # the edge of the panel
    slab = build_sheet(outline, 0.030, 6)
    inside, cells = _polygon_test(outline), []
    width, height, gap = 0.150, 0.300, 0.012
    for i in range(-8, 9):
        for j in range(-4, 5):
            x, y = i * (width + gap), j * (height + gap) - 0.02
            corners = [(x + a * width, y + b * height) for a in (-0.5, 0.5) for b in (-0.5, 0.5)]
            lost = rng.random() < 0.22
            if lost or not all(inside(*corner) for corner in corners):
                continue
            quad = np.array([corners[0], corners[2], corners[3], corners[1]])
            cells.append(_refined(build_sheet(quad - quad.mean(axis=0), 0.005, 1)).move(x, y, 0.0165))
    bent = bend_solids(rng, [slab, *([join(*cells)] if cells else [])], 0.10 + 0.15 * rng.random(), 2, 0.12)
    kinds = {"solar_substrate": ("cfrp", 120.0), "solar_array": ("solar_cell", 2500.0)}
    return {name: _Chunk(solid, *kinds[name]) for name, solid in zip(kinds, bent, strict=False)}


def _polygon_test(outline: np.ndarray) -> Callable[[float, float], bool]:
    """Return a function that tests whether a point lies inside an outline that is star-shaped about the origin."""
    angle = np.arctan2(outline[:, 1], outline[:, 0])
    radius = np.hypot(outline[:, 0], outline[:, 1])
    order = np.argsort(angle)

    def inside(x: float, y: float) -> bool:
        limit = np.interp(math.atan2(y, x), angle[order], radius[order], period=2.0 * math.pi)
        return bool(math.hypot(x, y) < 0.96 * limit)

    return inside


def _foil(rng: np.random.Generator) -> dict[str, _Chunk]:
    """Return a sheet of insulation with a torn edge, crumpled in many creases and rolled."""
    outline = draw_outline(rng, 7, 0.08, 0.70)
    sheet = build_sheet(outline, 0.004, 18)
    x, y, z = sheet.vertices.T
    height = z.copy()
    for length in (1.1, 0.8, 0.6, 0.45, 0.35, 0.28):
        turn, phase = 2.0 * math.pi * rng.random(), rng.random()
        steps = (math.cos(turn) * x + math.sin(turn) * y) / length + phase
        height += (0.15 + 0.20 * rng.random()) * length * np.abs(steps - np.round(steps))  # a zigzag
    crumpled = Solid(np.column_stack([x, y, height]), sheet.facets)
    (bent,) = bend_solids(rng, [crumpled], 0.7 + 0.4 * rng.random(), 4, 0.3)
    return {"foil": _Chunk(bent, "mli_gold", 400.0)}
