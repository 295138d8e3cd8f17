"""Sizes that a mesh has in each unit that its file may be in, and the targets that can take it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from rso_lidar.errors import ScenarioError
from rso_lidar.scene import Mesh, is_mesh_path, list_units, load_mesh
from rso_lidar.studio.model.root_folder import Folder
from rso_lidar.studio.model.text_assessment import check_file
from rso_lidar.units import format_count


def list_mesh_sizes(name: str, folder: Folder) -> list[tuple[str, str, float]]:
    """List the units that a mesh file may be in, the likely one first: name, sides of the mesh in words, and metres.

    Raises
    ------
    RsoLidarError
        If it is a model of the catalogue, lies outside the folder, or cannot be read.
    """
    if not is_mesh_path(name):
        raise ScenarioError(
            f"model: '{name:.80}' is no mesh file: models of the catalogue are in metres; scale stays 1"
        )
    mesh = load_mesh(check_file(name, folder, "model"))
    return [
        (unit.name, _format_sides(mesh, unit.metres) + " (likely)" * unit.is_likely, unit.metres)
        for unit in list_units(mesh)
    ]


def list_mesh_targets(tables: Mapping[str, Any], name: str) -> dict[str, str]:
    """Return the names of a scenario's targets by their places, first those that have a mesh."""
    entries = tables.get("target")
    entries = entries if isinstance(entries, list) else []
    targets = {f"target[{k}]": entry for k, entry in enumerate(entries) if isinstance(entry, Mapping)}
    ordered = sorted(targets, key=lambda place: targets[place].get("model") != name)
    return {place: str(targets[place].get("name", place)) for place in ordered}


def summarize_mesh(mesh: Mesh) -> str:
    """Return facets, parts and size of a mesh, in metres as a scenario takes it, and in a more likely unit."""
    unit = list_units(mesh)[0]
    guess = f"; {_format_sides(mesh, unit.metres)} if in {unit.name}" * (unit.is_likely and unit.metres != 1.0)
    counts = f"{format_count(len(mesh.facets), 'facet')}, {format_count(len(mesh.part_names), 'part')}"
    return f"{counts}, {_format_sides(mesh, 1.0)} as it stands{guess}"


def _format_sides(mesh: Mesh, metres: float) -> str:
    """Format the sides of a mesh whose unit has this many metres."""
    sides = mesh.size_m * metres
    return " × ".join(f"{side:,.4g}" if side < 1e4 else f"{side:,.0f}" for side in sides) + " m"
