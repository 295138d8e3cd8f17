"""Light from the lens to the scene and back: extents, rays, hits, photons, and the bodies of the sky."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

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
class Contours(Record):
    """Lines of the image along which the brightness of targets may change abruptly; other targets may hide them."""

    ends: np.ndarray = array(
        "contour right_down_of_both", "f8", "1", "x/z and y/z of the first end, then of the second, in lidar axes"
    )
    step_per_sr_m2: np.ndarray = array(
        "contour", "f8", "sr-1 m-2", "change of BRDF times cosine of incidence over squared range"
    )
    inverse_depth_per_m: np.ndarray = array("contour both", "f8", "m-1", "1/z of the first end, then of the second")
    surface: np.ndarray = array("contour", "i2", "1", "index of the surface")


@dataclass(frozen=True, eq=False, repr=False)
class Rays(Record):
    """Rays that leave the lens, ordered by pixel. `shape` is (n_rows, n_cols)."""

    shape: tuple[int, int]
    direction: np.ndarray = array("ray xyz", "f8", "1", "unit vector in lidar axes")
    pixel: np.ndarray = array("ray", "i4", "1", "row * n_cols + col, never falling")
    weight: np.ndarray = array("ray", "f8", "1", "share of the pixel's area; made rays of a pixel sum to at most 1")
    side: np.ndarray | None = array(
        "ray",
        "f8",
        "1",
        "root mean square of the sides of the ray's share of the pixel, over the pixel's side; None: of squares",
        optional=True,
    )


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
        "BRDF from the Sun to the lidar times the cosine of the Sun's incidence and the share of its disc that is seen, and "
        "the same of the Earth's light over the Sun's; None without background",
        optional=True,
    )
    photons_variance: np.ndarray | None = array(
        "row col",
        "f8",
        "1",
        "variance of each pixel's expected photons, before the lens spreads them, because rays sample its area; None if "
        "not estimated",
        optional=True,
    )


@dataclass(frozen=True, eq=False, repr=False)
class Bounces(Record):
    """Paths of light that meet two surfaces or more: each joins a hit to an end, and light takes it both ways.

    Inward, light comes from the laser by the end and leaves from the hit, into the hit's pixel. Outward, it comes
    by the hit and leaves from the end, into that point's pixel. Both are relative to the irradiance [m-2] across
    the beam at the first point. Outward light is so for a hit that the lens sees under its share of a pixel's area.
    `pixel_share` is that share, the same for all paths.
    """

    pixel_share: float
    hit: np.ndarray = array("path", "i4", "1", "index of the hit where the path begins, never falling")
    direction: np.ndarray = array("path xyz", "f8", "1", "unit vector from the lidar to the end, in lidar axes")
    range_m: np.ndarray = array("path", "f8", "m", "distance of the end from the lidar")
    between_m: np.ndarray = array("path", "f8", "m", "way from the hit to the end, by the points between them")
    inward_per_sr: np.ndarray = array("path", "f8", "sr-1", "BRDF times cosine that the light by the end amounts to")
    outward_per_sr: np.ndarray = array("path", "f8", "sr-1", "BRDF times cosine of the light that leaves by the end")
    reverse_density: np.ndarray = array(
        "path",
        "f8",
        "1",
        "density of the same path drawn from its end, over its own; 0 where the lens does not see that point",
    )


@dataclass(frozen=True, eq=False, repr=False)
class Photons(Record):
    """Light that returns to the focal plane, ordered by pixel: one return for each hit, more behind a lens that blurs.

    Returns of a pixel belong to different clusters if the gap between their ranges is wider than c * FWHM / 2. The
    depth that a tilted surface spans between rays is added to that. Clusters are numbered through the frame by pixel,
    and in a pixel from near to far. `pulse_step_s` [s] is the time between taps of the pulse. `late_s` [s] is the delay
    of the pulse relative to the receiver's clock.

    Where a frame has several pulses and the scene moves between them, `epoch` and `pulse_epoch` tell which returns belong
    to which pulses. `photons`, `filled_fraction` and the background are then means over the pulses. Where each pulse has
    its own energy and delay, they are `pulse_energy_fraction` and `pulse_late_s`.
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
    photons_variance: np.ndarray | None = array(
        "row col",
        "f8",
        "1",
        "variance of each pixel's expected photons because rays sample its area; None if not estimated",
        optional=True,
    )
    pulse_epoch: np.ndarray | None = array(
        "pulse", "i4", "1", "epoch of the exposure of each pulse, never falling; None: one for all", optional=True
    )
    pulse_energy_fraction: np.ndarray | None = array(
        "pulse", "f8", "1", "energy of each pulse over their mean; None: all alike", optional=True
    )
    pulse_late_s: np.ndarray | None = array(
        "pulse", "f8", "s", "delay of each pulse beyond late_s; None: none", optional=True
    )

    def split_pulses(self, pulses: int) -> Iterator[Photons]:
        """Yield the light of each pulse of the frame.

        Parameters
        ----------
        pulses : number of pulses of the frame

        Returns
        -------
        Photons of one pulse after another

        Raises
        ------
        RecordError : if the light is of another number of pulses
        """
        epoch, energy, late_s = self.list_pulses(pulses)
        jitters = self.pulse_energy_fraction is not None
        last = -1
        for k in range(pulses):
            if epoch[k] != last:
                mean, last = self._select_epoch(epoch, epoch[k]), epoch[k]
            light = mean
            if jitters:
                light = replace(mean, photons=mean.photons * energy[k], late_s=self.late_s + float(late_s[k]))
            yield light

    def list_pulses(self, pulses: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return epoch, energy over the mean, and delay beyond `late_s` [s] of each pulse of the frame (pulse).

        Parameters
        ----------
        pulses : number of pulses of the frame

        Raises
        ------
        RecordError : if the light is of another number of pulses
        """
        for values in (self.pulse_epoch, self.pulse_energy_fraction, self.pulse_late_s):
            if values is not None and len(values) != pulses:
                raise RecordError(
                    f"Photons: is light of {len(values)} pulses and the detector takes {pulses}; match them"
                )
        epoch = np.zeros(pulses, np.int32) if self.pulse_epoch is None else self.pulse_epoch
        energy = np.ones(pulses) if self.pulse_energy_fraction is None else self.pulse_energy_fraction
        late_s = np.zeros(pulses) if self.pulse_late_s is None else self.pulse_late_s
        return epoch, energy, late_s

    def _select_epoch(self, pulse_epoch: np.ndarray, number: int) -> Photons:
        """Return the light of a pulse at one epoch of the exposure."""
        no_epochs: dict[str, Any] = dict.fromkeys(("epoch", "pulse_epoch", "pulse_energy_fraction", "pulse_late_s"))
        if self.epoch is None:
            return self if self.pulse_late_s is None else replace(self, **no_epochs)
        of = self.epoch == number
        returns = [name for name, spec in specs(Photons).items() if spec.dims == ("return",) and name != "epoch"]
        chosen = {name: getattr(self, name)[of] for name in returns}
        chosen["photons"] = chosen["photons"] * (len(pulse_epoch) / np.count_nonzero(pulse_epoch == number))
        return replace(self, **no_epochs, **chosen)


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
