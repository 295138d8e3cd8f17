"""The light of pixels without rays: facets are clipped in the image as polygons, and their light is integrated over area.

Beside it stands a dense lattice of rays, for scenes with lenses, lasers and materials that polygons do not cover.

Facets are projected into the tangent plane z = 1 of the lidar axes, where a pinhole lens images straight edges as straight
lines. The inverse of a facet's depth is linear there: n·(x, y, 1) / d for the plane n·p = d. So facet j hides facet i in a
convex region, which is bounded by three edges of j and by the line where both are equally deep.
"""

import math
from itertools import pairwise

import numpy as np

from rso_lidar import optics, scene
from rso_lidar.records import Rays

_TIE = 1e-10  # relative difference of depths below which facets coincide, 0.1 um at 1 km; then the first one is seen
_SLIVER = 1e-15  # share of a pixel's area below which a polygon is rounding
_SIDES = 4096  # of the polygon that stands for a circular beam: as large, and round to 3e-7 of its radius
_FEW_FACETS = 500  # fewer are split where their bounds are taken
_GOLDEN = 0.5 * (math.sqrt(5.0) - 1.0)


def facets_in_lidar_axes(surfaces, truth):
    """Return the corners (facet, corner, xyz) [m] of all surfaces in lidar axes, and their Lambertian reflectances."""
    corners, reflectance = [], []
    for surface in surfaces:
        translation, matrix = truth.poses.place("lidar", surface.name)
        corners.append(surface.corners @ matrix.T + translation)
        reflectance.append(np.array([material.reflectance for material in surface.materials])[surface.finish])
    return np.concatenate(corners), np.concatenate(reflectance)


def exact_photons(triangles, brdf, receiver, laser, pixels=None, tolerance=1e-7):
    """Return the photons (pixel) that each pixel receives, for a pinhole lens with the laser in it.

    Parameters
    ----------
    triangles : (facet, corner, xyz) in lidar axes [m], in front of the lens and seen from both sides
    brdf : a Lambertian reflectance for all facets or for each (facet), or a function that returns the BRDF [1/sr] of
        facet numbers and cosines of incidence
    pixels : numbers of the pixels to find the light of (None: of all; the others are NaN)
    tolerance : share of a pixel's light by which the integral over a triangle may still change when it is split
    """
    if receiver.distortion is not None or laser.offset is not None or laser.footprint == "pattern":
        raise ValueError("polygons need a pinhole lens, a laser in the lens and a beam with a formula")
    image = _Image(np.asarray(triangles, dtype=float))
    beam = _beam_edges(laser)
    numbers = range(receiver.n_rows * receiver.n_cols) if pixels is None else pixels
    seen, facet, pixel = [], [], []
    for number in numbers:
        square = _clip_to_beam(_pixel_square(receiver, number), beam)
        for i, polygons in image.find_visible(square, _SLIVER * receiver.pixel_tangent**2):
            for polygon in polygons:
                fan = [(polygon[0], b, c) for b, c in pairwise(polygon[1:])]
                seen += fan
                facet += [i] * len(fan)
                pixel += [number] * len(fan)
    photons = np.full(receiver.n_rows * receiver.n_cols, np.nan)
    photons[list(numbers)] = 0.0
    if seen:
        light, facet, triangles = _Light(image, brdf, receiver, laser), np.array(facet), np.array(seen)
        about = np.bincount(pixel, _radon(light, facet, triangles), len(photons))  # each pixel's light
        np.add.at(photons, pixel, _integrate(light, facet, triangles, tolerance * about[pixel]))
    return photons


