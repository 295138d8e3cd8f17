"""Fragments of a break-up in the shape categories of DebriSat, each a closed body of one part made from a random seed.

Sources, and what is assumed:

- Categories: DebriSat's, which are straight and bent needles, rods and cylinders; flat plates; bent plates; nuggets,
  parallelepipeds and spheroids; flexible pieces (Liou et al. 2013, 6th European Conference on Space Debris).
- Size: the characteristic length, the mean of three orthogonal extents (Johnson et al. 2001, Adv. Space Res. 28(9), 1377).
- Proportions: fragments of test satellites form two groups, needles with a large x/y and plates with a small one; the
  needles are mostly of carbon fibre (Hanada and Liou 2009, 5th European Conference on Space Debris). Nuggets are about
  2 : sqrt(2) : 1 (Michikami et al. 2016, Icarus 264, 316: of basalt). The limits in this module about these are assumed.
- Area over mass: the NASA Standard Breakup Model, 1998 revision (Johnson et al. 2001). It has no flexible pieces; theirs is
  assumed. Its powers and logarithms are computed in decimal arithmetic, which has the same digits on every processor.
- Tears, creases, curls and the choice of materials are assumed.
"""

from __future__ import annotations

import decimal
import hashlib
import math
from collections.abc import Callable
from functools import lru_cache
from typing import NamedTuple, get_args

import numpy as np

from rso_lidar.errors import ScenarioError, did_you_mean
from rso_lidar.kernels import packed
from rso_lidar.philox import fill_row
from rso_lidar.pose import dot, length
from rso_lidar.records import FRAGMENT_LENGTHS_M, FragmentKind, ShapeFamily, Taxonomy, classify_size
from rso_lidar.shapes.model import CraftModel, CraftPart
from rso_lidar.shapes.solids import Solid
from rso_lidar.shapes.torn_sheets import UniformNumbers, bend_solids, build_sheet, draw_outline, sine_cosine

_KINDS: tuple[FragmentKind, ...] = get_args(FragmentKind)
_DENSITY_KG_M3 = {"aluminium": 2700.0, "cfrp": 1600.0, "mli_gold": 1420.0, "mli_silver": 1420.0}  # MLI: of Kapton
_SHAPE, _MASS = 0, 1  # random streams, so that the shape does not depend on the number of draws for the mass
_STEP_M = 1e-9  # vertices are rounded to it
_THINNEST = 5e-4  # thickness over characteristic length; thinner sheets are beyond what float32 rays resolve
_THICKEST = 0.1
_DIGITS = decimal.Context(prec=20)
_SMALL_M, _LARGE_M = 0.08, 0.11  # between these lengths the two distributions are bridged (Johnson et al., eq. 6 and 7)
_UNIFORMS = 12  # whose sum less 6 is a normal number to within its 4-sigma tails


