"""Sampling of the pixels with rays: along scan lines that contours cut, on a fixed grid, or more on edges of an image."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from rso_lidar import optics, scene
from rso_lidar.optics import Laser, Receiver
from rso_lidar.records import Hits, Rays, Truth, specs
from rso_lidar.scene import Surface

# Least relative step of light between two facets that counts as a contour, over the error asked for; and at most:
_CREASE, _MOST_CREASE = 5.0, 0.1
_LIGHT_STEP = 0.1  # of a sunlit image: relative step of light from pixel to pixel that is sampled by a grid


def cast_pixels(
    receiver: Receiver,
    laser: Laser,
    surfaces: Sequence[Surface],
    truth: Truth,
    threads: int | None = None,
) -> Hits:
    """Cast the rays of one flash.

    Parameters
    ----------
    receiver : decides how rays sample its pixels, by `sampling_error` or `rays_per_pixel`
    threads : number of threads (None: one per core). The result is bit for bit the same

    Returns
    -------
    Hits in the order of pixels, with the variance of each pixel's photons that is left by sampling.
    """
    extent = scene.extent(surfaces, truth)

    def cast(rays: Rays) -> Hits:
        return scene.cast(
            rays,
            surfaces,
            truth,
            threads,
            laser_from_m=laser.offset,
            sun=receiver.filter_width_nm is not None,
            aperture_m=receiver.aperture_m,
        )

    least_crease = min(_CREASE * receiver.sampling_error, _MOST_CREASE)
    contours = scene.contours(surfaces, truth, least_crease, optics.find_small(receiver, extent))
    lines = optics.ScanLines(receiver, laser, extent, contours, scene.find_textures(surfaces, truth))
    if lines.probes is not None:  # what a front hides needs no lines
        lines.lay(scene.find_fronts(lines.probes, surfaces, truth, threads))
    hits = cast(lines.rays)
    hits, is_unfinished = lines.take(hits, optics.pixel_photons(hits, laser, receiver))
    if is_unfinished:
        finer = cast(lines.rays)
        hits, _ = lines.take(finer, optics.pixel_photons(finer, laser, receiver), hits)
    return hits


def cast_image(
    receiver: Receiver, light: Laser, surfaces: Sequence[Surface], truth: Truth, threads: int | None = None
) -> Hits:
    """Cast the rays of a sunlit image: one through the middle of each pixel, and a grid where the image has edges.

    Parameters
    ----------
    receiver : with a filter; its `rays_per_pixel` is the grid of pixels on edges
    light : even light over the field, which is not counted
    threads : number of threads (None: one per core). The result is bit for bit the same

    Returns
    -------
    Hits in the order of pixels, with the sunlight on each.
    """
    once = receiver if receiver.rays_per_side == 1 else receiver.replace(rays_per_pixel=1)
    extent = scene.extent(surfaces, truth)

    def cast(rays: Rays) -> Hits:
        return scene.cast(rays, surfaces, truth, threads, sun=True, aperture_m=receiver.aperture_m)

    if optics.find_small(once, extent).any():
        hits = cast_pixels(once, light, surfaces, truth, threads)
    else:
        hits = cast(_grid_rays(once, optics.find_pixels(once, extent)))
    edges = _find_edges(hits) if receiver.rays_per_side > 1 else np.empty(0, np.int64)
    if not len(edges):
        return hits
    return _replace_pixels(hits, cast(_grid_rays(receiver, edges)))


def _find_edges(hits: Hits) -> np.ndarray:
    """Find the pixels beside an edge (pixel): of a part, or of light; those that have several rays are fine enough."""
    rows, cols = hits.rays.shape
    light, piece = np.zeros((rows, cols)), np.full((rows, cols), -1, np.int32)
    assert hits.sunlight_per_sr is not None
    light.ravel()[hits.pixel] = hits.sunlight_per_sr
    piece.ravel()[hits.pixel] = hits.target.astype(np.int32) << 16 | hits.part
    is_edge = np.zeros((rows, cols), bool)
    for here, there in (
        (np.s_[1:, :], np.s_[:-1, :]),
        (np.s_[:, 1:], np.s_[:, :-1]),
        (np.s_[1:, 1:], np.s_[:-1, :-1]),
        (np.s_[1:, :-1], np.s_[:-1, 1:]),
    ):
        a, b = light[here], light[there]
        differ = (piece[here] != piece[there]) | (np.abs(a - b) > _LIGHT_STEP * np.maximum(a, b))
        is_edge[here] |= differ
        is_edge[there] |= differ
    is_edge.ravel()[hits.rays.pixel[1:][np.diff(hits.rays.pixel) == 0]] = False
    return np.flatnonzero(is_edge)


def _grid_rays(receiver: Receiver, pixels: np.ndarray) -> Rays:
    """Return the k x k rays of some pixels (pixel), ascending."""
    k = receiver.rays_per_side
    row, col = np.divmod(np.repeat(pixels, k * k), receiver.n_cols)
    down, right = np.divmod(np.tile(np.arange(k * k), len(pixels)), k)
    x, y = receiver.tangents_at(col + (right + 0.5) / k, row + (down + 0.5) / k)
    direction = np.stack([x, y, np.ones(len(x))])
    direction /= np.sqrt(x * x + y * y + 1.0)
    weight = np.full(len(x), 1.0 / k**2)
    return Rays(receiver.shape, direction.T, np.repeat(pixels, k * k).astype(np.int32), weight)


def _replace_pixels(hits: Hits, finer: Hits) -> Hits:
    """Replace the hits of some pixels by finer ones, and the rays too; the order is that of pixels."""
    is_replaced = np.zeros(hits.rays.shape[0] * hits.rays.shape[1], bool)
    is_replaced[finer.rays.pixel] = True
    kept_rays, kept = np.flatnonzero(~is_replaced[hits.rays.pixel]), np.flatnonzero(~is_replaced[hits.pixel])
    pixel = np.concatenate([hits.rays.pixel[kept_rays], finer.rays.pixel])
    order = np.argsort(pixel, kind="stable")
    direction = np.concatenate([hits.rays.direction.T[:, kept_rays], finer.rays.direction.T], axis=1)
    weight = np.concatenate([hits.rays.weight[kept_rays], finer.rays.weight])
    rays = Rays(hits.rays.shape, direction[:, order].T, pixel[order], weight[order])
    number, place = np.zeros(len(hits.rays.pixel), np.int32), np.empty(len(order), np.int32)
    number[kept_rays], place[order] = np.arange(len(kept_rays)), np.arange(len(order))
    ray = place[np.concatenate([number[hits.ray[kept]], finer.ray + len(kept_rays)])]
    sort = np.argsort(ray, kind="stable")
    names = [name for name in _list_fields(hits) if name != "ray"]
    fields = {name: np.concatenate([getattr(hits, name)[kept], getattr(finer, name)])[sort] for name in names}
    return replace(hits, rays=rays, ray=ray[sort], **fields, photons_variance=None)


def _list_fields(hits: Hits) -> list[str]:
    """List the fields of hits that have one value for each."""
    return [name for name, spec in specs(Hits).items() if spec.dims == ("hit",) and getattr(hits, name) is not None]
