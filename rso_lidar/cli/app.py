"""The application: all commands in the order in which one meets them."""

from typing import Annotated

import typer

from rso_lidar.cli import animate, check, info, models, plot, run, schema

app = typer.Typer(
    name="rso-lidar",
    help="Fly a flash LiDAR past a satellite before you build one.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode="rich",
)

app.command("check")(check.check)
app.command("run")(run.run)
app.command("info")(info.info)
app.command("plot")(plot.plot)
app.command("animate")(animate.animate)
app.command("models")(models.models)
app.command("schema")(schema.schema)


def _version(wanted: bool) -> None:
    if wanted:
        from rso_lidar import __version__

        typer.echo(f"rso-lidar {__version__}")
        raise typer.Exit


@app.callback()
def root(
    version: Annotated[
        bool, typer.Option("--version", help="Print the version and leave.", callback=_version, is_eager=True)
    ] = False,
) -> None:
    """Fly a flash LiDAR past a satellite before you build one."""