class _Numbers:
    """Random numbers of one fragment; each has an address: seed, kind, stream, call and place."""

    def __init__(self, seed: int, kind: FragmentKind, stream: int) -> None:
        """Begin a stream of numbers."""
        self._key = packed(np.random.SeedSequence(seed).generate_state(2, np.uint32))
        self._kind, self._stream, self._call = _KINDS.index(kind), stream, 0

    def random(self, size: int | None = None) -> np.ndarray | float:
        """Draw numbers from 0 to below 1."""
        words = np.empty(4 * -(-(size or 1) // 4), np.uint32)
        fill_row(self._key, self._call, self._kind, self._stream, words)
        self._call += 1
        return words[:size] / 2.0**32 if size is not None else float(words[0]) / 2.0**32

    def between(self, low: float, high: float) -> float:
        """Draw a number, uniform from low to high."""
        return low + (high - low) * float(self.random())


class _Category(NamedTuple):
    """How fragments of a kind are made; `materials` are equally likely."""

    make: Callable[[_Numbers, float], Solid]
    materials: tuple[str, ...]
    family: ShapeFamily
    what: str
    is_sheet: bool


def breakup_fragment(kind: FragmentKind, seed: int, characteristic_length_m: float) -> CraftModel:
    """Build a fragment of a break-up. Equal arguments give equal bytes on every processor.

    Parameters
    ----------
    kind : category of its shape
    seed : random seed, 0 or more
    characteristic_length_m : mean of its three orthogonal extents [m]: the longest, the longest across it, and the extent
        across both

    Returns
    -------
    CraftModel
        One closed part `fragment`, with x, y and z along the three extents and the origin at the centre of mass. Its mass
        follows from its area over mass, but is at most that of the solid material.

        >>> breakup_fragment("bent_plate", 7, 0.3).size_m.mean().round(6)
        np.float64(0.3)

    Raises
    ------
    ScenarioError
        For an unknown kind, a negative seed, or a length outside 1 mm to 10 m.
    """
    if kind not in _KINDS:
        known = ", ".join(_KINDS)
        raise ScenarioError(f"fragment: unknown kind '{kind}'{did_you_mean(kind, _KINDS)} (known: {known})")
    least_m, most_m = FRAGMENT_LENGTHS_M
    if not least_m <= characteristic_length_m <= most_m:
        raise ScenarioError(
            f"fragment: characteristic_length_m is {characteristic_length_m}; give {least_m:g} to {most_m:g} m"
        )
    if seed < 0:
        raise ScenarioError(f"fragment: seed is {seed}; give a whole number of 0 or more")
    category, numbers = _CATEGORIES[kind], _Numbers(seed, kind, _MASS)
    material = category.materials[int(numbers.between(0, len(category.materials)))]
    if kind == "flexible":
        ratio = _power_of_ten(numbers.between(0.0, 1.0))  # foils and blankets of 0.05 to 0.5 kg/m2; assumed
    else:
        ratio = draw_area_to_mass(characteristic_length_m, numbers)
    density = _DENSITY_KG_M3[material]
    # A sheet of thickness t and area F on each side has the mean cross-section F / 2 (Cauchy) and the mass density t F.
    thickness = 0.5 / (density * ratio) / characteristic_length_m
    thickness = min(_THICKEST, max(_THINNEST, thickness)) if category.is_sheet else 0.0
    if category.is_sheet:  # in the unit in which the sheet is made
        thickness *= _measure(category.make(_Numbers(seed, kind, _SHAPE), thickness).vertices)[1]
    solid = _fit(category.make(_Numbers(seed, kind, _SHAPE), thickness), characteristic_length_m)
    volume_m3, surface_m2 = solid.volume_m3(), _find_surface(solid)
    return CraftModel(
        name=f"fragment_{kind}_{seed}",
        what=f"Debris: {category.what}, of characteristic length {characteristic_length_m:g} m (seed {seed})",
        source="A definition: no one fragment. Shapes, sizes and areas over mass after break-up tests; see the module",
        confidence="Made up, from a seed; limits of the proportions, tears, bends and materials are assumed",
        axes="+x along the longest extent, +y along the longest across it; origin at the centre of mass",
        pieces={"fragment": CraftPart(solid, material, min(0.25 * surface_m2 / ratio, density * volume_m3))},
        taxonomy=Taxonomy(
            object_class="debris",
            subclass=f"fragment_{kind}",
            shape_family=category.family,
            size_class=classify_size(float(np.ptp(solid.vertices[:, 0]))),
            stabilisation="tumbling",
            rate_deg_s=(0.5, 30.0),
        ),
    )


def hash_solid(solid: Solid) -> str:
    """Return the SHA-256 of a solid: of its vertices as little-endian f8, and of its facets as i4.

    Parameters
    ----------
    solid : vertices (n, 3) [m] and facets (k, 3)
    """
    digest = hashlib.sha256(solid.vertices.astype("<f8").tobytes())
    digest.update(solid.facets.astype("<i4").tobytes())
    return digest.hexdigest()


def _make_flat_plate(numbers: _Numbers, thickness: float) -> Solid:
    """Make a torn plate that is nearly flat, with one cut edge in half of the cases."""
    outline = draw_outline(numbers, 4, numbers.between(0.04, 0.14), numbers.between(0.4, 0.95))
    if numbers.random() < 0.5:
        outline[:, 1] = np.maximum(outline[:, 1], -0.45)
    sheet = build_sheet(outline, thickness, 4)
    return bend_solids(numbers, [sheet], numbers.between(0.02, 0.10), 1, 0.03)[0]


def _make_bent_plate(numbers: _Numbers, thickness: float) -> Solid:
    """Make a torn plate that is creased and rolled by some 60 to 170 degrees."""
    outline = draw_outline(numbers, 4, numbers.between(0.06, 0.16), numbers.between(0.4, 0.95))
    sheet = build_sheet(outline, thickness, 7)
    return bend_solids(numbers, [sheet], numbers.between(0.5, 1.5), 3, 0.5)[0]


def _make_flexible(numbers: _Numbers, thickness: float) -> Solid:
    """Make a piece of foil or blanket that is crumpled in zigzag folds of several lengths, and rolled."""
    outline = draw_outline(numbers, 4, 0.08, numbers.between(0.4, 0.95))
    sheet = build_sheet(outline, thickness, 12)
    x, y, z = sheet.vertices.T
    height = z.copy()
    for period in (1.1, 0.8, 0.6, 0.45, 0.35):
        sine, cosine = sine_cosine(2.0 * math.pi * numbers.random())
        steps = (cosine * x + sine * y) / period + numbers.random()
        height = height + numbers.between(0.15, 0.40) * period * np.abs(steps - np.round(steps))
    crumpled = Solid(np.column_stack([x, y, height]), sheet.facets)
    return bend_solids(numbers, [crumpled], numbers.between(0.5, 1.2), 3, 0.3)[0]


def _make_straight_rod(numbers: _Numbers, _thickness: float) -> Solid:
    """Make a splinter, rod or piece of tube: some 4 to 15 times as long as wide, with torn ends."""
    return _make_rod(numbers, numbers.between(5.0, 15.0))


def _make_bent_rod(numbers: _Numbers, _thickness: float) -> Solid:
    """Make a rod that is kinked, and rolled by some 35 to 140 degrees."""
    rod = _make_rod(numbers, numbers.between(6.0, 16.0))
    return bend_solids(numbers, [rod], numbers.between(0.3, 1.2), 2, 0.5, along_x=True)[0]


def _make_rod(numbers: _Numbers, aspect: float) -> Solid:
    """Make a rod along x, from -1 to 1, with an oval section."""
    sides, stations = 12, 28
    sine, cosine = sine_cosine(np.arange(sides) * (2.0 * math.pi / sides))
    rough = 0.9 + 0.2 * np.asarray(numbers.random(sides))
    oval, taper = numbers.between(0.5, 1.0), numbers.between(0.0, 0.5)
    at = np.linspace(-1.0, 1.0, stations)
    width = (1.0 - taper * 0.5 * (at + 1.0)) * (0.94 + 0.12 * np.asarray(numbers.random(stations)))
    radius = width[:, None] * rough / aspect
    x = np.repeat(at[:, None], sides, axis=1)
    for end in (0, -1):  # torn: every corner ends somewhere else
        x[end] *= 1.0 - 1.5 / aspect * np.asarray(numbers.random(sides))
        x[1 if end == 0 else -2] = 0.5 * (x[end] + x[2 if end == 0 else -3])
    rings = np.stack([x, radius * cosine, oval * radius * sine], axis=-1).reshape(-1, 3)
    ends = np.array([[x[0].max() + 0.2 / aspect, 0.0, 0.0], [x[-1].min() - 0.2 / aspect, 0.0, 0.0]])
    low = sides * np.arange(stations - 1)[:, None]
    here, after = np.arange(sides), (np.arange(sides) + 1) % sides
    a, b, c, d = ((low + k).ravel() for k in (here, after, sides + here, sides + after))
    first, last = np.full(sides, len(rings)), np.full(sides, len(rings) + 1)
    edge = sides * (stations - 1)
    facets = [(a, b, d), (a, d, c), (first, after, here), (last, edge + here, edge + after)]
    return Solid(np.concatenate([rings, ends]), np.concatenate([np.column_stack(corners) for corners in facets]))


def _make_nugget(numbers: _Numbers, _thickness: float) -> Solid:
    """Make a lump, about 2 : sqrt(2) : 1: a box or spheroid whose corners are broken off along flat faces."""
    cube, facets = _build_cube(12)
    direction = cube / length(cube)[:, None]
    is_round = numbers.random() < 0.3
    radius = np.ones(len(cube)) if is_round else 1.0 / np.abs(direction).max(axis=1)
    for _ in range(14):
        z, around = numbers.between(-1.0, 1.0), 2.0 * math.pi * numbers.between(0.0, 1.0)
        (sine, cosine), level = sine_cosine(around), math.sqrt(1.0 - z * z)
        toward = dot(direction, np.array([level * cosine, level * sine, z]))
        radius = np.minimum(radius, numbers.between(0.75, 1.15) / np.maximum(toward, 1e-3))
    radius = radius * (1.0 + 0.02 * (np.asarray(numbers.random(len(cube))) - 0.5))
    shape = np.array([1.0, numbers.between(0.55, 0.85), numbers.between(0.35, 0.65)])
    return Solid(radius[:, None] * direction * shape, facets)


@lru_cache(maxsize=1)
def _build_cube(cells: int) -> Solid:
    """Build the surface of a cube from -1 to 1, with some cells along each edge."""
    steps = np.arange(cells + 1)
    u, v = (grid.ravel() for grid in np.meshgrid(steps, steps, indexing="ij"))
    first = ((cells + 1) * steps[:-1, None] + steps[:-1]).ravel()
    quads = np.column_stack([first, first + cells + 1, first + cells + 2, first + 1])
    points: list[np.ndarray] = []
    facets: list[np.ndarray] = []
    for axis in range(3):
        for side in (0, cells):
            point = np.empty((len(u), 3), np.int64)
            point[:, axis], point[:, (axis + 1) % 3], point[:, (axis + 2) % 3] = side, u, v
            turned = len(points) * len(u) + (quads if side else quads[:, ::-1])
            points.append(point)
            facets += [turned[:, [0, 1, 2]], turned[:, [0, 2, 3]]]
    unique, index = np.unique(np.concatenate(points), axis=0, return_inverse=True)
    return Solid(2.0 * unique / cells - 1.0, index.ravel()[np.concatenate(facets)])


_CATEGORIES: dict[FragmentKind, _Category] = {
    "flat_plate": _Category(_make_flat_plate, ("aluminium", "cfrp"), "plate", "a torn flat plate", is_sheet=True),
    "bent_plate": _Category(
        _make_bent_plate, ("aluminium",), "irregular", "a torn plate, bent and creased", is_sheet=True
    ),
    "straight_rod": _Category(_make_straight_rod, ("cfrp",), "cylinder", "a splinter or rod", is_sheet=False),
    "bent_rod": _Category(_make_bent_rod, ("aluminium",), "irregular", "a bent rod", is_sheet=False),
    "nugget": _Category(_make_nugget, ("aluminium",), "irregular", "a lump with broken faces", is_sheet=False),
    "flexible": _Category(
        _make_flexible, ("mli_gold", "mli_silver"), "irregular", "a crumpled piece of insulation", is_sheet=True
    ),
}


def _find_longest(points: np.ndarray) -> np.ndarray:
    """Return the vector between the two points that are farthest apart."""
    away = points - 0.5 * (points.min(axis=0) + points.max(axis=0))
    radius = length(away)
    from_one = points - points[int(np.argmax(radius))]
    reach = math.sqrt(float(dot(from_one, from_one).max()))
    outer = points[radius >= reach * (1.0 - 1e-9) - radius.max()]  # no other point can be an end
    apart = outer[:, None] - outer
    squared = dot(apart, apart)
    first, second = np.unravel_index(int(np.argmax(squared)), squared.shape)
    longest: np.ndarray = outer[first] - outer[second]
    return longest


def _measure(points: np.ndarray) -> tuple[np.ndarray, float]:
    """Return the axes (3, xyz) of the three orthogonal extents of points, right-handed, and the mean extent."""
    longest = _find_longest(points)
    x = longest / math.sqrt(float((longest * longest).sum()))
    flat = points - dot(points, x)[:, None] * x
    across = _find_longest(flat)
    y = across - float((across * x).sum()) * x
    y = y / math.sqrt(float((y * y).sum()))
    axes = np.stack([x, y, np.cross(x, y)])
    sides = [float(np.ptp(dot(points, axis))) for axis in axes]
    return axes, math.fsum(sides) / len(sides)


def _fit(solid: Solid, length_m: float) -> Solid:
    """Turn a solid to its extents, scale it to a characteristic length, and move its centre of mass to the origin.

    Parameters
    ----------
    length_m : characteristic length [m]
    """
    axes, measured_m = _measure(solid.vertices)
    vertices = np.column_stack([dot(solid.vertices, axis) for axis in axes]) * (length_m / measured_m)
    vertices = vertices - 0.5 * (vertices.min(axis=0) + vertices.max(axis=0))
    center = _find_centroid(Solid(vertices, solid.facets))
    return Solid(np.round((vertices - center) / _STEP_M) * _STEP_M + 0.0, solid.facets)


def _find_centroid(solid: Solid) -> np.ndarray:
    """Return the centroid (xyz) of the enclosed volume, from exactly rounded sums over tetrahedra."""
    volumes = solid.tetrahedra_m3()
    moments = volumes[:, None] * solid.vertices[solid.facets].sum(axis=1) / 4.0
    return np.array([math.fsum(along.tolist()) for along in moments.T]) / solid.volume_m3()


def _find_surface(solid: Solid) -> float:
    """Return the area of all facets."""
    a, b, c = (solid.vertices[solid.facets[:, k]] for k in range(3))
    return 0.5 * math.fsum(length(np.cross(b - a, c - a)).tolist())


def _power_of_ten(exponent: float) -> float:
    """Return ten to a power."""
    return float(_DIGITS.power(decimal.Decimal(10), _DIGITS.create_decimal(exponent)))


def draw_area_to_mass(length_m: float, numbers: UniformNumbers) -> float:
    """Draw the area-to-mass ratio [m2/kg] of a fragment of a spacecraft.

    Its logarithm is normal below 8 cm and a mixture of two normal distributions above 11 cm. Between the two lengths one of
    both is chosen, with a probability that is linear in length.

    Parameters
    ----------
    length_m : characteristic length of the fragment [m]
    numbers : random numbers of the fragment
    """
    x = float(_DIGITS.log10(_DIGITS.create_decimal(length_m)))
    is_large = numbers.random() < (length_m - _SMALL_M) / (_LARGE_M - _SMALL_M)
    first, normal = numbers.random(), float(sum(numbers.random(_UNIFORMS).tolist())) - 0.5 * _UNIFORMS
    if not is_large:
        mean = _ramp(x, -1.75, -1.25, -0.3, -1.0)
        sigma = 0.2 + 0.1333 * max(0.0, x + 3.5)
    elif first < _ramp(x, -1.95, 0.55, 0.0, 1.0):
        mean, sigma = _ramp(x, -1.1, 0.0, -0.6, -0.95), _ramp(x, -1.3, -0.3, 0.1, 0.3)
    else:
        mean, sigma = _ramp(x, -0.7, -0.1, -1.2, -2.0), _ramp(x, -0.5, -0.3, 0.5, 0.3)
    return _power_of_ten(mean + sigma * normal)


def _ramp(x: float, start: float, end: float, before: float, after: float) -> float:
    """Return a value that is constant before and after a linear part.

    Parameters
    ----------
    x : logarithm of the characteristic length in metres
    """
    return before + (after - before) * min(1.0, max(0.0, (x - start) / (end - start)))
