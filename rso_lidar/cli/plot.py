"""`rso-lidar plot`: pictures of a recording."""

from pathlib import Path
from typing import Annotated

import typer

from rso_lidar import export, picture
from rso_lidar.cli.arguments import Dark, Overwrite, RecordingFile, choose_scheme
from rso_lidar.cli.terminal import echo
from rso_lidar.errors import RecordingError
from rso_lidar.files import check_writable
from rso_lidar.picture import FIGURE_SUFFIXES


def plot(
    recording: RecordingFile,
    output: Annotated[
        Path | None,
        typer.Option(
            "-o",
            "--output",
            help="Picture (.png; all but the sheet .pdf and .svg, too); left out, beside the recording.",
        ),
    ] = None,
    frame: Annotated[
        int | None, typer.Option("--frame", help="Draw this frame alone, by its number in the scenario.")
    ] = None,
    path: Annotated[bool, typer.Option("--path", help="Draw the relative trajectory and range over time.")] = False,
    curves: Annotated[
        bool, typer.Option("--curves", help="Draw detection, photons and range error over time.")
    ] = False,
    dark: Dark = False,
    overwrite: Overwrite = False,
) -> None:
    """Draw frames of a recording, their trajectory or curves. Without --frame, it draws a contact sheet."""
    if (frame is not None) + path + curves > 1:
        raise RecordingError("--frame, --path and --curves are three pictures; give one at a time")
    kind = "path" if path else "curves" if curves else "sheet" if frame is None else f"frame{frame}"
    if output is not None:
        output = check_writable(output, (".png",) if kind == "sheet" else FIGURE_SUFFIXES, overwrite=overwrite)
    scheme = choose_scheme(dark)
    with export.open(recording) as frames:
        place = output or check_writable(recording.with_name(f"{recording.stem}_{kind}.png"), overwrite=overwrite)
        if frame is not None:
            numbers = frames.frame_index[:].tolist()
            if frame not in numbers:
                held = f"holds {len(numbers)} frames, {numbers[0]} to {numbers[-1]}" if numbers else "holds no frames"
                raise RecordingError(f"--frame {frame}: {recording.name} {held}")
            picture.save_frame(frames[numbers.index(frame)], place, scheme)
        elif path:
            picture.save_figure(picture.orbit_figure(frames), place, scheme=scheme)
        elif curves:
            picture.save_figure(picture.curve_figure(frames), place, scheme=scheme)
        else:
            picture.contact_sheet(frames, place, scheme=scheme)
    echo(f"{place}")
