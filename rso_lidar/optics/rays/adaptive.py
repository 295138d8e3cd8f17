"""Adaptive sampling: rays in rounds, until the light of each pixel is known to the error that the receiver asks for."""

from dataclasses import replace
from typing import Any

import numpy as np

from rso_lidar.kernels import packed
from rso_lidar.optics.laser import Laser
from rso_lidar.optics.rays.cell_light import (
    choose_cells,
    estimate_variance,
    mark_crossed,
    settle_variance,
    sum_pixels,
)
from rso_lidar.optics.rays.cell_tree import divide_cells, find_levels, list_leaves, place_rays, plant_cells
from rso_lidar.optics.rays.cells import boxes_in_cells, outlines_in_cells
from rso_lidar.optics.rays.coverage import FINEST, find_fineness, find_spans
from rso_lidar.optics.rays.ray_grid import normalise
from rso_lidar.optics.receiver import Receiver
from rso_lidar.records import Contours, Extent, Hits, Rays, specs

NOISE_SHARE = 1.0 / 3.0  # of its photon noise: so much error a pixel may have in any case
_DOUBT = (
    1.0 / 12.0
)  # variance of a crossed cell's light over its squared step, if any share of it may be lit: uniform law
_LEAST_PHOTONS = 1.0  # a pixel with fewer counts as one with so many
# Choices between error and time, as docs/physics.md and docs/performance.md state them:
_MOST_ROUNDS = 3  # after the first
_FREE_RAYS, _MORE_RAYS = 24_000, 0.6  # after the first round: so many, and this multiple of those in the first
_WORTH_A_ROUND = 0.2  # of those rays: with fewer left, another round costs more than it brings
_MOST_FINE = 2**18  # cells of a target in the first round that a narrow beam asks for
_CELLS_OF_BEAM = 8  # across a beam, at least
_GAUSSIAN_REACH = 3.5  # 1/e² radii; 2e-11 of the energy lands farther out
_SIDES_OF_CIRCLE = 96  # of the polygon that stands for a round beam's edge
_PIECES_OF_BENT = 8  # of a contour, behind a lens that distorts


