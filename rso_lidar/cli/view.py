"""`rso-lidar view`: a recording in the Rerun viewer, or in files where there is no display."""

from pathlib import Path
from typing import Annotated

import typer

from rso_lidar import export
from rso_lidar.cli.arguments import Dark, Overwrite, RecordedFrames, RecordingFile, choose_scheme, select_frames
from rso_lidar.cli.progress import count_frames
from rso_lidar.cli.terminal import echo
from rso_lidar.errors import RecordingError
from rso_lidar.evaluation import ViewerChoice
from rso_lidar.evaluation import view as show


def view(
    recording: RecordingFile,
    colour: Annotated[
        str,
        typer.Option(
            "--colour",
            metavar="WHAT",
            help=f"Colour of the points: {' or '.join(ViewerChoice.COLOURS)}.",
            autocompletion=lambda: list(ViewerChoice.COLOURS),
        ),
    ] = "range",
    frames: RecordedFrames = None,
    tool: Annotated[
        str | None,
        typer.Option(
            "--with",
            metavar="TOOL",
            help=f"{', '.join(ViewerChoice.TOOLS)}; left out, the first that is possible.",
            autocompletion=lambda: list(ViewerChoice.TOOLS),
        ),
    ] = None,
    output: Annotated[
        Path | None,
        typer.Option(
            "-o", "--output", help="Write a scene (.rrd), a picture (.png, .pdf, .svg) or a film (.gif, .mp4)."
        ),
    ] = None,
    dark: Dark = False,
    overwrite: Overwrite = False,
) -> None:
    """Show a recording in a viewer, frame by frame. It shows the point cloud, range, intensity and true mesh."""
    if colour not in ViewerChoice.COLOURS:
        raise RecordingError(f"--colour {colour}: is not {' or '.join(ViewerChoice.COLOURS)}")
    with export.open(recording) as read:
        some = export.Frames(read, select_frames(read, frames))
        chosen = show(
            some,
            tool=tool,
            colour=colour,
            output=output,
            overwrite=overwrite,
            each=count_frames(some, "drawing"),
            scheme=choose_scheme(dark),
            on_window=echo,
        )
    if chosen.paths:
        echo(chosen.describe())
