"""Pictures of the shipped models for the gallery: an oblique view, shaded by the colours of the materials."""

from __future__ import annotations

import io
from functools import lru_cache

import numpy as np

from rso_lidar.motion import Fixed
from rso_lidar.scenario import Target, build_whole_surface
from rso_lidar.scene import render_portrait
from rso_lidar.shipped import shipped
from rso_lidar.studio.model.target_colours import find_part_colours

_TOWARD, _UP = (1.0, 0.8, 0.7), (0.0, 0.0, 1.0)
_CELLS, _FINER = 220, 2  # pixels along a side, and rays along the side of a pixel


@lru_cache(maxsize=128)
def draw_portrait(name: str) -> bytes:
    """Draw a model of the catalogue as PNG with a transparent sky."""
    from PIL import Image

    target = Target(name="model", model=name, motion=Fixed(position_m=(0.0, 0.0, 0.0)))
    surface = build_whole_surface(target, shipped, 1064e-9)
    seen = render_portrait(surface, _TOWARD, _UP, cells=_CELLS * _FINER)
    rgb = find_part_colours(target, surface.mesh)
    part = surface.part[np.maximum(seen.facet, 0)]
    image = np.zeros((*seen.facet.shape, 4))
    image[..., :3] = rgb[part] * (0.25 + 0.75 * np.abs(seen.cosine))[..., None]
    image[..., 3] = 255.0 * seen.covered
    image[~seen.covered] = 0.0
    with io.BytesIO() as held:
        small = Image.fromarray(np.clip(image, 0, 255).astype(np.uint8)).resize((_CELLS, _CELLS), Image.Resampling.BOX)
        small.save(held, "PNG")
        return held.getvalue()
