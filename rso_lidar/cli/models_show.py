"""`rso-lidar models show`: one model of the catalogue, or of the user's own library."""

from typing import Annotated

import typer
from rich.console import Console
from rich.table import Table

from rso_lidar.scene.library import model

_WIDE = 100  # columns that bounds to the millimetre need


def show(
    name: Annotated[str, typer.Argument(metavar="NAME", help="A model of the catalogue, or of your own library.")],
) -> None:
    """Tell the parts of a model, and where they are."""
    console = Console()
    Console(width=max(console.width, _WIDE)).print(_parts(name))
    console.print(
        f'\nBody axes, from the centre of mass. A joint: parts = ["{next(iter(model(name).parts))}"].', markup=False
    )


def _parts(name: str) -> Table:
    """Return the parts of a model with material and bounds."""
    entry = model(name)
    mesh = entry.mesh
    table = Table(box=None, header_style="bold")
    for title in ("part", "material", "x, m", "y, m", "z, m"):
        table.add_column(title, no_wrap=True)
    for number, part in enumerate(mesh.part_names):
        points = mesh.vertices[mesh.facets[mesh.part == number]].reshape(-1, 3) - entry.center_of_mass_m
        bounds = [f"{low:.3f} to {high:.3f}" for low, high in zip(points.min(axis=0), points.max(axis=0), strict=True)]
        table.add_row(part, entry.parts.get(part, ""), *bounds)
    return table
