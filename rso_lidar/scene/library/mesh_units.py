"""Units of mesh files: known by the file's hash, stated by its format, or guessed from its size."""

from __future__ import annotations

import functools
from collections.abc import Mapping
from types import MappingProxyType
from typing import Any, NamedTuple

from rso_lidar.errors import MeshError
from rso_lidar.scene.library.model_index import read_table
from rso_lidar.scene.meshes.components import find_helper_cube
from rso_lidar.scene.meshes.mesh import UNITS_M, Mesh, guess_units, is_plausible_size
from rso_lidar.shipped import shipped

_METRIC = (".glb", ".gltf")  # by their standard


class MeshUnit(NamedTuple):
    """A unit that a mesh may be in: its name, its metres, and whether it is known or guessed to be the right one."""

    name: str
    metres: float
    is_likely: bool


@functools.cache
def known_meshes() -> Mapping[str, Mapping[str, Any]]:
    """Return what is known about NASA's printable files by SHA-256: name, units_per_metre, left_out, taxonomy."""
    entries = read_table(shipped("models") / "known_meshes.toml", "install the package again")["mesh"]
    return MappingProxyType({entry["sha256"]: MappingProxyType(entry) for entry in entries})


def guess_scale(mesh: Mesh) -> tuple[float, list[str]]:
    """Guess the metres in one unit of a mesh, and return them with a report of the guess.

    Raises
    ------
    MeshError
        If no unit makes it a spacecraft.
    """
    longest = float(mesh.size_m.max())
    if mesh.path.suffix.lower() in _METRIC and is_plausible_size(longest):
        return 1.0, [f"unit       metres, as glTF has it: {longest:.4g} m across"]
    fits = guess_units(longest)
    if not fits and not is_plausible_size(longest):
        raise MeshError(f"{mesh.path.name}: is {longest:.4g} units across; give --scale or --size-m")
    unit, metres = next(iter(fits.items()), ("metres", 1.0))
    others = "".join(f", or {other}" for other in list(fits)[1:])
    report = [f"guessed    unit is {unit}{others}: {longest * metres:.4g} m across; otherwise give --scale or --size-m"]
    if cube := find_helper_cube(mesh):
        report.append(
            f"guessed    a cube of {cube.size_m:.4g} units about the origin: if it is a helper cube of 1 m, "
            f"--scale {1.0 / cube.size_m:.6g}"
        )
    return metres, report


def list_units(mesh: Mesh) -> list[MeshUnit]:
    """List the units that a mesh may be in, first the one that is known or guessed, if any.

    Parameters
    ----------
    mesh : as it was read

    Returns
    -------
    list of MeshUnit
        Name, metres, and whether the unit is likely.
    """
    units = dict(UNITS_M)
    try:
        likely_m, _ = guess_scale(mesh)
    except MeshError:
        likely_m = 0.0
    if known := known_meshes().get(mesh.sha256):
        likely_m = 1.0 / float(known["units_per_metre"])
        units[f"unit of {known['file']} of NASA's printable models"] = likely_m
    if cube := find_helper_cube(mesh):
        units[f"helper cube of 1 m, which is {cube.size_m:.4g} units"] = 1.0 / cube.size_m
    listed = [MeshUnit(name, metres, metres == likely_m) for name, metres in units.items()]
    return sorted(listed, key=lambda unit: not unit.is_likely)
