"""Targets for tests: shapes whose signal has a closed form."""

from __future__ import annotations

import numpy as np

from models.build.primitives import ball, box
from rso_lidar import units
from rso_lidar.records import Symmetry, Taxonomy
from rso_lidar.shapes import CraftModel, CraftPart

PLATE_SIDE_M = 4.0
PLATE_THICKNESS_M = 0.002
SPHERE_RADIUS_M = 1.0
SPHERE_SPLITS = 5


def plate() -> CraftModel:
    """Return a square plate, 4 m by 4 m, that faces +x; its faces lie at x = +1 mm and -1 mm."""
    solid = box((PLATE_THICKNESS_M, PLATE_SIDE_M, PLATE_SIDE_M))
    return CraftModel(
        name="plate",
        symmetry=Symmetry(axis=(1.0, 0.0, 0.0), fold=4, half_turn=(0.0, 1.0, 0.0)),
        what="Flat square plate, 4 m by 4 m and 2 mm thick, normal along +x: front face at x = 0.001 m",
        source="A definition",
        confidence="Exact by definition; mass is that of aluminium (2700 kg/m3)",
        axes="+x normal of the front face; y and z along the sides; origin at the middle",
        pieces={"plate": CraftPart(solid, "lambertian_30", 2700.0 * solid.volume_m3())},
        taxonomy=Taxonomy(
            object_class="calibration",
            subclass="flat_plate",
            shape_family="plate",
            size_class="medium",
            stabilisation="fixed",
        ),
    )


def sphere() -> CraftModel:
    """Return a calibration sphere: all vertices at 1 m from the origin, facets slightly inside."""
    solid = ball(SPHERE_RADIUS_M, splits=SPHERE_SPLITS)
    nearest_m = float(np.linalg.norm(solid.vertices[solid.facets].mean(axis=1), axis=1).min())
    sag_mm = (SPHERE_RADIUS_M - nearest_m) / units.MM
    return CraftModel(
        name="sphere",
        symmetry=Symmetry(is_sphere=True),
        what=f"Calibration sphere, vertices at a radius of exactly 1 m; facets lie up to {sag_mm:.2f} mm inside",
        source="A definition",
        confidence="Exact by definition but for the facets; mass is that of a 2 mm aluminium shell (2700 kg/m3)",
        axes="any; origin at the centre",
        pieces={
            "sphere": CraftPart(solid, "lambertian_30", 2700.0 * 0.002 * 4.0 * np.pi * SPHERE_RADIUS_M**2, hollow=True)
        },
        taxonomy=Taxonomy(
            object_class="calibration",
            subclass="sphere",
            shape_family="sphere",
            size_class="medium",
            stabilisation="fixed",
        ),
    )
