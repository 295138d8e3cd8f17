"""`rso-lidar info --follow`: the progress of a recording that another process writes."""

import time
from pathlib import Path

from rso_lidar.cli.terminal import echo, has_reader
from rso_lidar.errors import RecordingError, RunError
from rso_lidar.export import RecordingStatus, read_status
from rso_lidar.part import parse_toml

_SILENCE_S = 30.0  # without a new frame, after which a line says so


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
