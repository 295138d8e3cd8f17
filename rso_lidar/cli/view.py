"""`rso-lidar view`: a recording in Rerun, in a window, or in files where there is no display."""

from pathlib import Path
from typing import Annotated

import typer

from rso_lidar import export
from rso_lidar.cli.progress import counted
from rso_lidar.cli.recordings import RecordingFile, places
from rso_lidar.errors import RecordingError
from rso_lidar.study.viewing import COLOURS, TOOLS, Way, show, way


def view(
    recording: RecordingFile,
    colour: Annotated[
        str, typer.Option("--colour", metavar="WHAT", help=f"Colour of the points: {' or '.join(COLOURS)}.")
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
        typer.Option("--with", metavar="TOOL", help=f"{', '.join(TOOLS)}; left out, the first that is possible."),
    ] = None,
    output: Annotated[
        Path | None,
        typer.Option(
            "-o", "--output", help="Write a scene (.rrd), a picture (.png, .pdf, .svg) or a film (.gif, .mp4)."
        ),
    ] = None,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace an output that exists.")] = False,
) -> None:
    """Look at a recording: cloud, range, intensity and true mesh, frame by frame."""
    if colour not in COLOURS:
        raise RecordingError(f"--colour {colour}: is not {' or '.join(COLOURS)}")
    with export.open(recording) as read:
        chosen = way(tool, output, recording=recording, overwrite=overwrite)
        some = export.Frames(read, places(read, frames))
        if not chosen.paths:
            typer.echo(f"{chosen.why}: {_frames(len(some))}; close it to go on")
        each = counted(some, "drawing") if chosen.tool == "rerun" else None
        show(chosen, some, colour=colour, folder=recording.parent, each=each)
    if chosen.paths:
        typer.echo(_said(chosen, len(some)))


def _said(chosen: Way, count: int) -> str:
    """Return what was written and why, in a line."""
    named = ", ".join(f"{path}" for path in chosen.paths)
    why = f"{chosen.why}: wrote" if chosen.why else "wrote"
    more = f"; open it with: rerun {chosen.paths[0]}" if chosen.tool == "rerun" else ""
    return f"{why} {named} ({_frames(count)}){more}"


def _frames(count: int) -> str:
    return f"{count} frame{'s' * (count != 1)}"