def lattice_photons(surfaces, truth, receiver, laser, n, shift=(0.0, 0.0), pixels=None):
    """Return the photons (pixel) from n rays in each pixel that a facet may touch, on a lattice (Korobov, golden ratio).

    Parameters
    ----------
    n : number of rays in each pixel
    shift : of the lattice along columns and rows, in pixels; the points wrap around
    pixels : numbers of the pixels to cast rays in (None: all that a facet may touch); the others are dark
    """
    n_cols, n_pixels = receiver.n_cols, receiver.n_rows * receiver.n_cols
    across = np.mod((np.arange(n) + 0.5) / n + shift[0], 1.0)
    down = np.mod(np.arange(n) * _GOLDEN + shift[1], 1.0)
    photons, touched = np.zeros(n_pixels), find_touched(surfaces, truth, receiver) if pixels is None else pixels
    step = max(1, 2**19 // n)  # pixels at once, so that memory is bounded
    for first in range(0, len(touched), step):
        pixel = touched[first : first + step]
        col, row = (pixel % n_cols)[:, None] + across, (pixel // n_cols)[:, None] + down
        x, y = receiver.tangents_at(col.ravel(), row.ravel())
        direction = np.stack([x, y, np.ones_like(x)], axis=1)
        direction /= np.linalg.norm(direction, axis=1, keepdims=True)
        rays = Rays(receiver.shape, direction, np.repeat(pixel, n).astype(np.int32), np.full(x.size, 1.0 / n))
        hits = scene.cast(rays, surfaces, truth, laser_from_m=laser.offset, aperture_m=receiver.aperture_m)
        photons += np.bincount(hits.pixel, optics.pixel_photons(hits, laser, receiver) * hits.weight, n_pixels)
    return photons


def find_touched(surfaces, truth, receiver):
    """Return the numbers of the pixels that the bounds of a facet touch, and of those close by."""
    (n_rows, n_cols), margin = receiver.shape, 0.01
    starts = np.zeros((n_rows + 1, n_cols + 1), dtype=np.int64)
    side = np.linspace(0.0, 1.0, 2 if receiver.distortion is None else 17)
    s, t = np.concatenate([[side, 0 * side], [side, 0 * side + 1], [0 * side, side], [0 * side + 1, side]], axis=1)
    for surface in surfaces:
        translation, matrix = truth.poses.place("lidar", surface.name)
        corners = surface.corners @ matrix.T + translation
        while len(corners) < _FEW_FACETS:  # bounds of small facets are tighter
            corners = _split(corners).reshape(-1, 3, 3)
        assert (corners[..., 2] > 0.0).all(), f"{surface.name}: reaches behind the lens"
        tangent = corners[..., :2] / corners[..., 2:]
        low, high = tangent.min(axis=1), tangent.max(axis=1)
        border = low[:, :, None] + (high - low)[:, :, None] * np.stack([s, t])  # of each facet's bounds
        col, row = receiver.image_of(border[:, 0], border[:, 1])
        first_col, last_col = _clip_range(col, margin, n_cols)
        first_row, last_row = _clip_range(row, margin, n_rows)
        on = (first_col < last_col) & (first_row < last_row)
        for rows, cols, sign in (
            (first_row, first_col, 1),
            (last_row, last_col, 1),
            (first_row, last_col, -1),
            (last_row, first_col, -1),
        ):
            np.add.at(starts, (rows[on], cols[on]), sign)
    return np.flatnonzero(starts.cumsum(axis=0).cumsum(axis=1)[:-1, :-1])


def _clip_range(points, margin, count):
    """Return the first pixel that points (facet, point) reach along an axis, and the one behind the last."""
    first = np.clip(np.floor(points.min(axis=1) - margin), 0, count).astype(int)
    return first, np.clip(np.ceil(points.max(axis=1) + margin), 0, count).astype(int)


class _Image:
    """Facets in the tangent plane: corners, half-planes (a, b, c) with a x + b y + c > 0 inside, and inverse depths."""

    def __init__(self, triangles):
        if not (triangles[..., 2] > 0.0).all():
            raise ValueError("a facet reaches behind the lens; polygons need all in front of it")
        normal = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
        lengths = np.linalg.norm(normal, axis=1)
        offset = np.einsum("fi,fi->f", normal, triangles.mean(axis=1))
        self.corners = triangles[..., :2] / triangles[..., 2:]
        (ax, ay), (bx, by), (cx, cy) = np.moveaxis(self.corners, 0, -1)
        area = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
        extent = np.ptp(self.corners, axis=1).max(axis=1)
        self.faces_us = (np.abs(area) > 1e-12 * extent**2) & (offset != 0.0) & (lengths > 0.0)
        with np.errstate(divide="ignore", invalid="ignore"):
            self.normal = normal / lengths[:, None]
            self.inverse_depth = normal / offset[:, None]
        turn = np.sign(area)
        sides = []
        for (px, py), (qx, qy) in (((ax, ay), (bx, by)), ((bx, by), (cx, cy)), ((cx, cy), (ax, ay))):
            sides.append(turn * np.stack([py - qy, qx - px, px * (qy - py) - py * (qx - px)]))
        self.sides = np.moveaxis(np.array(sides), -1, 0)
        self.low, self.high = self.corners.min(axis=1), self.corners.max(axis=1)

    def find_visible(self, square, least_area):
        """Yield the facets that are seen within a convex polygon, each with the polygons (list of corners) that are."""
        if len(square) < 3:
            return
        low, high = np.min(square, axis=0), np.max(square, axis=0)
        inside = self.faces_us & (self.low < high).all(axis=1) & (self.high > low).all(axis=1)
        whole = {}
        for i in np.flatnonzero(inside).tolist():
            polygon = square
            for side in self.sides[i].tolist():
                polygon = _clip(polygon, side)
            if _area(polygon) > least_area:
                whole[i] = polygon
        depths = {i: self.inverse_depth[i].tolist() for i in whole}
        for i, polygon in whole.items():
            visible = [polygon]
            for j in whole:
                if j != i and visible:
                    nearer = _nearer(depths[j], depths[i], polygon, wins=j < i)
                    if nearer is not None:
                        sides = [*self.sides[j].tolist(), nearer]
                        visible = [rest for part in visible for rest in _subtract(part, sides, least_area)]
            if visible:
                yield i, visible


def _nearer(depth, other, polygon, wins):
    """Return the half-plane in which one inverse depth (a, b, c) is above another; None if it is nowhere in a polygon.

    Where both coincide all over the polygon, it is everywhere or nowhere, by `wins`.
    """
    a, b, c = depth[0] - other[0], depth[1] - other[1], depth[2] - other[2]
    x, y = polygon[0]
    tie = _TIE * abs(other[0] * x + other[1] * y + other[2])
    heights = [a * x + b * y + c for x, y in polygon]
    if max(heights) <= tie and min(heights) >= -tie:
        return (0.0, 0.0, 1.0) if wins else None
    return (a, b, c) if max(heights) > tie else None


def _subtract(polygon, half_planes, least_area):
    """Return the convex polygons that are left of one outside an intersection of half-planes."""
    inside, outside = polygon, []
    for a, b, c in half_planes:
        outside.append(_clip(inside, (-a, -b, -c)))
        inside = _clip(inside, (a, b, c))
        if len(inside) < 3:
            return [polygon]
    if _area(inside) <= least_area:
        return [polygon]
    return [part for part in outside if _area(part) > least_area]


def _clip(polygon, half_plane):
    """Return the part of a convex polygon in a half-plane (Sutherland and Hodgman 1974)."""
    a, b, c = half_plane
    heights = [a * x + b * y + c for x, y in polygon]
    if all(height >= 0.0 for height in heights):
        return polygon
    kept = []
    for k, (x, y) in enumerate(polygon):
        (before_x, before_y), before, height = polygon[k - 1], heights[k - 1], heights[k]
        if (before < 0.0 < height) or (height < 0.0 < before):
            share = before / (before - height)
            kept.append((before_x + share * (x - before_x), before_y + share * (y - before_y)))
        if height >= 0.0:
            kept.append((x, y))
    return kept if len(kept) > 2 else []


def _area(polygon):
    """Return the area of a polygon without its sign (shoelace formula, about the first corner)."""
    if len(polygon) < 3:
        return 0.0
    x, y = polygon[0]
    return 0.5 * abs(sum((b[0] - x) * (c[1] - y) - (b[1] - y) * (c[0] - x) for b, c in pairwise(polygon[1:])))


def _pixel_square(receiver, number):
    """Return the corners of a pixel in the tangent plane."""
    row, col = divmod(int(number), receiver.n_cols)
    x = [(col + k - 0.5 * receiver.n_cols) * receiver.pixel_tangent for k in (0, 1)]
    y = [(row + k - 0.5 * receiver.n_rows) * receiver.pixel_tangent for k in (0, 1)]
    return [(x[0], y[0]), (x[1], y[0]), (x[1], y[1]), (x[0], y[1])]


def _beam_edges(laser):
    """Return the half-planes (edge, 3) whose intersection the beam lights; a Gaussian lights all."""
    edge = laser.half_width_tangent
    if laser.footprint == "gaussian":
        return np.empty((0, 3))
    if laser.footprint == "circle":
        angle = (np.arange(_SIDES) + 0.5) * (2.0 * math.pi / _SIDES)
        edge *= math.sqrt(math.pi / (_SIDES * math.tan(math.pi / _SIDES)))  # as large as the circle
    else:
        angle = np.arange(4) * (0.5 * math.pi)
    return np.column_stack([-np.cos(angle), -np.sin(angle), np.full(len(angle), edge)])


def _clip_to_beam(polygon, beam):
    """Return the part of a polygon that the beam lights."""
    heights = beam[:, :2] @ np.array(polygon).T + beam[:, 2:]
    if (heights < 0.0).all(axis=1).any():  # all corners beyond one edge
        return []
    for half_plane in beam[(heights < 0.0).any(axis=1)].tolist():
        polygon = _clip(polygon, half_plane)
    return polygon


class _Light:
    """The photons per unit area of the tangent plane that facets return: Fuller et al., eq. 7, with the 4 that it lacks."""

    def __init__(self, image, brdf, receiver, laser):
        self.normal, self.inverse_depth, self.brdf = image.normal, image.inverse_depth, brdf
        if not callable(brdf):
            self.brdf = lambda facet, _: np.broadcast_to(brdf, len(image.normal))[facet] / math.pi
        self.gathering_m2 = 0.25 * math.pi * receiver.aperture_m**2 * receiver.transmission
        self.footprint, self.edge, self.sent = laser.footprint, laser.half_width_tangent, laser.photons

    def at(self, facet, x, y):
        """Return the light of facets at points (triangle, point) of the tangent plane."""
        toward = np.stack([x, y, np.ones_like(x)])
        length = np.sqrt(x * x + y * y + 1.0)  # 1 / cos θ
        cosine = np.abs(np.einsum("ti,itp->tp", self.normal[facet], toward)) / length
        range_m = length / np.einsum("ti,itp->tp", self.inverse_depth[facet], toward)
        brdf = np.reshape(self.brdf(np.broadcast_to(facet[:, None], x.shape).ravel(), cosine.ravel()), x.shape)
        return self.density(x, y) * brdf * cosine / length / range_m**2 * self.gathering_m2

    def density(self, x, y):
        """Return the photons per unit area of the tangent plane that the laser sends, within its edges."""
        square = self.edge**2
        if self.footprint == "gaussian":
            return 2.0 * self.sent / (math.pi * square) * np.exp(-2.0 * (x * x + y * y) / square)
        return self.sent / {"square": 4.0 * square, "as_printed": square, "circle": math.pi * square}[self.footprint]


def _integrate(light, facet, triangles, error):
    """Return the integral of the light over triangles (triangle, corner, 2), split until it changes by less than an error.

    The error (triangle) is absolute [photons].
    """
    parts = _split(triangles)
    rough = _radon(light, facet, triangles)
    total = _radon(light, np.repeat(facet, 4), parts.reshape(-1, 3, 2)).reshape(-1, 4).sum(axis=1)
    again = np.abs(total - rough) > error
    if again.any():
        pieces = parts[again].reshape(-1, 3, 2)
        finer = _integrate(light, np.repeat(facet[again], 4), pieces, np.repeat(error[again], 4))
        total[again] = finer.reshape(-1, 4).sum(axis=1)
    return total


def _split(triangles):
    """Return the four triangles (triangle, 4, corner, axis) between corners and middles of sides."""
    a, b, c = np.moveaxis(triangles, 1, 0)
    ab, bc, ca = 0.5 * (a + b), 0.5 * (b + c), 0.5 * (c + a)
    corners = [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]
    return np.moveaxis(np.array(corners), 2, 0)


def _radon(light, facet, triangles):
    """Return the integral over triangles by the rule of seven points, exact to degree 5 (Radon 1948)."""
    root = math.sqrt(15.0)
    points, weights = [(1.0 / 3.0,) * 3], [9.0 / 40.0]
    for sign in (1.0, -1.0):
        inner = (6.0 + sign * root) / 21.0
        points += [tuple(np.roll((1.0 - 2.0 * inner, inner, inner), k)) for k in range(3)]
        weights += [(155.0 + sign * root) / 1200.0] * 3
    a, b, c = np.moveaxis(triangles, 1, 0)
    area = 0.5 * np.abs((b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) - (b[:, 1] - a[:, 1]) * (c[:, 0] - a[:, 0]))
    at = np.einsum("pk,tkc->ctp", np.array(points), triangles)
    return area * (light.at(facet, *at) @ np.array(weights))
