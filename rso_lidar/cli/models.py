"""`rso-lidar models`: what can be flown past."""

from typing import Annotated

import typer
from rich.console import Console
from rich.table import Table

from rso_lidar.scene import load_mesh
from rso_lidar.scene.library import model
from rso_lidar.scene.library import models as catalogue

_WIDE = 100  # columns that bounds to the millimetre need


def models(
    name: Annotated[
        str | None, typer.Argument(metavar="NAME", help="Tell the parts of one model, and where they are.")
    ] = None,
) -> None:
    """List the models that ship with rso_lidar, or the parts of one."""
    console = Console()
    if name is not None:
        Console(width=max(console.width, _WIDE)).print(_parts(name))
        console.print(
            f'\nBody axes, from the centre of mass. A joint: parts = ["{next(iter(model(name).parts))}"].', markup=False
        )
        return
    table = Table("name", "size, m", "facets", "parts", "what", box=None, header_style="bold")
    for key, entry in catalogue().items():
        size = " x ".join(f"{side:.4g}" for side in entry.size_m)
        table.add_row(key, size, f"{entry.facets:,}", str(len(entry.parts)), entry.what)
    console.print(table)
    console.print(
        '\nIn a scenario: model = "tdrs". A path with a suffix or a slash reads a mesh of your own.', markup=False
    )


def _parts(name: str) -> Table:
    """Return the parts of a model with material and bounds."""
    entry = model(name)
    mesh = load_mesh(entry.path)
    table = Table(box=None, header_style="bold")
    for title in ("part", "material", "x, m", "y, m", "z, m"):
        table.add_column(title, no_wrap=True)
    for number, part in enumerate(mesh.part_names):
        points = mesh.vertices[mesh.facets[mesh.part == number]].reshape(-1, 3) - entry.center_of_mass_m
        bounds = [f"{low:.3f} to {high:.3f}" for low, high in zip(points.min(axis=0), points.max(axis=0), strict=True)]
        table.add_row(part, entry.parts.get(part, ""), *bounds)
    return table
