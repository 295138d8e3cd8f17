"""Light that one flash returns from one target, pixel by pixel, before the detector."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from rso_lidar import optics, sampling, scene
from rso_lidar.optics import Receiver
from rso_lidar.records import Hits, Photons, Truth
from rso_lidar.scenario.mission.mission import Mission
from rso_lidar.scenario.preview.aspects import collect_attitudes
from rso_lidar.scenario.preview.geometry import Preview
from rso_lidar.scenario.tables.lidar import Lidar
from rso_lidar.scene import Surface

_MOST_RAYS = 4_000_000  # in all casts of one line of a description, so that a large, near target takes seconds
_MOST_ATTITUDES = 48
_ROUNDING = 1e-12  # of the brightest pixel: the blur by a transform is good to this
_PATHS_KEY = np.array([0x6265666F, 0x72656C79], np.uint32)  # fixed, so that repeated calls give the same result


@dataclass(frozen=True, eq=False)
class TargetReturns:
    """Light of one flash, and the pixels that receive light from one target.

    `hits` and `light` are those of the whole scene. `pixel` (pixel) are the indices of pixels with light from the target,
    ascending. `photons` (pixel) is the expected number of photons that the target sends to each of them.
    """

    hits: Hits
    light: Photons
    pixel: np.ndarray
    photons: np.ndarray
    number: int

    def pixel_at(self, share: float) -> int | None:
        """Return the pixel at a quantile of the order by photons (0: dimmest, 1: brightest); None without light."""
        return int(self.pixel[self._at(share)]) if self.pixel.size else None

    def photons_at(self, share: float) -> float:
        """Return the photons of the pixel at that quantile; 0 without light."""
        return float(self.photons[self._at(share)]) if self.pixel.size else 0.0

    def _at(self, share: float) -> int:
        return int(np.argsort(self.photons, kind="stable")[int(share * (self.pixel.size - 1) + 0.5)])

    @property
    def sampling_error(self) -> float | None:
        """Relative rms error of the pixels' photons because rays sample them, weighted by light; None if unknown."""
        variance = self.light.photons_variance
        if variance is None or not self.pixel.size or self.photons.sum() <= 0.0:
            return None
        lit = self.photons > _ROUNDING * self.photons.max()  # what is dimmer is rounding, and has no relative error
        relative = variance.ravel()[self.pixel[lit]] / self.photons[lit]
        return math.sqrt(float(relative.sum() / self.photons.sum()))

    @property
    def filled_pixels(self) -> float:
        """Area of the target in the image, illuminated or not [pixels]."""
        return float(self.hits.weight[self.hits.target == self.number].sum())

    @property
    def brightest_fill(self) -> float:
        """Fraction of its brightest pixel that the target covers; 0 without light."""
        if not self.pixel.size:
            return 0.0
        on = (self.hits.target == self.number) & (self.hits.pixel == self.pixel[self.photons.argmax()])
        return float(self.hits.weight[on].sum())


def cast_surfaces(
    lidar: Lidar, surfaces: Sequence[Surface], truth: Truth, number: int, finest: int | None = None
) -> TargetReturns:
    """Cast one flash onto some surfaces, and collect its expected light without pulse jitter, sunlight and detector.

    Parameters
    ----------
    lidar : the instrument that is in force
    surfaces : of the target, and of what may hide it
    truth : one epoch, with the lidar and the surfaces in it
    number : of the target
    finest : greatest number of rays along a pixel's side (None: what the receiver asks for)

    Returns
    -------
    TargetReturns
        Expected photons, and the pixels that receive light from the target.
    """
    receiver = _reduce_rays(lidar.receiver, finest)
    hits = sampling.cast_pixels(receiver, lidar.laser, surfaces, truth, 1)
    paths = None
    if lidar.bounces > 1:
        paths = scene.bounce(hits, surfaces, truth, _PATHS_KEY, 1, laser_from_m=lidar.laser.offset, most=lidar.bounces)
    light = optics.collect(hits, lidar.laser, receiver, bounces=paths)
    mine = hits.target[light.hit] == number
    pixel = np.unique(light.pixel[mine])
    photons = np.bincount(light.pixel[mine], light.photons[mine], receiver.n_rows * receiver.n_cols)[pixel]
    return TargetReturns(hits, light, pixel, photons, number)


@lru_cache(maxsize=64)
def _reduce_rays(receiver: Receiver, finest: int | None) -> Receiver:
    """Return the receiver without sunlight, and with a fixed grid where its own would be finer than allowed."""
    without = receiver.replace(filter_width_nm=None, glare=None, ghosts=())
    if finest is None or finest >= receiver.rays_per_side:
        return without
    return without.replace(rays_per_pixel=max(finest, 1) ** 2)


def cast_attitudes(
    mission: Mission, preview: Preview, number: int, row: int, most: int = _MOST_ATTITUDES
) -> list[TargetReturns]:
    """Cast a flash at one epoch of a preview, once for each attitude that the target has near it.

    Attitudes are relative to the line of sight. They come from the epochs around `row` at which the range is the same
    within 5 %. A tumbling target yields many, a target that keeps its attitude yields one. The place is always that of
    the epoch, so that the photons belong to its range.
    """
    truths = collect_attitudes(mission, preview, number, row, most)
    finest = limit_fineness(mission, truths[0], len(truths))
    return [
        cast_surfaces(mission.instrument.at(truth.time_s), mission.surfaces, truth, number, finest) for truth in truths
    ]


def limit_fineness(mission: Mission, truth: Truth, casts: int) -> int:
    """Return the greatest number of rays along a pixel's side with which some casts take seconds."""
    return math.isqrt(int(_MOST_RAYS / casts / max(_pixels_in_bounds(mission, truth), 1.0)))


def _pixels_in_bounds(mission: Mission, truth: Truth) -> float:
    """Return an upper bound of the number of pixels that the bounds of all targets cover."""
    receiver = mission.instrument.at(truth.time_s).receiver
    extent = scene.extent(mission.surfaces, truth)
    edge = receiver.field_edge
    sides = np.clip(extent.high, -edge, edge) - np.clip(extent.low, -edge, edge)
    return float(np.prod(np.maximum(sides, 0.0) / receiver.pixel_tangent, axis=1).sum())
