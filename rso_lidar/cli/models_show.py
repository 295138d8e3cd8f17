"""`rso-lidar models show`: one model in words and as a picture."""

from pathlib import Path
from typing import Annotated, Any

import typer
from rich.table import Table

from rso_lidar.cli.arguments import Dark, Overwrite, choose_scheme
from rso_lidar.cli.console import make_console
from rso_lidar.cli.terminal import echo
from rso_lidar.errors import MeshError, RsoLidarError
from rso_lidar.files import check_writable
from rso_lidar.mission_analysis import ModelCard, make_model_card
from rso_lidar.picture import FIGURE_SUFFIXES
from rso_lidar.scenario import FacetParts
from rso_lidar.scene import models, own_models

_PIPE_WIDTH = 40  # columns of characters of the narrowest terminal that is served
_GAP = 2  # spaces between columns


def list_own_models() -> list[str]:
    """Return the names of the models of the user's library; none where it cannot be read."""
    try:
        return sorted(own_models())
    except (RsoLidarError, OSError):  # commands report a damaged library
        return []


FacetPartsFile = Annotated[
    Path | None,
    typer.Option("--facet-parts", metavar="TABLE", help="Parts of facets: a .csv (facet, part) or a .npy."),
]
ByMaterial = Annotated[bool, typer.Option("--by-material", help="Each material of the file is a part.")]


def read_facet_parts(table: Path | None, by_material: bool) -> FacetParts | None:
    """Return what two options say about the parts of facets; raise `MeshError` where both are given."""
    if table is not None and by_material:
        raise MeshError("--facet-parts and --by-material: both make the parts; give one")
    if by_material:
        return FacetParts(by="material")
    return None if table is None else FacetParts(file=str(table))


def show(
    name: Annotated[
        str,
        typer.Argument(
            metavar="NAME",
            help="A model of the catalogue or of your own library, or the path of a mesh.",
            autocompletion=lambda: sorted({*models(), *list_own_models()}),
        ),
    ],
    output: Annotated[
        Path | None,
        typer.Option("-o", "--output", help="Picture of four sides by part, class, material (.png, .pdf, .svg)."),
    ] = None,
    facet_parts: FacetPartsFile = None,
    by_material: ByMaterial = False,
    dark: Dark = False,
    overwrite: Overwrite = False,
) -> None:
    """Describe a model: its size, its parts, and the light it returns from 1 km; draw it from four sides."""
    if output is not None:
        output = check_writable(output, FIGURE_SUFFIXES, overwrite=overwrite)
    scheme = choose_scheme(dark, [output])
    card = make_model_card(name, facet_parts=read_facet_parts(facet_parts, by_material))
    drawn = card.save(output, scheme) if output is not None else None  # before a reader of the text may go away
    console = make_console()
    for line in (card.what, *card.lines):
        console.print(line)
    console.print()
    wide = make_console(_PIPE_WIDTH)  # files and pipes get whole lines
    wide.print(_tabulate_light(card))
    console.print()
    wide.print(_tabulate_classes(card))
    console.print(card.describe_unassigned(), soft_wrap=True)
    console.print()
    wide.print(_tabulate_parts(card, wide.width))
    console.print("\nBody axes, from the centre of mass.")
    console.print(_describe_joint(name, card), soft_wrap=True)
    if drawn is not None:
        echo(str(drawn))


def _describe_joint(name: str, card: ModelCard) -> str:
    """Describe how a scenario rotates a part: with a hinge of the model, or with one of its own."""
    known = models().get(name) or own_models().get(name)
    if known is None or not known.hinges:
        return (
            f'A part that turns: joint = [{{ name = "hinge", parts = ["{card.parts[0].name}"], axis = [0, 1, 0], '
            'position_m = [0, 0, 0], angle = { type = "fixed", angle_deg = 30 } }]'
        )
    hinge = known.hinges[0]
    angle_deg = min(30.0, hinge.travel_deg[1]) or hinge.travel_deg[0]
    return f'A hinge: joint = [{{ name = "{hinge.name}", angle = {{ type = "fixed", angle_deg = {angle_deg:g} }} }}]'


def _tabulate_classes(card: ModelCard) -> Table:
    """Return the common class, the facets, the area and its share of each part of a model."""
    whole_m2 = sum(part.area_m2 for part in card.parts)
    table = Table(box=None, header_style="bold", padding=(0, _GAP, 0, 0), pad_edge=False)
    for head in ("part", "class", "facets", "area, m2", "share"):
        table.add_column(head, no_wrap=True, justify="left" if head in ("part", "class") else "right")
    for part in card.parts:
        cells = f"{part.facets:,}", f"{part.area_m2:.4g}", f"{part.area_m2 / whole_m2:.1%}"
        table.add_row(part.name, part.part_class, *cells)
    return table


def _tabulate_parts(card: ModelCard, width: int) -> Table:
    """Return the parts of a model with material and bounds, in a narrow terminal to a centimetre, with less air."""
    rows = [_list_cells(part, "{:.3f} to {:.3f}") for part in card.parts]
    heads = ["part", "material", "x, m", "y, m", "z, m"]
    if sum(max(map(len, column)) + _GAP for column in zip(heads, *rows, strict=True)) > width:
        heads = ["part / material", "x, m", "y, m", "z, m"]
        rows = []
        for part in card.parts:
            name, material, *spans = _list_cells(part, "{:.2f} {:.2f}")
            rows.append([f"{name}\n  {material}", *spans])
    table = Table(box=None, header_style="bold", padding=(0, _GAP, 0, 0), pad_edge=False)
    for head in heads:
        table.add_column(head, no_wrap=True)
    for row in rows:
        table.add_row(*row)
    return table


def _list_cells(part: Any, span: str) -> list[str]:
    """Return name, material and the bounds along x, y and z of a part."""
    spans = zip(part.low_m, part.high_m, strict=True)
    return [part.name, part.material, *(span.format(low, high) for low, high in spans)]


def _tabulate_light(card: ModelCard) -> Table:
    """Tabulate the photons that each side returns, in total and in the brightest pixel; heads fold, numbers do not."""
    heads, *rows = card.light_table()
    table = Table(box=None, header_style="bold", padding=(0, _GAP, 0, 0), pad_edge=False)
    for head, *cells in zip(heads, *rows, strict=True):
        first = head == heads[0]
        table.add_column(head, justify="left" if first else "right", min_width=max(map(len, cells)))
    for row in rows:
        table.add_row(*row)
    return table
