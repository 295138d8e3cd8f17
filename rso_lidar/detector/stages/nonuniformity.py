"""The pixels of one camera: what differs from pixel to pixel and stays the same in every flash."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace

import numpy as np

from rso_lidar import units
from rso_lidar.detector.settings.apd import Apd
from rso_lidar.detector.settings.focal_plane import Defects, Maps
from rso_lidar.detector.stages.pixel_maps import read_pixel_maps


@dataclass(frozen=True, eq=False)
class CameraPixels:
    """One camera's pixels (n_pixels): drawn once from its seed or measured, the same in every flash and every run."""

    threshold: np.ndarray  # factor
    gain: np.ndarray  # factor
    offset_counts: np.ndarray
    t0_s: np.ndarray
    dead: np.ndarray  # bool
    hot: np.ndarray  # bool
    dark_per_s: np.ndarray  # dark current [primary electrons/s]

    def select(self, pixel: np.ndarray) -> CameraPixels:
        """Return some of the pixels, or the same ones several times."""
        return CameraPixels(*(getattr(self, field.name)[pixel] for field in fields(self)))


def draw_pixels(
    n_pixels: int, seed: int, apd: Apd, threshold_spread: float, maps: Maps | None, defects: Defects | None
) -> CameraPixels:
    """Draw the pixels of a camera, or take what was measured of them.

    Each map is drawn separately, so that one setting does not change the others.

    Parameters
    ----------
    threshold_spread : 1 sigma over the nominal threshold
    maps, defects : fixed patterns, and dead and hot pixels; None without
    """
    drawn = [np.random.Generator(np.random.Philox(np.random.SeedSequence(seed, spawn_key=(k,)))) for k in range(5)]
    threshold, gain, offset, t0 = (rng.standard_normal(n_pixels) for rng in drawn[:4])
    chance = drawn[4].random(n_pixels)
    none = np.zeros(n_pixels)
    measured = None if maps is None or maps.file is None else read_pixel_maps(maps.file)
    if measured is not None:  # nothing assumed is mixed with what was measured
        maps = defects = None
    dead = defects.dead_fraction if defects else 0.0
    hot = defects.hot_fraction if defects else 0.0
    is_hot = (chance >= dead) & (chance < dead + hot)
    dark_per_s = np.full(n_pixels, apd.dark_electrons_per_s)
    if defects is not None:
        dark_per_s[is_hot] = defects.hot_dark_current_na * units.NA / units.ELEMENTARY_CHARGE_C
    pixels = CameraPixels(
        threshold=np.maximum(1.0 + threshold_spread * threshold, 0.2),
        gain=np.maximum(1.0 + maps.gain_spread_fraction * gain, 0.2) if maps else none + 1.0,
        offset_counts=maps.offset_spread_counts * offset if maps else none,
        t0_s=maps.t0_spread_ns * units.NS * t0 if maps else none,
        dead=chance < dead,
        hot=is_hot,
        dark_per_s=dark_per_s,
    )
    return pixels if measured is None else replace(pixels, **measured.replace_drawn(n_pixels))
