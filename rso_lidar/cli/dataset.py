"""`rso-lidar dataset`: datasets for learning, made, checked, scored and exported."""

import typer

from rso_lidar.cli import dataset_check, dataset_make

app = typer.Typer(rich_markup_mode=None, pretty_exceptions_enable=False, no_args_is_help=True)


@app.callback()
def dataset() -> None:
    """Make and check datasets for learning."""


app.command("make")(dataset_make.make)
app.command("check")(dataset_check.check)
