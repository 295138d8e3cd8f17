"""Hits on one surface, expressed in the axes of the surface."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from rso_lidar.records import Truth
from rso_lidar.scene.materials.crinkle import masking_shadowing
from rso_lidar.scene.surfaces.surface import Surface


@dataclass(frozen=True)
class LocalHits:
    """The hits on one surface, in the surface's axes.

    Vectors are (xyz, hit). All normals are on the viewer's side.

    Attributes
    ----------
    surfaces, number : all surfaces, and which of them is hit
    truth : where they are
    target_from_lidar : position and rotation of the lidar in these axes
    facet : number of the facet (hit)
    point, to_viewer : where the hit is [m], and the unit vector from there to the viewer: the lidar, if nothing else is said
    facing : normal of the facet
    base, base_cos_out : normal, interpolated on smooth parts, and its cosine with the direction to the viewer
    normal, cos_out : the normal that the BRDF gets, on crinkled foil that of a cell, and its cosine
    slope : rms slope of the cells of crinkled foil, 0 elsewhere (hit)
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
        """The surface that is hit."""
        return self.surfaces[self.number]

    def only(self, some: np.ndarray) -> LocalHits:
        """Return a selection of the hits."""
        vectors = ("point", "to_viewer", "facing", "base", "normal")
        numbers = ("facet", "base_cos_out", "cos_out", "slope")
        chosen = {name: getattr(self, name)[:, some] for name in vectors}
        return replace(self, **chosen, **{name: getattr(self, name)[some] for name in numbers})

    @cached_property
    def crinkled(self) -> np.ndarray:
        """Hits on crinkled foil."""
        return np.flatnonzero(self.slope > 0.0)

    @cached_property
    def projected_area(self) -> np.ndarray:
        """Projected area of a cell toward the viewer over that of a flat piece (hit); 1 where nothing is crinkled."""
        area = np.ones(len(self.facet))
        on = self.crinkled
        cos_tilt = dot(self.normal[:, on], self.base[:, on])
        area[on] = self.cos_out[on] / np.maximum(self.base_cos_out[on] * cos_tilt, 1e-9)
        return area

    def own_brdf_per_sr(self) -> np.ndarray:
        """Return the BRDF [1/sr] (hit) for light that comes from the lens."""
        brdf = self.surface.brdf_per_sr(self.facet, self.cos_out)
        on = self.crinkled
        cosine = self.base_cos_out[on]
        brdf[on] *= self.projected_area[on] * self.cos_out[on] / np.maximum(cosine, 1e-9)
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
    """Express hits on one surface in its own axes.

    Parameters
    ----------
    truth : where they are
    direction : (hit, xyz), unit vectors of the rays in lidar axes
    facet : (hit), number of the facet
    range_m : (hit), range [m]
    cosine : (hit), cosine of incidence on the facet. On smooth parts that of the interpolated normal replaces it, 0 where
        that normal points away

    Returns
    -------
    the hits in the surface's axes.
    """
    target_from_lidar = truth.poses.place(surfaces[number].name, "lidar")
    along = rotate(target_from_lidar, direction.T)
    point = target_from_lidar[0][:, None] + range_m * along
    return face_viewer(surfaces, number, truth, facet, point, along, cosine)


def face_viewer(
    surfaces: Sequence[Surface],
    number: int,
    truth: Truth,
    facet: np.ndarray,
    point: np.ndarray,
    along: np.ndarray,
    cosine: np.ndarray,
) -> LocalHits:
    """Express points on one surface as they are seen from anywhere.

    Parameters
    ----------
    truth : where the surfaces are
    facet : (hit), number of the facet
    point, along : (xyz, hit), the points [m], and unit vectors from the viewer to them, in the surface's axes
    cosine : as for `localize_hits`

    Returns
    -------
    the hits in the surface's axes; `to_viewer` goes to that viewer.
    """
    surface = surfaces[number]
    target_from_lidar = truth.poses.place(surface.name, "lidar")
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
