"""Fragments of a break-up as targets, generated from a random seed."""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path
from typing import Annotated, NamedTuple

import numpy as np
from pydantic import Field

from rso_lidar.part import Part, Positive, Whole
from rso_lidar.records import FRAGMENT_LENGTHS_M, FragmentKind, Taxonomy
from rso_lidar.scene import Mesh

PART = "fragment"  # name of the only part, and its common part class


class Fragment(Part):
    """A fragment of a break-up, generated from a random seed: a closed body with the only part `fragment`.

    Categories of shape are those of DebriSat (Liou et al. 2013). Body axes are x along the longest extent, y along the
    longest extent across it, and z across both; the origin is the centre of mass. The thickness of plates follows from an
    area-to-mass ratio that is drawn by the NASA Standard Breakup Model (Johnson et al. 2001). Proportions within a category,
    tears, bends and the choice of the material are assumed.
    """

    kind: FragmentKind = Field(
        description=(
            "Category of the shape. A plate is torn, and flat or bent and creased; a rod is straight or bent; a nugget is a "
            "lump with broken faces; a flexible piece is insulation."
        )
    )
    seed: Annotated[Whole, Field(ge=0, lt=2**63)] = Field(
        default=0, description="Random seed of the shape; another seed gives another fragment of the same kind."
    )
    characteristic_length_m: Annotated[Positive, Field(ge=FRAGMENT_LENGTHS_M[0], le=FRAGMENT_LENGTHS_M[1])] = Field(
        description="Mean of the three orthogonal extents [m], by which breakup models measure size."
    )


class BuiltFragment(NamedTuple):
    """A fragment as it was built: its mesh, its material's name in the catalogue, and its taxonomy."""

    mesh: Mesh
    materials: Mapping[str, str]
    taxonomy: Taxonomy


@lru_cache(maxsize=16)
def build_fragment(fragment: Fragment) -> BuiltFragment:
    """Build the mesh of a fragment, the same for the same part; the last few are kept.

    Parameters
    ----------
    fragment : kind, seed and size

    Returns
    -------
    BuiltFragment
        Mesh [m] with one part, the catalogue's name of its material, and its taxonomy.
    """
    from rso_lidar.shapes import breakup_fragment, hash_solid  # they take 0.2 s to import

    model = breakup_fragment(fragment.kind, fragment.seed, fragment.characteristic_length_m)
    solid = model.parts[PART]
    count = len(solid.facets)
    mesh = Mesh(
        path=Path(name_fragment(fragment)),
        sha256=hash_solid(solid),
        vertices=solid.vertices,
        facets=solid.facets,
        part=np.zeros(count, np.int16),
        part_names=(PART,),
        source_facet=np.arange(count, dtype=np.int32),
        source_facets=count,
        degenerate=0,
    )
    return BuiltFragment(mesh, model.materials, model.taxonomy)


def name_fragment(fragment: Fragment) -> str:
    """Return the name of a fragment in place of a model's: its kind and random seed."""
    return f"{name_fragments(fragment.kind)} {fragment.seed}"


def name_fragments(kind: str) -> str:
    """Return the name of all fragments of a kind, which stands in place of a model's.

    Parameters
    ----------
    kind : as in `Fragment`, such as ``plate``
    """
    return f"fragment {kind}"
