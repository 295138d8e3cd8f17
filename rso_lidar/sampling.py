"""Sampling of the pixels with rays: one in each interval that contours cut from scan lines, or a fixed grid."""

from __future__ import annotations

from collections.abc import Sequence

from rso_lidar import optics, scene
from rso_lidar.optics import Laser, Receiver
from rso_lidar.records import Hits, Rays, Truth
from rso_lidar.scene import Surface

# Least relative step of light between two facets that counts as a contour, over the error asked for; and at most:
_CREASE, _MOST_CREASE = 5.0, 0.1


def cast_pixels(
    receiver: Receiver,
    laser: Laser,
    surfaces: Sequence[Surface],
    truth: Truth,
    threads: int | None = None,
    *,
    has_penumbra: bool = False,
) -> Hits:
    """Cast the rays of one flash.

    Parameters
    ----------
    receiver : decides how rays sample its pixels, by `sampling_error` or `rays_per_pixel`
    threads : number of threads (None: one per core). The result is bit for bit the same
    has_penumbra : whether shadows of the Sun have soft edges

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
            penumbra_pixel_rad=receiver.pixel_tangent if has_penumbra else None,
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
