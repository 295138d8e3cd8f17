"""Pictures of the shipped models for the gallery: an oblique view, shaded by the colours of the materials."""

from __future__ import annotations

import io
from functools import lru_cache

import numpy as np

from rso_lidar.motion import Fixed
from rso_lidar.scenario import Target, build_whole_surface
from rso_lidar.scene import load_materials, model, render_portrait
from rso_lidar.shipped import shipped

_TOWARD, _UP = (1.0, 0.8, 0.7), (0.0, 0.0, 1.0)
_CELLS, _FINER = 220, 2  # pixels along a side, and rays along the side of a pixel
_GREY = np.array([158.0, 158.0, 158.0])


@lru_cache(maxsize=128)
def draw_portrait(name: str) -> bytes:
    """Draw a model of the catalogue as PNG with a transparent sky."""
    from PIL import Image

    target = Target(name="model", model=name, motion=Fixed(position_m=(0.0, 0.0, 0.0)))
    surface = build_whole_surface(target, shipped, 1064e-9)
    seen = render_portrait(surface, _TOWARD, _UP, cells=_CELLS * _FINER)
    of_part, known = model(name).parts, load_materials()
    rgb = np.array([_find_colour(known.get(of_part.get(part, ""), {})) for part in surface.mesh.part_names])
    part = surface.part[np.maximum(seen.facet, 0)]
    image = np.zeros((*seen.facet.shape, 4))
    image[..., :3] = rgb[part] * (0.25 + 0.75 * np.abs(seen.cosine))[..., None]
    image[..., 3] = 255.0 * seen.covered
    image[~seen.covered] = 0.0
    with io.BytesIO() as held:
        small = Image.fromarray(np.clip(image, 0, 255).astype(np.uint8)).resize((_CELLS, _CELLS), Image.Resampling.BOX)
        small.save(held, "PNG")
        return held.getvalue()


def _find_colour(material: dict[str, object]) -> np.ndarray:
    """Return the colour of a material in pictures, from 0 to 255."""
    colour = material.get("display_rgb")
    return 255.0 * np.array(colour, dtype=float) if isinstance(colour, list | tuple) else _GREY
