"""`rso-lidar info`: what is in a recording."""

import numpy as np
import typer

from rso_lidar import export
from rso_lidar.cli.plot import RecordingFile
from rso_lidar.errors import RecordingError


def info(recording: RecordingFile) -> None:
    """Print what a recording holds: scenario, frames, returns, ranges, targets, versions."""
    with export.open(recording) as frames:
        source, count = frames.source, len(frames)
        size_mb = recording.stat().st_size / 1e6
        state = "complete" if frames.complete else "unfinished: run again with --resume"
        typer.echo(f"{source.title}")
        typer.echo(f"file        {recording.name}, {size_mb:.1f} MB, {state}")
        if not count:
            raise RecordingError(f"{recording}: holds no frames yet; run the scenario again")
        first, last = frames[0], frames[count - 1]
        typer.echo(
            f"frames      {count}, {first.time_s:g} to {last.time_s:g} s after {source.start_utc}; seed {source.seed}"
        )
        rows, cols = first.range_m.shape
        typer.echo(f"pixels      {rows} x {cols}")
        for name, frame in (("first", first), ("last", last)):
            typer.echo(f"{name:<12}{_returns(frame.range_m, frame.labels.target)}")
        for number, target in enumerate(source.targets):
            parts = ", ".join(target.parts[:8]) + (", ..." if len(target.parts) > 8 else "")
            typer.echo(
                f"target {number}    {target.name}: model {target.model}, {target.facets:,} facets, parts {parts}"
            )
            typer.echo(f"            mesh SHA-256 {target.mesh_sha256}")
        typer.echo("axes        " + ", ".join(["inertial", *first.truth.poses]))
        typer.echo("versions    " + ", ".join(f"{name} {text}" for name, text in source.versions.items()))


def _returns(range_m: np.ndarray, target: np.ndarray) -> str:
    valid = np.isfinite(range_m)
    if not valid.any():
        return "no returns"
    on_target = valid & (target >= 0)
    text = f"{int(valid.sum())} returns, {int(on_target.sum())} of them on a target"
    if on_target.any():
        seen = range_m[on_target]
        text += f" at {float(seen.min()):.1f} to {float(seen.max()):.1f} m"
    return text
