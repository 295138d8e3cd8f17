"""`rso-lidar dataset export`: a dataset in the formats of other libraries."""

from pathlib import Path
from typing import Annotated

import typer

from rso_lidar.cli.arguments import Overwrite
from rso_lidar.cli.terminal import echo
from rso_lidar.dataset import EXPORT_FORMATS
from rso_lidar.dataset import export as export_dataset
from rso_lidar.dataset import open as open_dataset
from rso_lidar.errors import DatasetError


def export(
    folder: Annotated[Path, typer.Argument(metavar="FOLDER", help="Folder of the dataset.")],
    to: Annotated[str, typer.Option("--to", metavar="FORMAT", help=f"Format: {', '.join(EXPORT_FORMATS)}.")],
    output: Annotated[Path, typer.Option("-o", "--output", metavar="OUT", help="Folder to write.")],
    split: Annotated[
        list[str] | None, typer.Option("--split", metavar="NAME", help="Only this split; may be repeated.")
    ] = None,
    arrays: Annotated[
        str | None,
        typer.Option("--arrays", metavar="A,B", help="Images to write, such as range_m,photons; 'all' writes all."),
    ] = None,
    overwrite: Overwrite = False,
) -> None:
    """Write a dataset as WebDataset, TFRecord, or PNG images with COCO annotations, and print what is left out."""
    images = [word.strip() for word in (arrays or "").split(",") if word.strip()]
    if arrays is not None and not images:
        raise DatasetError(f"--arrays {arrays}: names no array; write for example range_m,photons")
    data = open_dataset(folder)
    for line in export_dataset(data, output, to, splits=split or (), images=images, overwrite=overwrite):
        echo(line)
