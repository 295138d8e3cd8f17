"""`rso-lidar view`: a recording in the Rerun viewer, or in files where there is no display."""

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer

from rso_lidar import export
from rso_lidar.cli.arguments import Dark, Overwrite, RecordingFile, choose_scheme, select_frames
from rso_lidar.cli.progress import count_frames
from rso_lidar.cli.terminal import echo
from rso_lidar.errors import RecordingError
from rso_lidar.evaluation import VIEW_COLOURS, VIEW_TOOLS, ViewerChoice, choose_viewer, show


def view(
    recording: RecordingFile,
    colour: Annotated[
        str,
        typer.Option(
            "--colour",
            metavar="WHAT",
            help=f"Colour of the points: {' or '.join(VIEW_COLOURS)}.",
            autocompletion=lambda: list(VIEW_COLOURS),
        ),
    ] = "range",
    frames: Annotated[
        str | None,
        typer.Option(
            "--frames",
            metavar="A:B",
            help="Frames A to B-1 only, by number in the scenario; a third number after another colon is the step.",
        ),
    ] = None,
    tool: Annotated[
        str | None,
        typer.Option(
            "--with",
            metavar="TOOL",
            help=f"{', '.join(VIEW_TOOLS)}; left out, the first that is possible.",
            autocompletion=lambda: list(VIEW_TOOLS),
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
    if colour not in VIEW_COLOURS:
        raise RecordingError(f"--colour {colour}: is not {' or '.join(VIEW_COLOURS)}")
    with export.open(recording) as read:
        chosen = choose_viewer(tool, output, recording=recording, overwrite=overwrite)
        some = export.Frames(read, select_frames(read, frames))
        if not chosen.paths:
            echo(f"{chosen.why}: {_format_count(len(some))}; close it to go on")
        each = count_frames(some, "drawing") if chosen.tool == "rerun" else None
        drawn = show(chosen, some, colour=colour, folder=recording.parent, each=each, scheme=choose_scheme(dark))
    if chosen.paths:
        echo(_summarise(chosen, drawn))


def _summarise(chosen: ViewerChoice, drawn: Sequence[str]) -> str:
    """Describe in a line what was written, with which frames, and why."""
    named = ", ".join(f"{path} ({frames})" for path, frames in zip(chosen.paths, drawn, strict=True))
    why = f"{chosen.why}: wrote" if chosen.why else "wrote"
    more = f"; open it with: rerun {chosen.paths[0]}" if chosen.tool == "rerun" else ""
    return f"{why} {named}{more}"


def _format_count(count: int) -> str:
    return f"{count} frame{'s' * (count != 1)}"
