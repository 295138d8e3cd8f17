"""The application: all commands in the order in which one meets them."""

import importlib.metadata
from typing import Annotated, Any

import typer

from rso_lidar.cli import (
    animate,
    budget,
    catalog,
    check,
    encounters,
    export,
    info,
    models,
    new,
    plot,
    run,
    schema,
    timeline,
    track,
    trade,
    truth,
    view,
)

# What typer raises for a word it cannot read; it carries its own copy of click, and names this class nowhere else.
usage_error: Any = next(base for base in typer.BadParameter.__mro__ if base.__name__ == "ClickException")

app = typer.Typer(
    name="rso-lidar",
    help="Fly a flash LiDAR past a satellite before you build one.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    context_settings={"max_content_width": 110},
)

app.command("new")(new.new)
app.command("check")(check.check)
app.command("budget")(budget.budget)
app.command("truth")(truth.truth)
app.command("timeline")(timeline.timeline)
app.command("trade")(trade.trade)
app.command("catalog")(catalog.catalog)
app.command("encounters")(encounters.encounters)
app.command("run")(run.run)
app.command("export")(export.export)
app.command("info")(info.info)
app.command("plot")(plot.plot)
app.command("track")(track.track)
app.command("animate")(animate.animate)
app.command("view")(view.view)
app.command("schema")(schema.schema)
app.add_typer(models.app, name="models")


def _version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"rso-lidar {importlib.metadata.version('rso-lidar')}")  # noqa: TID251 - names nothing
        raise typer.Exit


@app.callback()
def root(
    version: Annotated[
        bool, typer.Option("--version", help="Print the version and leave.", callback=_version, is_eager=True)
    ] = False,
) -> None:
    """Fly a flash LiDAR past a satellite before you build one."""
