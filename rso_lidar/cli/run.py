"""`rso-lidar run`: simulation of a scenario, written to a recording."""

import glob
import importlib.metadata
import time
from contextlib import ExitStack, nullcontext, suppress
from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from rso_lidar import export
from rso_lidar.cli.arguments import (
    Engine,
    Overwrite,
    ScenarioFile,
    Scheduler,
    Seed,
    Settings,
    Threads,
    TrustCode,
    TrustFmu,
    Workers,
    choose_scheduler,
    join_settings,
)
from rso_lidar.cli.live_options import Live, LiveAt, LiveOrigin, LiveWith, open_live_view, report_live_view
from rso_lidar.cli.progress import Pace, announce_compiling, format_rate, show_progress
from rso_lidar.cli.terminal import echo, to_one_line
from rso_lidar.errors import RecordingError, ScenarioError
from rso_lidar.interruption import set_advice
from rso_lidar.processes import open_executor
from rso_lidar.records import Frame
from rso_lidar.scenario import Scenario, parse_frames
from rso_lidar.simulation import simulate


def run(
    file: ScenarioFile,
    output: Annotated[Path, typer.Option("-o", "--output", help="Recording to write (.h5, or .nc).")],
    frames: Annotated[
        str | None,
        typer.Option(
            "--frames", metavar="A:B", help="Frames A to B-1 only; a third number after another colon is the step."
        ),
    ] = None,
    seed: Seed = None,
    threads: Threads = None,
    workers: Workers = None,
    engine: Engine = "pool",
    scheduler: Scheduler = None,
    settings: Settings = None,
    trust_code: TrustCode = False,
    trust_fmu: TrustFmu = False,
    keep: Annotated[
        str | None,
        typer.Option(
            "--keep",
            metavar="A,B",
            help="Record intermediate products as well: photons, waveforms, oversampled, prediction.",
        ),
    ] = None,
    overwrite: Overwrite = False,
    resume: Annotated[bool, typer.Option("--resume", help="Continue an interrupted run.")] = False,
    live: Live = False,
    live_at: LiveAt = None,
    live_with: LiveWith = None,
    live_origin: LiveOrigin = None,
) -> None:
    """Simulate a scenario; record its frames with truth and labels."""
    by = choose_scheduler(engine, scheduler)
    if threads is not None and (workers is not None or by is not None):
        other = "--workers" if by is None else "--engine dask"
        raise ScenarioError(f"--threads and {other}: frames are made by one or the other; leave out one")
    scenario = Scenario.load(file, join_settings(settings, seed), trust_code=trust_code, trust_fmu=trust_fmu)
    numbers = scenario.time.choose_frames(parse_frames(frames))
    kept = _parse_keep(keep)
    if resume and not overwrite and _is_complete(output, scenario, numbers, kept):
        echo(f"complete    {output} holds all {len(numbers)} frames already")
        return
    export.check_output(output, overwrite=overwrite)
    whole = np.array_equal(numbers, np.arange(scenario.time.n_frames))
    chosen = "" if whole else " ".join(map(str, numbers.tolist()))
    if kept:
        chosen += " keep " + ",".join(sorted(kept))
    made_by = importlib.metadata.version("rso-lidar"), scenario.source.versions["arithmetic"]
    identity = export.run_id(scenario.source, chosen, " ".join(made_by))
    if resume and not overwrite:
        _refuse_other_runs(output, identity)
    tally = Tally()
    done = 0
    view = open_live_view(scenario, live, live_at, live_with, live_origin)
    recorder = export.Recorder(
        output,
        scenario.source,
        run_id=identity,
        overwrite=overwrite,
        resume=resume,
        changing_lens=scenario.lidar.changes_lens,
    )
    set_advice(lambda: to_one_line(_describe_kept_frames(recorder, len(numbers), resume=resume)))
    with recorder, view or nullcontext():
        done = recorder.written
        if done:
            echo(f"continuing after {done} of {len(numbers)} frames")
        if done < len(numbers):
            with open_executor(workers, scheduler=by) as executor, ExitStack() as stack:
                stack.enter_context(announce_compiling())
                bar = stack.enter_context(show_progress(len(numbers), done))
                left = numbers[done:].tolist()
                for frame in simulate(scenario, frames=left, threads=threads, executor=executor, keep=kept):
                    recorder.write(frame)
                    if view is not None:
                        view.show(frame)
                    tally.add(frame)
                    bar.advance()
    echo(tally.table(output, done))
    report_live_view(view)


