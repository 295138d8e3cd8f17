"""Returns of one flash from one target: its pixels and their light, cast with rays, before the detector."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from rso_lidar import optics, scene
from rso_lidar.optics import Receiver
from rso_lidar.records import Hits, Photons, Truth
from rso_lidar.scenario.mission.mission import Mission
from rso_lidar.scenario.preview.attitudes import attitude_truths
from rso_lidar.scenario.preview.geometry import Preview

_MOST_RAYS = 4_000_000  # of all casts of one statement together: a large, near target then takes seconds
_MOST_ATTITUDES = 48


@dataclass(frozen=True, eq=False)
class TargetReturns:
    """One target in one flash: the light of the whole scene, and which of its pixels see the target.

    `pixel` (pixel) are those with light of the target, rising, and `photons` (pixel) what the target sends to each.
    """

    hits: Hits
    light: Photons
    pixel: np.ndarray
    photons: np.ndarray
    number: int

    def pixel_at(self, share: float) -> int | None:
        """Return the pixel at a share (0: dimmest, 1: brightest) of the order by photons; None without light."""
        return int(self.pixel[self._at(share)]) if self.pixel.size else None

    def photons_at(self, share: float) -> float:
        """Return the photons of that pixel; 0 without light."""
        return float(self.photons[self._at(share)]) if self.pixel.size else 0.0

    def _at(self, share: float) -> int:
        return int(np.argsort(self.photons, kind="stable")[int(share * (self.pixel.size - 1) + 0.5)])

    @property
    def filled_pixels(self) -> float:
        """Return the area of the target in the image, lit or not [pixels]."""
        return float(self.hits.weight[self.hits.target == self.number].sum())

    @property
    def brightest_fill(self) -> float:
        """Return the share of its brightest pixel that the target covers; 0 without light."""
        if not self.pixel.size:
            return 0.0
        on = (self.hits.target == self.number) & (self.hits.pixel == self.pixel[self.photons.argmax()])
        return float(self.hits.weight[on].sum())


def cast_target(mission: Mission, truth: Truth, number: int, finest: int | None = None) -> TargetReturns:
    """Cast one flash and collect its light, in expectation: no jitter from pulse to pulse, no sunlight, no detector.

    Parameters
    ----------
    mission : what is flown.
    truth : one epoch, with the lidar in it.
    number : of the target.
    finest : rays along a pixel's side at most (None: the receiver's own number).
    """
    lidar = mission.instrument.at(truth.time_s)
    own = lidar.receiver.rays_per_side
    receiver = _with_rays(lidar.receiver, own if finest is None else max(min(own, finest), 1))
    rays = optics.pixel_rays(receiver, lidar.laser, scene.extent(mission.surfaces, truth))
    hits = scene.cast(rays, mission.surfaces, truth, 1, laser_from_m=lidar.laser.offset, aperture_m=receiver.aperture_m)
    light = optics.collect(hits, lidar.laser, receiver)
    mine = hits.target[light.hit] == number
    pixel = np.unique(light.pixel[mine])
    photons = np.bincount(light.pixel[mine], light.photons[mine], receiver.n_rows * receiver.n_cols)[pixel]
    return TargetReturns(hits, light, pixel, photons, number)


@lru_cache(maxsize=64)
def _with_rays(receiver: Receiver, per_side: int) -> Receiver:
    return receiver.replace(rays_per_pixel=per_side**2, filter_width_nm=None)


def cast_attitudes(
    mission: Mission, seen: Preview, number: int, row: int, most: int = _MOST_ATTITUDES
) -> list[TargetReturns]:
    """Cast a flash at one instant of a preview, once for each attitude that the target has about then.

    Attitudes are relative to the line of sight. They are taken from the instants around `row` at which the range is the same
    within 5 %. A tumbling target gives many, one that holds its attitude gives one. The place stays that of the instant, so
    that the photons are those of its range.

    Parameters
    ----------
    mission : what is flown.
    seen : its preview.
    number : of the target.
    row : of the preview's instants.
    most : number of attitudes at most.
    """
    truths = attitude_truths(mission, seen, number, row, most)
    rays = _MOST_RAYS / len(truths) / max(_pixels_in_bounds(mission, truths[0]), 1.0)
    return [cast_target(mission, truth, number, math.isqrt(int(rays))) for truth in truths]


def _pixels_in_bounds(mission: Mission, truth: Truth) -> float:
    """Return how many pixels the bounds of all targets take of the field, at most."""
    receiver = mission.instrument.at(truth.time_s).receiver
    seen = scene.extent(mission.surfaces, truth)
    edge = receiver.field_edge
    sides = np.clip(seen.high, -edge, edge) - np.clip(seen.low, -edge, edge)
    return float(np.prod(np.maximum(sides, 0.0) / receiver.pixel_tangent, axis=1).sum())
