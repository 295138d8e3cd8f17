"""`rso-lidar dataset publish`: the card, the Croissant description and the table of frames of a dataset."""

from pathlib import Path
from typing import Annotated

import typer

from rso_lidar.cli.terminal import echo
from rso_lidar.dataset import publish as write_publication


def publish(
    folder: Annotated[Path, typer.Argument(metavar="FOLDER", help="Folder of the dataset.")],
    licence: Annotated[
        str | None, typer.Option("--licence", metavar="SPDX", help="Licence of the frames, such as CC-BY-4.0.")
    ] = None,
    creator: Annotated[
        list[str] | None, typer.Option("--creator", metavar="NAME", help="Name of a creator; may be repeated.")
    ] = None,
    url: Annotated[str | None, typer.Option("--url", metavar="URL", help="Web address of the dataset.")] = None,
) -> None:
    """Write README.md (the card), croissant.json, index.parquet (the table of frames) and two pictures again.

    A licence, creator or address that is not given stays as stated before.
    """
    for line in write_publication(folder, licence=licence, creators=tuple(creator or ()), url=url):
        echo(line)
