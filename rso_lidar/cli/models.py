"""`rso-lidar models`: what can be flown past."""

from typing import Annotated, get_args

import typer
from rich.console import Console
from rich.table import Table

from rso_lidar.craft import ObjectClass, SizeClass, Taxonomy
from rso_lidar.scene import load_mesh
from rso_lidar.scene.library import model
from rso_lidar.scene.library import models as catalogue

_WIDE = 112  # columns that the tables need


def models(
    name: Annotated[
        str | None, typer.Argument(metavar="NAME", help="Tell the parts of one model, and where they are.")
    ] = None,
) -> None:
    """List the models that ship with rso_lidar, or the parts of one."""
    console = Console()
    if name is not None:
        table = _parts(name)
        console.print(f"{model(name).what}.\n", markup=False)
        Console(width=max(console.width, _WIDE)).print(table)
        console.print(
            f'\nBody axes, from the centre of mass. A joint: parts = ["{next(iter(model(name).parts))}"].', markup=False
        )
        return
    table = Table(box=None, header_style="bold", expand=True)
    for title in ("name", "class", "size class", "size, m", "facets", "parts"):
        table.add_column(title, no_wrap=True)
    table.add_column("what", ratio=1, no_wrap=True, overflow="ellipsis")
    for key, entry in sorted(catalogue().items(), key=lambda item: _rank(item[1].taxonomy)):
        size = " x ".join(f"{side:.3g}" for side in entry.size_m)
        of = entry.taxonomy
        table.add_row(key, of.object_class, of.size_class, size, f"{entry.facets:,}", str(len(entry.parts)), entry.what)
    Console(width=max(console.width, _WIDE)).print(table)
    console.print(
        '\nIn a scenario: model = "tdrs". A path with a suffix or a slash reads a mesh of your own.', markup=False
    )


def _rank(taxonomy: Taxonomy) -> tuple[int, int]:
    """Return where a model stands in the list: by class, then by size class."""
    classes, sizes = get_args(ObjectClass), get_args(SizeClass)
    return classes.index(taxonomy.object_class), -sizes.index(taxonomy.size_class)


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
