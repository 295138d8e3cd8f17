"""Materials of single facets, given by colours of the mesh's file or by a file of their own."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
from pydantic import Field

from rso_lidar.errors import ScenarioError, add_place, did_you_mean
from rso_lidar.part import Part, Text
from rso_lidar.scene import (
    AnyMaterial,
    Material,
    Named,
    Surface,
    complete,
    load_materials,
    read_facet_colours,
    read_facet_words,
)


class FacetMaterials(Part):
    """Which facet is of what material: overrides the materials of mesh and parts for the facets that `file` lists.

    Facets have the numbers that they have in the mesh's file, from 0, counted over its parts in order: the label `facet`.
    A .csv has the columns facet and material, where a facet is a number or a span such as 10-19. A .npy holds an integer
    for each facet, -1 for none of these. `materials` says what the words, or the integers, mean; names of the catalogue need
    no entry.
    """

    file: Text = Field(
        description="Path of a .csv file (facet, material), or of a .npy file with one integer for each facet."
    )
    materials: dict[Text, AnyMaterial] = Field(
        default_factory=dict,
        description="Material for each word or integer of the file; names of the catalogue need no entry.",
    )


def apply_color_materials(surface: Surface, color_materials: Mapping[str, Material], wavelength_m: float) -> Surface:
    """Assign materials to the facets of some colours.

    Parameters
    ----------
    color_materials : material by colour, such as ``#c0c0c0``
    wavelength_m : of the laser [m]
    """
    with add_place("color_materials"):
        colour = read_facet_colours(surface.mesh)[surface.mesh.source_facet]
        of_colour = {word.lower(): material for word, material in color_materials.items()}
        there = sorted(set(colour))
        for word in of_colour:
            if word not in there:
                some = ", ".join(there[:8]) + (", ..." if len(there) > 8 else "")
                raise ScenarioError(f"no facet of {surface.mesh.path.name} has the colour '{word}' (there are {some})")
        return _assign_materials(surface, colour, of_colour, wavelength_m)


def apply_facet_materials(
    surface: Surface, facet_materials: FacetMaterials, file: Callable[[str], Path], wavelength_m: float
) -> Surface:
    """Assign materials to single facets."""
    with add_place("facet_materials"):
        path = file(facet_materials.file)
        words = read_facet_words(path, surface.mesh.source_facets, "material")[surface.mesh.source_facet]
        meant = {word: _find_material(word, facet_materials, path) for word in sorted(set(words) - {""})}
        return _assign_materials(surface, words, meant, wavelength_m)


def _assign_materials(
    surface: Surface, words: np.ndarray, meant: Mapping[str, Material], wavelength_m: float
) -> Surface:
    """Assign to each facet the material of its word (facet); facets with another word keep theirs."""
    number, materials = surface.finish.astype(np.int64), list(surface.materials)
    for word, material in meant.items():
        materials.append(complete(material).at(wavelength_m))
        number[words == word] = len(materials) - 1
    return replace(surface, materials=tuple(materials), material_of=number)


def _find_material(word: str, facet_materials: FacetMaterials, path: Path) -> Material:
    """Find a material by its name."""
    if word in facet_materials.materials:
        return facet_materials.materials[word]
    known = [*facet_materials.materials, *load_materials()]
    if word not in known:
        cure = f"{did_you_mean(word, known) or ';'} define it in facet_materials.materials"
        raise ScenarioError(f"{path.name}: no material '{word}'{cure}")
    return Named(name=word)
