"""Hits on one surface in its own axes: how they face the lidar."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from rso_lidar.records import Truth
from rso_lidar.scene.materials.crinkle import masking_shadowing
from rso_lidar.scene.surfaces.surface import Surface


@dataclass(frozen=True)
class LocalHits:
    """What the lidar sees of one surface, hit by hit, in the surface's axes.

    `point`, `to_viewer`, `facing` (the facet's normal), `base` (on smooth parts the interpolated one) and `normal` (the one
    that the BRDF gets, on crinkled foil a cell's) are (xyz, hit); all are on the viewer's side, with cosines `base_cos_out`
    and `cos_out` from the last two. `slope` is that of crinkled foil, 0 elsewhere. `number` is the surface's place among
    all `surfaces`.
    """

    surfaces: Sequence[Surface]
    number: int
    truth: Truth
    target_from_lidar: tuple[np.ndarray, np.ndarray]
    facet: np.ndarray
    point: np.ndarray
    to_viewer: np.ndarray
    facing: np.ndarray
    base: np.ndarray
    base_cos_out: np.ndarray
    normal: np.ndarray
    cos_out: np.ndarray
    slope: np.ndarray

    @property
    def surface(self) -> Surface:
        """Return the surface that is seen."""
        return self.surfaces[self.number]

    @cached_property
    def crinkled(self) -> np.ndarray:
        """Return which hits are on crinkled foil."""
        return np.flatnonzero(self.slope > 0.0)

    @cached_property
    def shown(self) -> np.ndarray:
        """Return by how much (hit) more a cell shows to the viewer than a flat piece would; 1 where nothing is crinkled."""
        shown = np.ones(len(self.facet))
        on = self.crinkled
        cos_tilt = dot(self.normal[:, on], self.base[:, on])
        shown[on] = self.cos_out[on] / np.maximum(self.base_cos_out[on] * cos_tilt, 1e-9)
        return shown

    def own_brdf_per_sr(self) -> np.ndarray:
        """Return the BRDF [1/sr] (hit) for light from the lens: what the lens sees of a cell, light from there meets."""
        brdf = self.surface.brdf_per_sr(self.facet, self.cos_out)
        on = self.crinkled
        cosine = self.base_cos_out[on]
        brdf[on] *= self.shown[on] * self.cos_out[on] / np.maximum(cosine, 1e-9)
        brdf[on] *= masking_shadowing(cosine, cosine, 1.0, self.slope[on])
        return brdf


def localize_hits(
    surfaces: Sequence[Surface],
    number: int,
    truth: Truth,
    direction: np.ndarray,
    facet: np.ndarray,
    range_m: np.ndarray,
    cosine: np.ndarray,
) -> LocalHits:
    """Return how the hits of rays `direction` (hit, xyz) on one surface face the lidar.

    `cosine` is that of the facet; on smooth parts it gives way to that of the interpolated normal, 0 where that turns away.
    """
    surface = surfaces[number]
    target_from_lidar = truth.poses.place(surface.name, "lidar")
    along = rotate(target_from_lidar, direction.T)
    point = target_from_lidar[0][:, None] + range_m * along
    plane = np.stack([surface.planes[axis][facet] for axis in range(3)])
    side = np.where(dot(plane, along) > 0.0, -1.0, 1.0)
    facing = side * plane
    base, base_cos_out = facing, cosine
    if surface.smooth:
        base = side * surface.shading_normals(facet, point.T).T
        smooth = surface.is_smooth[facet]
        base_cos_out = np.where(smooth, np.clip(-dot(base, along), 0.0, 1.0), cosine)
    normal, cos_out, slope = base, base_cos_out, np.zeros(len(facet))
    if surface.crinkled:
        normal, cos_out, finish = base.copy(), base_cos_out.copy(), surface.finish[facet]
        for of, material in surface.crinkled.items():
            on = np.flatnonzero(finish == of)
            slope[on] = material.rms_slope
            normal[:, on] = material.tilt_normals(base[:, on], point[:, on])
            cos_out[on] = np.clip(-dot(normal[:, on], along[:, on]), 0.0, 1.0)
    return LocalHits(
        surfaces,
        number,
        truth,
        target_from_lidar,
        facet,
        point,
        -along,
        facing,
        base,
        base_cos_out,
        normal,
        cos_out,
        slope,
    )


def rotate(a_from_b: tuple[np.ndarray, np.ndarray], vectors: np.ndarray) -> np.ndarray:
    """Return vectors (xyz, ray) turned from axes b to axes a, element by element."""
    matrix = a_from_b[1]
    x, y, z = vectors
    return np.stack([row[0] * x + row[1] * y + row[2] * z for row in matrix])


def dot(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Return the dot products of vectors (xyz, ray)."""
    product: np.ndarray = a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
    return product
