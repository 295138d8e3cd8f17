"""`rso-lidar models check`: examination of a mesh before it is used."""

from pathlib import Path
from typing import Annotated

import typer

from rso_lidar.cli.models_add import MeshFile
from rso_lidar.cli.terminal import echo
from rso_lidar.errors import MeshError
from rso_lidar.scene import (
    Mesh,
    examine_mesh,
    is_cad,
    known_meshes,
    load_mesh,
    model,
    normalize_mesh,
    parse_mesh,
    tessellate,
)


def check(
    path: MeshFile,
    scale: Annotated[float | None, typer.Option("--scale", help="Metres in one unit of the file.")] = None,
) -> None:
    """Examine a mesh: units, holes, winding, strays, hidden parts, and repairs made on loading.

    PATH may also be the name of a model. Nothing is changed; any mesh that can be loaded can be simulated.
    """
    if scale is not None and not 0.0 < scale < float("inf"):
        raise MeshError(f"--scale {scale:g}: is not a scale; give a number over 0")
    mesh = _load_mesh(path)
    known = known_meshes().get(mesh.sha256) if path.exists() else None
    unit_m = scale or (1.0 / known["units_per_metre"] if known else 1.0)
    lines = examine_mesh(normalize_mesh(mesh, unit_m)).lines()
    echo(f"{path}")
    if known:
        echo(
            f"known       {known['file']} of NASA's printable models: one unit is {unit_m:.6g} m; `models add` corrects it"
        )
    for line in lines:
        echo(line)


def _load_mesh(path: Path) -> Mesh:
    """Load the mesh of a mesh file, of a CAD solid, or of a model by name."""
    if is_cad(path):
        blob, unit_m = tessellate(path)
        return normalize_mesh(parse_mesh(path, blob, ".glb"), unit_m)
    if path.suffix or path.exists() or len(path.parts) > 1:
        return load_mesh(path)
    return model(str(path)).mesh