class AdaptiveSampling:
    """Rays of one flash, made in rounds.

    In the first round, each pixel that a target touches has a grid of cells with one ray each. In later rounds, cells are
    divided into nine where the light of their pixel is not known well enough: where it bends between neighbouring cells,
    and where a contour crosses cells beside the sky. A pixel is known well enough if its estimated error is below
    `Receiver.sampling_error` of its light or a third of its photon noise. The number of rays is bounded, and those pixels
    come first in which a ray helps most. So others may stay above this, and their labels say so.

    Nothing is drawn at random: rays go through the middles of cells, whose weights are their shares of a pixel's area.
    """

    def __init__(
        self, receiver: Receiver, laser: Laser, extent: Extent, contours: Contours, *, is_textured: bool = False
    ) -> None:
        """Place the cells of the first round.

        Parameters
        ----------
        receiver, laser : the instrument
        extent, contours : where targets and their contours are in the image
        is_textured : whether light changes inside facets, as on crinkled foil. Then all cells of a pixel are divided
            together: to divide those that glitter would bias the pixel's light
        """
        self._is_textured = is_textured
        self._receiver, self._shape = receiver, receiver.shape
        boxes, levels = _plan_cells(receiver, laser, extent)
        self._k = receiver.rays_per_side
        outlines = outlines_in_cells(receiver, extent)
        self._root, self._first_row, self._first_col, self._nodes = plant_cells(
            boxes, levels, outlines, self._k, self._shape
        )
        self._ends, self._steps = _find_contour_images(receiver, laser, contours)
        self._is_active = np.ones(len(self._steps), bool)
        self._light, self._variance, self._least_step = np.zeros((3, len(self._nodes)))
        self._brightest, self._step, self._weight = np.zeros((3, len(self._nodes)))
        self._is_hit = np.zeros(len(self._nodes), bool)
        self._ray_of, self._hit_of = (np.full(len(self._nodes), -1) for _ in range(2))
        self._leaves = list_leaves(self._root, self._nodes, self._k)
        self._fresh = self._leaves  # cells that have no ray yet
        self._budget = self._left = _FREE_RAYS + _MORE_RAYS * len(self._leaves)
        self._batches: list[Hits] = []
        self.photons_variance = np.zeros(self._shape)

    def next_rays(self) -> Rays | None:
        """Return the rays of the next round, None if none is needed. Call `add` with their hits before the next call."""
        if self._batches and not len(self._fresh):
            return None
        point, pixel, weight = place_rays(self._nodes, self._fresh, self._k, self._shape[1])
        self._weight[self._fresh] = weight
        direction = np.empty((3, len(pixel)))
        direction[0], direction[1] = self._receiver.tangents_at(point[0], point[1])
        normalise(direction)
        return Rays(self._shape, direction.T, pixel, weight)

    def add(self, hits: Hits, photons: np.ndarray) -> None:
        """Take the hits of the last rays, and choose the cells to divide next.

        Parameters
        ----------
        hits : hits of the last rays
        photons : (hit) expected photons of a whole pixel that is as bright as the hit
        """
        met = self._fresh[hits.ray]
        self._light[met], self._is_hit[met] = photons, True
        self._ray_of[self._fresh] = sum(len(batch.rays.pixel) for batch in self._batches) + np.arange(len(self._fresh))
        self._hit_of[met] = sum(len(batch.pixel) for batch in self._batches) + np.arange(len(met))
        tree = self._root, self._first_row, self._first_col, self._nodes
        estimate_variance(
            *tree, self._fresh, self._light, self._is_hit, self._k, self._variance, self._least_step, self._brightest
        )
        mark_crossed(*tree, self._ends, self._steps, self._is_active, self._k, self._least_step, self._step)
        settle_variance(self._nodes, self._fresh, self._k, self._least_step, self._step, self._variance)
        self._batches.append(hits)
        self._divide()

    def _divide(self) -> None:
        """Divide the cells that are worth it, and add up what is known of each pixel."""
        of_leaves = self._nodes, self._leaves
        _, pixels, _, variance, _ = sum_pixels(*of_leaves, self._light, self._variance, self._k, self._shape[1])
        self.photons_variance.flat[pixels] = variance
        self._fresh = self._fresh[:0]
        if len(self._batches) > _MOST_ROUNDS or self._left < _WORTH_A_ROUND * self._budget or not len(pixels):
            return
        # What to divide must not depend on what the rays of crossed cells happen to meet: pixels that have too much light
        # would be left alone, and those that have too little corrected. So contours alone speak for these cells.
        is_crossed = self._step > 0.0
        step = np.maximum(self._step, self._brightest)
        expected = np.where(is_crossed, 0.5 * step, self._light)
        doubt = np.where(is_crossed, _DOUBT * (step * self._weight) ** 2, self._variance)
        starts, _, photons, variance, counts = sum_pixels(*of_leaves, expected, doubt, self._k, self._shape[1])
        noise = NOISE_SHARE * np.sqrt(np.maximum(photons, _LEAST_PHOTONS))
        allowed = np.maximum(self._receiver.sampling_error * photons, noise) ** 2
        unknown = np.flatnonzero(variance > allowed)
        urgency = variance[unknown] / np.maximum(photons[unknown], _LEAST_PHOTONS) / counts[unknown]
        order = packed(unknown[np.argsort(-urgency, kind="stable")])
        bound = np.zeros(len(pixels)) if self._is_textured else allowed / np.maximum(counts, 1)
        chosen = choose_cells(starts, self._leaves, doubt, bound, order, int(self._left / 9.0))
        if not len(chosen):
            return
        first, new = len(self._nodes), 9 * len(chosen)
        self._left -= new
        self._nodes = divide_cells(self._nodes, chosen)
        for name in ("_light", "_variance", "_least_step", "_brightest", "_step", "_weight", "_is_hit"):
            values = getattr(self, name)
            setattr(self, name, np.concatenate([values, np.zeros(new, values.dtype)]))
        for name in ("_ray_of", "_hit_of"):
            setattr(self, name, np.concatenate([getattr(self, name), np.full(new, -1)]))
        self._fresh = np.arange(first, first + new, dtype=np.int32)
        self._leaves = list_leaves(self._root, self._nodes, self._k)

    def join_hits(self) -> Hits:
        """Join the hits of the rays of all cells that were not divided, with the variance of each pixel's photons."""
        if len(self._batches) == 1:  # nothing was divided
            return replace(self._batches[0], photons_variance=self.photons_variance)
        _, pixel, weight = place_rays(self._nodes, self._leaves, self._k, self._shape[1])
        ray_of, hit_of = self._ray_of[self._leaves], self._hit_of[self._leaves]
        direction = np.empty((3, len(ray_of)))
        for axis in range(3):
            every = np.concatenate([batch.rays.direction[:, axis] for batch in self._batches])
            every.take(ray_of, out=direction[axis], mode="clip")
        ray = np.flatnonzero(hit_of >= 0)
        from_hit = hit_of[ray]
        columns: dict[str, Any] = {}
        for name, spec in specs(Hits).items():
            if spec.dims == ("hit",) and getattr(self._batches[0], name) is not None:
                every = np.concatenate([getattr(batch, name) for batch in self._batches])
                columns[name] = every.take(from_hit, mode="clip")
        columns |= {"ray": ray.astype(np.int32), "weight": weight[ray]}
        rays = Rays(self._shape, direction.T, pixel, weight)
        return Hits(rays, **columns, photons_variance=self.photons_variance)


