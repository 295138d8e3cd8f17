"""`rso-lidar dataset`: commands that make, check, publish, export and score datasets for learning."""

from pathlib import Path
from typing import Annotated

import typer

from rso_lidar.cli import dataset_check, dataset_export, dataset_make, dataset_score
from rso_lidar.cli.arguments import Overwrite
from rso_lidar.cli.default_command import WholeSentences
from rso_lidar.cli.terminal import echo
from rso_lidar.dataset import publish as write_publication

app = typer.Typer(cls=WholeSentences, rich_markup_mode=None, pretty_exceptions_enable=False, no_args_is_help=True)


@app.callback()
def dataset() -> None:
    """Make, check, publish, export and score datasets for learning."""


def publish(
    folder: Annotated[Path, typer.Argument(metavar="FOLDER", help="Folder of the dataset.")],
    licence: Annotated[
        str | None, typer.Option("--licence", metavar="SPDX", help="Licence of the frames, such as CC-BY-4.0.")
    ] = None,
    creator: Annotated[
        list[str] | None, typer.Option("--creator", metavar="NAME", help="Name of a creator; may be repeated.")
    ] = None,
    url: Annotated[str | None, typer.Option("--url", metavar="URL", help="Web address of the dataset.")] = None,
    hidden_labels: Annotated[
        Path | None,
        typer.Option(
            "--hidden-labels",
            metavar="NEW",
            help="Write a contest into this new folder: the dataset, with a test split that has no labels.",
        ),
    ] = None,
    overwrite: Overwrite = False,
) -> None:
    """Write README.md (the card), croissant.json, index.parquet (the table of frames) and two pictures again.

    A licence, creator or address that is not given stays as stated before. With --hidden-labels, only the new folder is
    written, to give away; labels and key stay, and `dataset score --contest` judges by them.
    """
    stated = {"licence": licence, "creators": tuple(creator or ()), "url": url}
    for line in write_publication(folder, **stated, hidden_labels=hidden_labels, overwrite=overwrite):  # type: ignore[arg-type]
        echo(line)


app.command("make")(dataset_make.make)
app.command("check")(dataset_check.check)
app.command("export")(dataset_export.export)
app.command("publish")(publish)
app.command("score")(dataset_score.score)
