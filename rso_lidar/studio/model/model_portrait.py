"""Pictures of models for the gallery and of the examples' targets: an oblique view in the materials' colours."""

from __future__ import annotations

import io
from functools import lru_cache

import numpy as np

from rso_lidar.errors import suppress_warnings
from rso_lidar.motion import Fixed
from rso_lidar.scenario import SHORTEST_EXAMPLE, Scenario, Target, build_whole_surface, find_examples
from rso_lidar.scene import render_portrait
from rso_lidar.shipped import shipped
from rso_lidar.studio.model.target_colours import find_part_colours

_TOWARD, _UP = (1.0, 0.8, 0.7), (0.0, 0.0, 1.0)
_CELLS, _FINER = 220, 2  # pixels along a side, and rays along the side of a pixel


@lru_cache(maxsize=128)
def draw_portrait(name: str) -> bytes:
    """Draw a model of the catalogue as PNG with a transparent sky."""
    return _draw_target(Target(name="model", model=name, motion=Fixed(position_m=(0.0, 0.0, 0.0))))


@lru_cache(maxsize=128)
def draw_example_portrait(name: str) -> bytes | None:
    """Draw the first target of an example, or of the shortest scenario under another name; None without a target."""
    example = find_examples().get(name)
    with suppress_warnings():
        scenario = Scenario.load(example.path) if example else Scenario.loads(SHORTEST_EXAMPLE)
        return _draw_target(scenario.target[0]) if scenario.target else None


def _draw_target(target: Target) -> bytes:
    """Draw a target in its body axes as PNG with a transparent sky."""
    from PIL import Image

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
