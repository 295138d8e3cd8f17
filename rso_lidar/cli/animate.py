"""`rso-lidar animate`: animations of recordings."""

from pathlib import Path
from typing import Annotated

import typer

from rso_lidar import export, picture
from rso_lidar.cli.arguments import Dark, Overwrite, RecordingFile, choose_scheme
from rso_lidar.cli.terminal import echo
from rso_lidar.files import check_writable
from rso_lidar.picture import ANIMATION_SUFFIXES


def animate(
    recording: RecordingFile,
    output: Annotated[Path, typer.Argument(metavar="OUT", help="Animation (.gif, or .mp4 with the extra 'mp4').")],
    max_frames: Annotated[
        int, typer.Option("--max-frames", min=1, help="Thin the recording evenly to this many.")
    ] = 120,
    rate_hz: Annotated[float | None, typer.Option("--rate", min=0.1, help="Pictures per second.")] = None,
    dark: Dark = False,
    overwrite: Overwrite = False,
) -> None:
    """Animate a recording as GIF or MP4."""
    output = check_writable(output, ANIMATION_SUFFIXES, overwrite=overwrite)
    with export.open(recording) as frames:
        picture.animate(frames, output, max_frames, rate_hz, choose_scheme(dark))
    echo(f"{output}")
