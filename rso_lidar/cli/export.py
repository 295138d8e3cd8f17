"""`rso-lidar export`: recordings written in the formats of other tools."""

from pathlib import Path
from typing import Annotated, Any

import typer

from rso_lidar import export as files
from rso_lidar.cli.arguments import Overwrite, RecordedFrames, RecordingFile, select_frames
from rso_lidar.cli.progress import count_frames
from rso_lidar.cli.terminal import echo
from rso_lidar.errors import RecordingError
from rso_lidar.evaluation import save
from rso_lidar.export import FORMATS, Format, format_for
from rso_lidar.files import count_bytes

_OF_A_TARGET = ("tum", "kitti", "tdm")
_OF_A_BODY = ("oem", "aem")
_OF_A_SENSOR = ("csv", "parquet")
_OF_A_CAMERA = ("raster",)
_QUICK = ("tum", "kitti", "csv", "parquet", "oem", "aem", "czml")  # read no image
_WHOLE = "tdm"  # reads the recording more than once


def export(
    recording: RecordingFile,
    to: Annotated[Path, typer.Option("--to", help="What to write; a folder for formats of one file a frame.")],
    form: Annotated[
        str | None,
        typer.Option(
            "--format",
            metavar="NAME",
            help=f"Instead of the suffix: {', '.join(FORMATS)}.",
            autocompletion=lambda: list(FORMATS),
        ),
    ] = None,
    frames: RecordedFrames = None,
    target: Annotated[
        str | None,
        typer.Option(
            "--target", metavar="NAME", help="Target of a tum, kitti or tdm; body of an oem or aem (the follower)."
        ),
    ] = None,
    lidar_in_target: Annotated[
        bool, typer.Option("--lidar-in-target", help="tum, kitti: the lidar in the target's axes, not the reverse.")
    ] = False,
    sensor: Annotated[
        str | None,
        typer.Option("--sensor", metavar="NAME", help="csv, parquet: the samples of this sensor, not the truth."),
    ] = None,
    header_bytes: Annotated[
        int | None, typer.Option("--header-bytes", metavar="N", help="raster: bytes before the first frame (0).")
    ] = None,
    frame_header_bytes: Annotated[
        int | None,
        typer.Option("--frame-header-bytes", metavar="N", help="raster: bytes before the words of each frame (0)."),
    ] = None,
    frame_stride_bytes: Annotated[
        int | None,
        typer.Option(
            "--frame-stride-bytes", metavar="N", help="raster: bytes from one frame to the next (header and words)."
        ),
    ] = None,
    known_attitude: Annotated[
        bool, typer.Option("--known-attitude", help="tdm: the recorded attitude, instead of a star tracker.")
    ] = False,
    corrected: Annotated[
        bool, typer.Option("--corrected", help="tdm: ranges to the target's origin, not to its visible centroid.")
    ] = False,
    overwrite: Overwrite = False,
) -> None:
    """Write a recording in another format. What the format cannot hold is printed."""
    wanted = format_for(form or to)
    if target is not None and wanted.name not in _OF_A_TARGET + _OF_A_BODY:
        raise RecordingError(f"--target {target}: is for tum, kitti, tdm, oem and aem; leave it out of a {wanted.name}")
    if lidar_in_target and wanted.name not in ("tum", "kitti"):
        raise RecordingError(f"--lidar-in-target: is for tum and kitti; leave it out of a {wanted.name}")
    if sensor is not None and wanted.name not in _OF_A_SENSOR:
        raise RecordingError(f"--sensor {sensor}: is for csv and parquet; leave it out of a {wanted.name}")
    lengths = {
        "header_bytes": header_bytes,
        "frame_header_bytes": frame_header_bytes,
        "frame_stride_bytes": frame_stride_bytes,
    }
    given = {name: length for name, length in lengths.items() if length is not None}
    if given and wanted.name not in _OF_A_CAMERA:
        option = "--" + next(iter(given)).replace("_", "-")
        raise RecordingError(f"{option}: is for raster; leave it out of a {wanted.name}")
    for option, is_given in (("--known-attitude", known_attitude), ("--corrected", corrected)):
        if is_given and wanted.name != "tdm":
            raise RecordingError(f"{option}: is for tdm; leave it out of a {wanted.name}")
    if to.exists() and to.resolve() == recording.resolve():
        raise RecordingError(f"{to}: is the recording itself; give another name")
    with files.open(recording) as read:
        chosen = files.Frames(read, select_frames(read, frames))
        options: dict[str, Any] = {"target": target} if target is not None else {}
        options |= {"sensor": sensor} if sensor is not None else {}
        options |= {"lidar_in_target": True} if lidar_in_target else {}
        options |= given
        options |= {"known_attitude": True} if known_attitude else {}
        options |= {"corrected": True} if corrected else {}
        each = chosen if wanted.name in (*_QUICK, _WHOLE) else count_frames(chosen, "exporting")
        to = save(to, each, format=wanted.name, overwrite=overwrite, **options)
        echo(_summarise(to, wanted, len(chosen), len(read)))


def _summarise(to: Path, wanted: Format, count: int, held: int) -> str:
    """Summarise an export in one line."""
    kept = f"{count} frames" if count == held else f"{count} of {held} frames"
    size = count_bytes(to)
    text = f"{size / 1e6:.1f} MB" if size >= 1e6 else f"{size / 1e3:.1f} kB"
    return f"written     {to} ({wanted.name}, {kept}, {text}); lost: {wanted.loses}"
