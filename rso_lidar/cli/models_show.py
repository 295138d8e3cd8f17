"""`rso-lidar models show`: one model in words and as a picture."""

from pathlib import Path
from typing import Annotated

import typer
from rich.table import Table

from rso_lidar.cli.arguments import Dark, Overwrite, choose_scheme
from rso_lidar.cli.console import make_console
from rso_lidar.cli.terminal import echo
from rso_lidar.errors import RsoLidarError
from rso_lidar.files import check_writable
from rso_lidar.mission_analysis import ModelCard, make_model_card
from rso_lidar.picture import FIGURE_SUFFIXES
from rso_lidar.scene import models, own_models

WIDE = 112  # columns that the tables need: no number is cut off


def list_own_models() -> list[str]:
    """Return the names of the models of the user's library; none where it cannot be read."""
    try:
        return sorted(own_models())
    except (RsoLidarError, OSError):  # commands report a damaged library
        return []


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
        typer.Option("-o", "--output", help="Picture of four sides by part and by material (.png, .pdf, .svg)."),
    ] = None,
    dark: Dark = False,
    overwrite: Overwrite = False,
) -> None:
    """Describe a model: its size, its parts, and the light it returns from 1 km; draw it from four sides."""
    if output is not None:
        output = check_writable(output, FIGURE_SUFFIXES, overwrite=overwrite)
    scheme = choose_scheme(dark, [output])
    card = make_model_card(name)
    drawn = card.save(output, scheme) if output is not None else None  # before a reader of the text may go away
    console = make_console()
    for line in (card.what, *card.lines):
        console.print(line)
    console.print()
    make_console(WIDE).print(_tabulate_light(card))
    console.print()
    make_console(WIDE).print(_tabulate_parts(card))
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


def _tabulate_parts(card: ModelCard) -> Table:
    """Return the parts of a model with material and bounds."""
    table = Table(box=None, header_style="bold")
    for title in ("part", "material", "x, m", "y, m", "z, m"):
        table.add_column(title, no_wrap=True)
    for part in card.parts:
        spans = zip(part.low_m, part.high_m, strict=True)
        table.add_row(part.name, part.material, *(f"{low:.3f} to {high:.3f}" for low, high in spans))
    return table


def _tabulate_light(card: ModelCard) -> Table:
    """Tabulate the photons that each side returns, in total and in the brightest pixel."""
    heads, *rows = card.light_table()
    table = Table(box=None, header_style="bold")
    for column, head in enumerate(heads):
        table.add_column(head, no_wrap=column == 0, justify="right" if column else "left")
    for row in rows:
        table.add_row(*row)
    return table
