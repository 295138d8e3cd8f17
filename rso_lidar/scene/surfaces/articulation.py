"""Articulated targets: one surface for the fixed parts, and one for the parts on each hinge."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from rso_lidar.errors import ScenarioError, did_you_mean
from rso_lidar.scene.surfaces.surface import Surface


@dataclass(frozen=True)
class Hinged:
    """The parts on one hinge: `axes` is the name of its axes, `position_m` (xyz) their origin in body axes."""

    axes: str
    parts: tuple[str, ...]
    position_m: tuple[float, float, float]


def split_at_hinges(surface: Surface, hinged: Sequence[Hinged]) -> tuple[Surface, ...]:
    """Split a surface into the fixed parts in body axes, and the parts on each hinge in its axes.

    All keep the numbers of parts, facets and materials of the whole, and the number of the target.

    Parameters
    ----------
    surface : the whole surface, in body axes
    hinged : the hinges, each with the names of its parts

    Returns
    -------
    the fixed parts first, then the parts of each hinge in the axes of the hinge.

    Raises
    ------
    ScenarioError
        If a part is unknown or on two hinges, or if none is left for the body.
    """
    if not hinged:
        return (surface,)
    names = surface.mesh.part_names
    carried = np.full(len(names), -1)
    for number, hinge in enumerate(hinged):
        for part in hinge.parts:
            if part not in names:
                guess = did_you_mean(part, names)
                raise ScenarioError(
                    f"joint {hinge.axes}: no part '{part}' in {surface.mesh.path.name}{guess} ({', '.join(names)})"
                )
            at = names.index(part)
            if carried[at] >= 0:
                raise ScenarioError(
                    f"joint {hinge.axes}: part '{part}' is on {hinged[carried[at]].axes} already; leave it out of one"
                )
            carried[at] = number
    of_facet = carried[surface.part]
    if np.all(of_facet >= 0):
        raise ScenarioError(f"joint {hinged[0].axes}: all parts are on hinges; leave one out of the joints")
    return (
        _select_facets(surface, of_facet < 0, surface.name, np.zeros(3)),
        *(
            _select_facets(surface, of_facet == number, hinge.axes, np.array(hinge.position_m))
            for number, hinge in enumerate(hinged)
        ),
    )


def _select_facets(surface: Surface, which: np.ndarray, name: str, origin_m: np.ndarray) -> Surface:
    """Select some facets of a surface.

    Parameters
    ----------
    which : (facet) bool, the facets to keep
    name : name of the new axes
    origin_m : (xyz), their origin in the surface's axes [m]
    """
    mesh = surface.mesh
    fewer = replace(mesh, facets=mesh.facets[which], part=mesh.part[which], source_facet=mesh.source_facet[which])
    material_of = None if surface.material_of is None else surface.material_of[which]
    return replace(surface, name=name, mesh=fewer, vertices=surface.vertices - origin_m, material_of=material_of)
