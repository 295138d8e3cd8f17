"""`rso-lidar info`: the contents of a recording."""

import time
from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from rso_lidar import export
from rso_lidar.cli.arguments import RecordingFile
from rso_lidar.cli.terminal import echo, has_reader, to_one_line
from rso_lidar.errors import RecordingError, RunError
from rso_lidar.export import RecordingStatus, read_status
from rso_lidar.files import count_bytes
from rso_lidar.part import parse_toml
from rso_lidar.records import Frame, SensorSamples

_EVERY_S = 2.0
_SILENCE_S = 30.0  # without a new frame, after which a line says so


def info(
    recording: RecordingFile,
    following: Annotated[
        bool, typer.Option("--follow", help="Print frames and rate while another process writes, until it is complete.")
    ] = False,
    every_s: Annotated[
        float | None, typer.Option("--every", metavar="S", help="Seconds between lines of --follow.")
    ] = None,
    timeout_s: Annotated[
        float | None, typer.Option("--timeout", metavar="S", help="Seconds after which --follow ends.")
    ] = None,
) -> None:
    """Print what a recording holds. It lists scenario, frames, returns, ranges, targets and versions."""
    if following:
        follow_recording(recording, _EVERY_S if every_s is None else every_s, timeout_s)
        return
    if every_s is not None or timeout_s is not None:
        raise RecordingError("--every and --timeout: are for --follow; add it, or leave them out")
    with export.open(recording) as frames:
        source, count = frames.source, len(frames)
        size_mb = count_bytes(recording) / 1e6
        state = "complete" if frames.complete else "unfinished: run again with --resume"
        echo(to_one_line(source.title))
        echo(f"file        {recording.name}, {size_mb:.1f} MB, {state}")
        if not count:
            raise RecordingError(f"{recording}: holds no frames yet; run the scenario again")
        first, last = frames[0], frames[count - 1]
        echo(f"frames      {count}, {first.time_s:g} to {last.time_s:g} s after {source.start_utc}; seed {source.seed}")
        rows, cols = first.range_m.shape
        echo(f"pixels      {rows} x {cols}")
        for name, frame in (("first", first), ("last", last)):
            echo(f"{name:<12}{_describe_returns(frame.range_m, frame.labels.target)}")
        for number, target in enumerate(source.targets):
            parts = ", ".join(target.parts[:8]) + (", ..." if len(target.parts) > 8 else "")
            echo(f"target {number}    {target.name}: model {target.model}, {target.facets:,} facets, parts {parts}")
            if target.taxonomy:
                echo(f"            {target.taxonomy.in_words}")
            echo(f"            mesh SHA-256 {target.mesh_sha256}")
        for line in _describe_more(frames, first):
            echo(line)
        echo("axes        " + ", ".join(["inertial", *first.truth.poses]))
        echo("versions    " + ", ".join(f"{name} {text}" for name, text in source.versions.items()))


def _describe_more(frames: export.Recording, first: Frame) -> list[str]:
    """Describe the optional contents of a recording, a line each."""
    lines = []
    if frames.changes_lens:
        count = len(frames.line_of_sight)
        lines.append(f"lens        {count} table{'s' * (count > 1)} of lines of sight, as the lens changes")
    if first.observation.reading.return_range_m is not None:
        lines.append(f"returns     up to {first.observation.reading.return_range_m.shape[-1]} of a pixel")
    if frames.kept:
        lines.append(f"kept        {', '.join(frames.kept)}")
    lines += [f"sensor      {_describe_sensor(name, frames.sensors[name])}" for name in frames.sensors]
    if first.truth.sunlit:
        shares = {name: frames.dataset(f"truth/{name}/sunlit")[:] for name in first.truth.sunlit}
        text = [f"{name} {_format_span(share.min(), share.max())}" for name, share in shares.items()]
        lines.append(f"sunlight    {', '.join(text)}")
    return lines


