"""Light from the lens to the scene and back: extents, rays, hits, photons, and the bodies of the sky."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import repeat

import numpy as np

from rso_lidar.errors import RecordError
from rso_lidar.records.schema import Record, array, specs


@dataclass(frozen=True, eq=False, repr=False)
class Extent(Record):
    """Where each target can be seen, as bounds in the tangent plane z = 1 of the lidar; empty where low > high.

    `outlines` holds, for each target, the corners (corner, right_down) of convex outlines that together cover its
    visible extent, in order around them. It is None where the target reaches behind the lidar or is not visible; the
    bounds then stand alone.
    """

    low: np.ndarray = array("target right_down", "f8", "1", "least x/z and y/z of the target in lidar axes")
    high: np.ndarray = array("target right_down", "f8", "1", "greatest x/z and y/z of the target in lidar axes")
    outlines: tuple[tuple[np.ndarray, ...] | None, ...] | None = None


@dataclass(frozen=True, eq=False, repr=False)
class Rays(Record):
    """Rays that leave the lens, ordered by pixel. `shape` is (n_rows, n_cols)."""

    shape: tuple[int, int]
    direction: np.ndarray = array("ray xyz", "f8", "1", "unit vector in lidar axes")
    pixel: np.ndarray = array("ray", "i4", "1", "row * n_cols + col, never falling")
    weight: np.ndarray = array("ray", "f8", "1", "share of the pixel's area; made rays of a pixel sum to at most 1")


@dataclass(frozen=True, eq=False, repr=False)
class Hits(Record):
    """First facets that rays meet, ordered as the rays are; a ray that meets nothing has no row."""

    rays: Rays
    ray: np.ndarray = array("hit", "i4", "1", "index of the ray")
    pixel: np.ndarray = array("hit", "i4", "1", "row * n_cols + col")
    weight: np.ndarray = array("hit", "f8", "1", "share of the pixel's area")
    target: np.ndarray = array("hit", "i2", "1", "index of the target")
    facet: np.ndarray = array("hit", "i4", "1", "facet index in the target's source file, before repairs")
    part: np.ndarray = array("hit", "i2", "1", "index of the target's part")
    range_m: np.ndarray = array("hit", "f8", "m", "slant range along the ray from the lidar's origin")
    cos_incidence: np.ndarray = array("hit", "f8", "1", "cosine of the laser's incidence, two-sided; 0 in its shadow")
    brdf_per_sr: np.ndarray = array("hit", "f8", "sr-1", "BRDF toward the lidar, without the cosine")
    sunlight_per_sr: np.ndarray | None = array(
        "hit",
        "f8",
        "sr-1",
        "BRDF from the Sun to the lidar times the cosine of the Sun's incidence and the share of its disc that is seen; "
        "None without background",
        optional=True,
    )


@dataclass(frozen=True, eq=False, repr=False)
class Photons(Record):
    """Light that returns to the focal plane, ordered by pixel: one return for each hit, more behind a lens that blurs.

    Returns of a pixel belong to different clusters if their ranges leave a gap wider than c * FWHM / 2, beyond the
    depth that a tilted surface spans between rays. Clusters are numbered through the frame by pixel, and in a pixel
    from near to far. `pulse_step_s` [s] is the time between taps of the pulse. `late_s` [s] is the delay of the pulse
    relative to the receiver's clock.

    Where a frame has several pulses and the scene moves between them, `epoch` and `pulse_epoch` tell which returns belong
    to which pulses. `photons`, `filled_fraction` and the background are then means over the pulses.
    """

    shape: tuple[int, int]
    pulse_fwhm_s: float
    pulse_step_s: float
    late_s: float
    pulse_power_per_s: np.ndarray = array(
        "tap", "f8", "s-1", "power of the pulse over its energy, in time; the middle tap is its time zero"
    )
    pixel: np.ndarray = array("return", "i4", "1", "row * n_cols + col")
    delay_s: np.ndarray = array("return", "f8", "s", "two-way delay since emission")
    photons: np.ndarray = array("return", "f8", "1", "expected photons on the pixel, after the optics, before the APD")
    depth_spread_s: np.ndarray = array(
        "return", "f8", "s", "two-way delay from near to far edge of the sub-ray's footprint"
    )
    coherence_cells: np.ndarray = array(
        "return", "f8", "1", "area of the aperture times solid angle of the return over the squared wavelength"
    )
    hit: np.ndarray = array(
        "return", "i4", "1", "index of the hit that sends it, or most of it behind a lens that blurs"
    )
    cluster: np.ndarray = array("return", "i4", "1", "cluster of the return, counted through the frame")
    cluster_pixel: np.ndarray = array("cluster", "i4", "1", "pixel of each cluster, never falling")
    filled_fraction: np.ndarray | None = array(
        "row col",
        "f8",
        "1",
        "share of each pixel's area that is on a target and lit; None: all that was hit",
        optional=True,
    )
    background_photons_per_s: np.ndarray | None = array(
        "row col",
        "f8",
        "s-1",
        "sunlight on each pixel, stray light included, after the optics; None without background",
        optional=True,
    )
    epoch: np.ndarray | None = array(
        "return", "i4", "1", "epoch of the exposure at which it returns, rising in a pixel; None: at all", optional=True
    )
    pulse_epoch: np.ndarray | None = array(
        "pulse", "i4", "1", "epoch of the exposure of each pulse, never falling; None: one for all", optional=True
    )

    def split_pulses(self, pulses: int) -> Iterator[Photons]:
        """Yield the light of each pulse of the frame.

        Parameters
        ----------
        pulses : number of pulses of the frame.

        Returns
        -------
        Photons of one pulse after another.

        Raises
        ------
        RecordError : if the light is of another number of pulses.
        """
        if self.epoch is None or self.pulse_epoch is None:
            yield from repeat(self, pulses)
            return
        if len(self.pulse_epoch) != pulses:
            raise RecordError(
                f"Photons.pulse_epoch: is of {len(self.pulse_epoch)} pulses and the detector takes {pulses}; match them"
            )
        for number, count in zip(*np.unique(self.pulse_epoch, return_counts=True), strict=True):
            of = self.epoch == number
            chosen = {
                name: getattr(self, name)[of]
                for name, spec in specs(Photons).items()
                if spec.dims == ("return",) and name != "epoch"
            }
            chosen["photons"] = chosen["photons"] * (pulses / count)
            yield from repeat(replace(self, **chosen, epoch=None, pulse_epoch=None), int(count))


@dataclass(frozen=True, eq=False, repr=False)
class Sky(Record):
    """Sun, lit Earth and Moon as the lens sees them, in the band of its filter, without what targets hide.

    The sources are cut into elements, each with its direction and its light. `body` is 0 for the Sun, 1 for the Earth and 2
    for the Moon.
    """

    image_photons_per_s: np.ndarray = array(
        "row col", "f8", "s-1", "light of the bodies that each pixel sees, after a lens without blur"
    )
    direction: np.ndarray = array("element xyz", "f8", "1", "unit vector toward the element in lidar axes")
    photons_per_s: np.ndarray = array(
        "element", "f8", "s-1", "light of the element on a plane of the aperture's area across its direction"
    )
    radius_rad: np.ndarray = array("element", "f8", "rad", "radius of a disc of the element's solid angle")
    body: np.ndarray = array("element", "i1", "1", "body of the element: 0 Sun, 1 Earth, 2 Moon")


@dataclass(frozen=True, eq=False, repr=False)
class Oversampled(Record):
    """The scene on the grid of rays, finer than the pixels (Fuller et al., figs. 9 and 11): range image and photon image."""

    range_m: np.ndarray = array("fine_row fine_col", "f4", "m", "range where the ray of the cell hit, NaN for sky")
    photons: np.ndarray = array("fine_row fine_col", "f4", "1", "expected photons that the cell sends to its pixel")
