"""Ground as a target: heights from a file, or generated from a random seed."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from functools import lru_cache
from pathlib import Path
from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from rso_lidar.part import Fraction, Number, Part, Positive, Text, Whole
from rso_lidar.records import Taxonomy
from rso_lidar.scene import MOST_HEIGHT_CELLS, Mesh, build_height_field, load_height_field

_LARGEST_CRATER = 0.25  # default over the side
_SMALLEST_CRATER = 4.0  # cells


class HeightField(Part):
    """Ground as a file of heights: a .npy, a .npz of one array, or a grey .png of 8 or 16 bits.

    Rows run from north to south and columns from west to east, `cell_m` apart, about the body's origin: x east, y north,
    z up. Where a value is NaN there is no ground. The part's name is `ground`.
    """

    type: Literal["height_field"] = "height_field"
    file: Text = Field(
        description=(
            "Path of a .npy file, a .npz file of one array, or a grey .png file of 8 or 16 bits. Row 0 is the north, "
            "column 0 the west."
        )
    )
    cell_m: Positive = Field(description="Distance between heights along rows and columns [m].")
    height_scale_m: Number = Field(default=1.0, description="Height of a value of 1 in the file [m].")


class CratersAndBoulders(Part):
    """Ground generated from a random seed: a square about the body's origin with the parts `ground` and `boulders`.

    Axes are x east, y north, z up. The density of craters is `crater_fraction` of equilibrium, N(> D) = 0.079 D^-2 per
    square metre (Trask 1966, Gault 1970). Each crater is a paraboloid. A fresh one has a depth of 0.196 D from crest to
    floor and a rim of 0.036 D (Pike 1977); erosion reduces both by a random factor. Rocks of all sizes cover
    `rock_fraction` of the ground (Golombek and Rapp 1997). Those from `boulder_min_m` to `boulder_max_m` are half
    ellipsoids.
    """

    type: Literal["craters_and_boulders"] = "craters_and_boulders"
    seed: Annotated[Whole, Field(ge=0, lt=2**63)] = Field(
        default=0, description="Random seed of the terrain; another seed gives another place of the same kind."
    )
    size_m: Positive = Field(description="Side of the square [m].")
    cell_m: Positive = Field(
        description="Distance between heights [m]; features smaller than a few cells are not modelled."
    )
    crater_fraction: Fraction = Field(
        default=1.0, description="Density of craters, as a share of the equilibrium on old surfaces."
    )
    crater_min_m: Positive | None = Field(
        default=None, description="Smallest diameter of a crater [m]. If omitted, four cells."
    )
    crater_max_m: Positive | None = Field(
        default=None, description="Greatest diameter of a crater [m]. If omitted, a quarter of the side."
    )
    rock_fraction: Annotated[Fraction, Field(lt=1)] = Field(
        default=0.05, description="Share of the ground covered by rocks of all sizes; 0 gives no boulders."
    )
    boulder_min_m: Positive = Field(
        default=0.5, description="Smallest diameter of a rock that is modelled as a body [m]."
    )
    boulder_max_m: Positive = Field(default=5.0, description="Greatest diameter of a rock [m].")

    @model_validator(mode="after")
    def _in_order(self) -> Self:
        cells = self.size_m / self.cell_m
        if not 1.0 <= cells <= MOST_HEIGHT_CELLS**0.5:
            raise ValueError(
                f"size_m / cell_m is {cells:.4g} cells along a side, and 1 to {int(MOST_HEIGHT_CELLS**0.5):,} can be; "
                "change one"
            )
        smallest_m, largest_m = self.craters_m
        if not smallest_m < largest_m:
            raise ValueError(f"crater_min_m {smallest_m:g} is not below crater_max_m {largest_m:g}; change one of them")
        if not self.boulder_min_m < self.boulder_max_m:
            raise ValueError(
                f"boulder_min_m {self.boulder_min_m:g} is not below boulder_max_m {self.boulder_max_m:g}; change one of them"
            )
        return self

    @property
    def craters_m(self) -> tuple[float, float]:
        """Least and greatest diameter of a crater [m]: four cells, and a quarter of the side, by default."""
        largest_m = self.crater_max_m or _LARGEST_CRATER * self.size_m
        return self.crater_min_m or min(_SMALLEST_CRATER * self.cell_m, 0.5 * largest_m), largest_m


Terrain = Annotated[HeightField | CratersAndBoulders, Field(discriminator="type")]


def build_terrain_mesh(terrain: HeightField | CratersAndBoulders, file: Callable[[str], Path]) -> Mesh:
    """Build the mesh of the ground; `file` finds the file that it names."""
    if isinstance(terrain, HeightField):
        return load_height_field(file(terrain.file), terrain.cell_m, terrain.height_scale_m)
    return _build_made_ground(terrain)


@lru_cache(maxsize=8)
def _build_made_ground(terrain: CratersAndBoulders) -> Mesh:
    from rso_lidar.shapes import Abundance, build_ground

    craters = Abundance(*terrain.craters_m, terrain.crater_fraction)
    rocks = Abundance(terrain.boulder_min_m, terrain.boulder_max_m, terrain.rock_fraction)
    ground = build_ground(terrain.seed, terrain.size_m, terrain.cell_m, craters, rocks)
    digest = hashlib.sha256(ground.heights_m.tobytes())
    if ground.boulders is not None:
        digest.update(ground.boulders.vertices.tobytes())
    return build_height_field(
        ground.heights_m, terrain.cell_m, Path(name_terrain(terrain)), digest.hexdigest(), ground.boulders
    )


def name_terrain(terrain: HeightField | CratersAndBoulders) -> str:
    """Return the name of the ground in place of a model's: its file, or its kind and random seed."""
    return terrain.file if isinstance(terrain, HeightField) else f"{terrain.type} {terrain.seed}"


def classify_terrain(terrain: HeightField | CratersAndBoulders) -> Taxonomy:
    """Return the taxonomy of ground."""
    return Taxonomy(
        object_class="terrain",
        subclass=terrain.type,
        shape_family="irregular",
        size_class="large",
        stabilisation="fixed",
    )