def _describe_kept_frames(recorder: export.Recorder, count: int, *, resume: bool) -> str:
    """Describe what an interrupted run leaves, and how to continue."""
    if not recorder.temporary.exists():
        return f"all {count} frames are in {recorder.path}" if recorder.written == count else "no frame was recorded"
    if not recorder.written:
        return f"{recorder.temporary} is as it was; continue with --resume" if resume else "no frame was recorded"
    kept = f"{recorder.written} of {count} frames are kept in {recorder.temporary}"
    return f"{kept}; continue with --resume and the same options"


def _refuse_other_runs(output: Path, identity: str) -> None:
    """Raise a `ScenarioError` if an interrupted run with other settings left frames beside the output."""
    if output.with_name(f"{output.name}.tmp-{identity}").exists():
        return
    for other in sorted(output.parent.glob(f"{glob.escape(output.name)}.tmp-*")):
        with suppress(RecordingError), export.open(other) as cut_off:
            if len(cut_off):
                raise ScenarioError(
                    f"{other}: holds {len(cut_off)} frame{'s' * (len(cut_off) > 1)} of another run: scenario, model, --set, "
                    "--seed, --frames, --keep, version or arithmetic differs; repeat what it was begun with, or give "
                    "--overwrite to start again"
                )


def _parse_keep(text: str | None) -> tuple[str, ...]:
    """Parse ``A,B`` as names of records, each once."""
    if text is None:
        return ()
    names = tuple(dict.fromkeys(word.strip() for word in text.split(",") if word.strip()))
    if not names:
        raise ScenarioError(f"--keep {text!r}: names nothing; write for example photons,waveforms")
    export.check_kept(names)
    return names


def _is_complete(output: Path, scenario: Scenario, numbers: np.ndarray, kept: tuple[str, ...]) -> bool:
    """Return whether an output is already the complete recording of these frames, with these records kept.

    Parameters
    ----------
    scenario, numbers : the scenario, and the indices of its frames
    """
    if not output.is_file():
        return False
    with export.open(output) as recording:
        same = recording.complete and recording.source.scenario == scenario.source.scenario
        same = same and set(recording.kept) == set(kept)
        return same and np.array_equal(recording.frame_index[:], numbers)


class Tally:
    """Counts and extreme values of the frames of a run."""

    def __init__(self) -> None:
        self._began = time.monotonic()
        self._pace = Pace()
        self._rate: float | None = None
        self._frames = self._seen = self._found = self._false = self._empty = 0
        self._nearest, self._farthest = np.inf, -np.inf

    def add(self, frame: Frame) -> None:
        """Count one frame."""
        on_target = frame.labels.filled_fraction > 0.0  # not where only the lens's blur puts some light
        valid = frame.valid
        self._frames += 1
        self._rate = self._pace.count()
        self._seen += int(on_target.sum())
        self._found += int((valid & on_target).sum())
        self._false += int((valid & (frame.labels.target < 0)).sum())
        self._empty += not on_target.any()
        if on_target.any():
            ranges = frame.labels.range_m[on_target]
            self._nearest = min(self._nearest, float(ranges.min()))
            self._farthest = max(self._farthest, float(ranges.max()))

    def table(self, output: Path, before: int) -> str:
        """Return the summary as lines of text; `before` frames existed before the run continued."""
        seconds = time.monotonic() - self._began
        lines = [
            f"recorded    {output} ({output.stat().st_size / 1e6:.1f} MB)",
            f"frames      {self._frames} in {seconds:.1f} s"
            + (f", {format_rate(self._rate)} frames/s after the first" if self._rate is not None else "")
            + (f"; {before} were there before, and the lines below are without them" if before else ""),
        ]
        if self._seen:
            lines.append(
                f"on target   {self._seen:,} pixels, {self._found:,} of them reported ({self._found / self._seen:.1%})"
            )
            lines.append(f"range       {self._nearest:.2f} to {self._farthest:.2f} m (truth)")
        if self._empty:
            lines.append(f"empty       {self._empty} frames have no target in view")
        lines.append(
            f"elsewhere   {self._false:,} false triggers in the sky, {self._false / max(self._frames, 1):.2f} a frame"
        )
        return "\n".join(lines)
