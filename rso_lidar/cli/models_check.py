"""`rso-lidar models check`: examination of a mesh before it is used."""

from typing import Annotated

import typer

from rso_lidar.cli.models_add import MeshFile
from rso_lidar.cli.terminal import echo
from rso_lidar.scene import examine_file


def check(
    path: MeshFile,
    scale: Annotated[float | None, typer.Option("--scale", help="Metres in one unit of the file.")] = None,
) -> None:
    """Examine a mesh: units, holes, winding, strays, hidden parts, and repairs made on loading.

    PATH may also be the name of a model. Nothing is changed; any mesh that can be loaded can be simulated.
    """
    lines = examine_file(path, scale).lines()
    echo(f"{path}")
    for line in lines:
        echo(line)
