"""`rso-lidar models`: the models that can be targets, shipped ones and the user's own."""

from typing import get_args

import typer

from rso_lidar.cli import models_add, models_show
from rso_lidar.cli.console import make_console
from rso_lidar.cli.default_command import default_to
from rso_lidar.cli.table import print_descriptions
from rso_lidar.mission_analysis import list_materials
from rso_lidar.records import ObjectClass, SizeClass, Taxonomy
from rso_lidar.scene import models as catalogue
from rso_lidar.scene import own_folder, own_models

app = typer.Typer(cls=default_to("show"), rich_markup_mode=None, pretty_exceptions_enable=False)


@app.callback(invoke_without_command=True)
def models(context: typer.Context) -> None:
    """List the models of targets, show one, or add your own."""
    if context.invoked_subcommand is None:
        print_models()


def print_models() -> None:
    """List the models that ship with rso_lidar, and those of your own library."""
    console = make_console()
    own = own_models()
    rows = []
    for key, entry in [*sorted(catalogue().items(), key=lambda item: _get_rank(item[1].taxonomy)), *own.items()]:
        size = " x ".join(f"{side:.3g}" for side in entry.size_m)
        of, what = entry.taxonomy, ("yours: " if entry.own else "") + entry.what
        rows.append([key, of.object_class, of.size_class, size, f"{entry.facets:,}", str(len(entry.parts)), what])
    heads = ["name", "class", "size class", "size, m", "facets", "parts", "what"]
    order = ["name", "what", "size, m", "class", "facets", "parts", "size class"]
    print_descriptions(heads, rows, order, ["what"], "`rso-lidar models NAME` shows all of one")
    console.print(
        '\nIn a scenario: model = "tdrs". A path with a suffix or a slash reads your own mesh;\n'
        "`rso-lidar models add PATH` keeps it, with scale and materials, in your library;\n"
        "`rso-lidar models materials` lists the materials.",
    )
    if own:
        console.print(f"Yours are in {own_folder()}", soft_wrap=True)


def _get_rank(taxonomy: Taxonomy) -> tuple[int, int]:
    """Return the sort key of a model: its class, then its size class."""
    classes, sizes = get_args(ObjectClass), get_args(SizeClass)
    return classes.index(taxonomy.object_class), -sizes.index(taxonomy.size_class)


def print_materials() -> None:
    """List the shipped materials: reflectance by wavelength, its quality, and a description."""
    lines = list_materials()
    heads = ["name", "BRDF", *(f"{nm:g} nm" for nm in lines[0].reflectance), "what", "confidence"]
    rows = [
        [line.name, line.kind, *(f"{share:.3g}" for share in line.reflectance.values()), line.what, line.confidence]
        for line in lines
    ]
    order = [heads[0], "what", *heads[2:-2], "BRDF", "confidence"]
    print_descriptions(heads, rows, order, ["what", "confidence"], "a wider terminal, or `| cat`, shows them")
    console = make_console()
    console.print(
        '\nReflectance is of all directions together. In a scenario: material = "mli_gold",\n'
        'or part_materials = { bus = "mli_gold_crinkled" }; docs/scenario.md tells how to\n'
        "give one of your own.",
    )


app.command("list")(print_models)
app.command("show")(models_show.show)
app.command("materials")(print_materials)
app.command("add")(models_add.add)
app.command("check")(models_add.check)
app.command("remove")(models_add.remove)