def _plan_cells(receiver: Receiver, laser: Laser, extent: Extent) -> tuple[np.ndarray, np.ndarray]:
    """Plan the cells of the first round.

    Returns
    -------
    Bounds (target, low_high, row_col) of the targets, where the beam may light them, in coarse cells; and the level of each
    target's cells (target).
    """
    boxes = boxes_in_cells(receiver, extent, np.inf)
    fineness, of_beam = find_fineness(boxes, receiver.min_rays_per_target), _fineness_of_beam(laser, receiver)
    if laser.offset is None and receiver.filter_width_nm is None:
        boxes = boxes_in_cells(receiver, extent, _reach(laser, receiver, of_beam))
    spans = find_spans(boxes, *(side * receiver.rays_per_side for side in receiver.shape))
    sizes = np.stack([spans[:, 1] - spans[:, 0], spans[:, 3] - spans[:, 2]], axis=1)  # (target, row_col)
    # A beam that may light all of a target (beside the lens, or with the Sun) is resolved as well as memory allows.
    sides = np.clip(np.nan_to_num(boxes[:, 1] - boxes[:, 0], nan=0.0), 1.0 / of_beam, sizes + 1.0)
    bounded = np.sqrt(_MOST_FINE / np.maximum(sides.prod(axis=1), 1e-12))
    fineness = np.maximum(fineness, np.maximum(np.minimum(of_beam, bounded), 1.0).astype(np.int64))
    return boxes, find_levels(fineness)


def _reach(laser: Laser, receiver: Receiver, fineness: int) -> float:
    """Return the distance from the boresight, in the tangent plane, beyond which there is no light of the laser.

    Parameters
    ----------
    fineness : cells along the side of a coarse cell
    """
    if laser.footprint == "gaussian":
        return _GAUSSIAN_REACH * laser.half_width_tangent
    return laser.half_width_tangent + receiver.pixel_tangent / (receiver.rays_per_side * fineness)


def _fineness_of_beam(laser: Laser, receiver: Receiver) -> int:
    """Return the cells along a coarse cell's side that resolve a beam narrower than the field."""
    cell = receiver.pixel_tangent / receiver.rays_per_side
    return int(min(np.ceil(_CELLS_OF_BEAM * cell / (2.0 * laser.half_width_tangent)), FINEST))


def _pieces(receiver: Receiver) -> int:
    """Return into how many straight pieces a contour is cut."""
    return 1 if receiver.distortion is None else _PIECES_OF_BENT


def _find_contour_images(receiver: Receiver, laser: Laser, contours: Contours) -> tuple[np.ndarray, np.ndarray]:
    """Return the contours of targets, and then the edge of the beam, on the focal plane.

    Parameters
    ----------
    contours : contours in the tangent plane

    Returns
    -------
    Columns and rows of both ends (contour, 4) [pixels], and steps of brightness (contour) [photons in a whole pixel],
    negative for the edge of the beam, which counts everywhere.
    """
    gathered = receiver.pixel_tangent**2 * receiver.aperture_area_m2 * receiver.transmission
    steps = contours.step_per_sr_m2 * (laser.density_on_axis * gathered)
    edge = np.empty((0, 4))
    if (
        laser.offset is None
        and laser.footprint != "gaussian"
        and laser.half_width_tangent < receiver.field_edge.max() * 1.5
    ):
        corners = _SIDES_OF_CIRCLE if laser.footprint == "circle" else 4
        angle = (np.arange(corners) + 0.5) * (2.0 * np.pi / corners)
        radius = laser.half_width_tangent * (1.0 if laser.footprint == "circle" else 2.0**0.5)
        right, down = radius * np.cos(angle), radius * np.sin(angle)
        edge = np.stack([right, down, np.roll(right, -1), np.roll(down, -1)], axis=1)
    ends, pieces = np.concatenate([contours.ends, edge]), _pieces(receiver)
    if pieces > 1:
        at = np.arange(pieces + 1) / pieces
        right, down = (ends[:, [axis]] + at * (ends[:, [axis + 2]] - ends[:, [axis]]) for axis in (0, 1))
        ends = np.stack([right[:, :-1], down[:, :-1], right[:, 1:], down[:, 1:]], axis=-1).reshape(-1, 4)
    images = np.empty_like(ends)
    for end in (0, 2):
        x, y = (np.clip(ends[:, end + axis], -1e6, 1e6) for axis in (0, 1))
        images[:, end], images[:, end + 1] = receiver.image_of(x, y)
    typical = float(np.median(steps)) if len(steps) else 0.0
    return packed(images), packed(np.repeat(np.append(steps, np.full(len(edge), -typical)), pieces))
