"""Colours of targets on screen: those of the catalogue's materials, part by part."""

from __future__ import annotations

import numpy as np

from rso_lidar.picture import palette
from rso_lidar.scenario import Target, name_part_materials
from rso_lidar.scene import Mesh, load_materials, model


def find_part_colours(target: Target, mesh: Mesh) -> np.ndarray:
    """Return the colour of each part of a target (part, rgb) u1.

    A part has the colour of its material in the catalogue. Where the scenario gives it a BRDF without a name, a shipped
    model keeps the colours of its own materials, which tell its parts apart; other parts are grey.
    """
    named = name_part_materials(target, mesh)
    if not target.is_path and target.fragment is None and target.terrain is None and target.library is None:
        named = {**model(target.shape).parts, **named}
    known, grey = load_materials(), palette.split_rgb(palette.OTHER_PART)
    colours = [known.get(named.get(part, ""), {}).get("display_rgb") for part in mesh.part_names]
    return np.array([grey if rgb is None else np.multiply(rgb, 255) for rgb in colours]).round().astype(np.uint8)
