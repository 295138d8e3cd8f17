"""`rso-lidar dataset`: commands that make, check, publish, export and score datasets for learning."""

import typer

from rso_lidar.cli import dataset_check, dataset_export, dataset_make, dataset_publish, dataset_score

app = typer.Typer(rich_markup_mode=None, pretty_exceptions_enable=False, no_args_is_help=True)


@app.callback()
def dataset() -> None:
    """Make, check, publish, export and score datasets for learning."""


app.command("make")(dataset_make.make)
app.command("check")(dataset_check.check)
app.command("export")(dataset_export.export)
app.command("publish")(dataset_publish.publish)
app.command("score")(dataset_score.score)