def _describe_sensor(name: str, samples: SensorSamples) -> str:
    """Describe the samples of a sensor: what they are, how many, their rate, and how many are valid."""
    count, text = len(samples.time_s), f"{name}: {type(samples).__name__}"
    if not count:
        return f"{text}, no samples"
    steps_s = np.diff(samples.time_s)
    rate = f" at {1.0 / np.median(steps_s):.4g} Hz" if count > 1 else ""
    valid = f", {samples.valid.mean():.1%} valid" if not samples.valid.all() else ""
    return (
        f"{text}, {count:,} sample{'s' * (count > 1)}{rate}, {samples.time_s[0]:g} to {samples.time_s[-1]:g} s{valid}"
    )


def _format_span(low: float, high: float) -> str:
    return f"{high:.0%}" if low == high else f"{low:.0%} to {high:.0%}"


def _describe_returns(range_m: np.ndarray, target: np.ndarray) -> str:
    valid = np.isfinite(range_m)
    if not valid.any():
        return "no returns"
    on_target = valid & (target >= 0)
    text = f"{int(valid.sum())} returns, {int(on_target.sum())} of them on a target"
    if on_target.any():
        seen = range_m[on_target]
        text += f" at {float(seen.min()):.1f} to {float(seen.max()):.1f} m"
    return text


def follow_recording(recording: Path, every_s: float, timeout_s: float | None) -> None:
    """Print frames and rate periodically until the recording is complete or abandoned, the time is up, or nobody reads.

    Parameters
    ----------
    every_s : time between two lines [s]
    timeout_s : greatest time to wait [s]
    """
    for what, seconds in (("--every", every_s), ("--timeout", timeout_s)):
        if seconds is not None and not 0.0 < seconds < float("inf"):
            raise RecordingError(f"{what} {seconds:g}: needs seconds above 0")
    began = said = time.monotonic()
    last = read_status(recording)
    echo(_describe_start(last))
    while has_reader():
        if last.complete and not last.running:
            echo(f"complete    {last.output} holds {last.frames} frames")
            return
        if not last.running:
            _report_end(last)
        now = time.monotonic()
        if timeout_s is not None and now - began >= timeout_s:
            echo(f"unfinished  {last.frames} frames after {timeout_s:g} s; it is still being written")
            return
        left_s = every_s if timeout_s is None else min(every_s, timeout_s - (now - began))
        time.sleep(max(left_s, 0.001))
        seen = read_status(recording)
        now = time.monotonic()
        if seen.running and seen.source is None:  # between two names, or not begun
            continue
        if seen.frames != last.frames or now - said >= _SILENCE_S:
            rate = (seen.frames - last.frames) / max(now - said, 1e-9)
            echo(f"frames      {seen.frames}, {max(rate, 0.0):.1f} frames/s{_describe_progress(seen)}")
            said = now
        last = seen


def _describe_start(seen: RecordingStatus) -> str:
    if seen.source is None:
        return f"waiting     {seen.file.name} is being begun"
    return f"following   {seen.file.name}: {seen.source.title}, {seen.frames} frames{_describe_progress(seen)}"


def _describe_progress(seen: RecordingStatus) -> str:
    """Describe the share of the scenario's time that is simulated; empty where the scenario does not say."""
    if seen.source is None or seen.time_s is None:
        return ""
    try:
        duration_s = float(parse_toml(seen.source.scenario, "recording", RecordingError)["time"]["duration_s"])
    except (RecordingError, KeyError, TypeError, ValueError):
        return f", at {seen.time_s:g} s"
    return f", at {seen.time_s:g} of {duration_s:g} s"


def _report_end(seen: RecordingStatus) -> None:
    """Raise an error if no process writes the recording any more and it is not complete."""
    raise RunError(
        f"{seen.output}: the run that wrote it has ended after {seen.frames} frames, which are in {seen.file.name}; "
        f"continue with: rso-lidar run SCENARIO -o {seen.output} --resume, "
        "and the same --set, --seed, --frames and --keep as before"
    )
