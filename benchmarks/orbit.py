"""A long run: an orbit at 20 Hz is flown, followed from beside, killed, resumed and read, by the command line."""

import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path

import numpy as np

import rso_lidar as rl
from benchmarks.report import Findings, table
from rso_lidar.errors import RecordingError
from rso_lidar.export import read_status
from rso_lidar.export.layout.datasets import collect_values
from rso_lidar.scene import model

FRAMES = 120_000
RATE_HZ = 20
SAMPLED = 24  # frames flown by themselves and compared
LOOK_S = 1.0  # between two looks at a process
START = datetime(2024, 9, 17, 12, tzinfo=UTC)
COMMAND = [sys.executable, "-m", "rso_lidar"]


def scenario(frames: int) -> rl.Scenario:
    """Return an orbit about a tumbling stage: a safety ellipse of 500 m by 1 km, the PTU tracking, the whole detector."""
    return rl.Scenario(
        version=1,
        name="An orbit about a tumbling stage at 20 Hz",
        seed=6000,
        time=rl.Time(start_utc=START, duration_s=frames / RATE_HZ, frame_rate_hz=RATE_HZ),
        target=[
            rl.Target(
                name="stage",
                model="rocket_body",
                motion=rl.Kepler(
                    epoch_utc=START,
                    semi_major_axis_km=6928.137,
                    eccentricity=0.0,
                    inclination_deg=97.6,
                    raan_deg=35.0,
                    argument_of_perigee_deg=0.0,
                    true_anomaly_deg=0.0,
                ),
                attitude=rl.Tumble(inertia_kg_m2=model("rocket_body").inertia_kg_m2, body_rate_deg_s=(0.6, 1.0, 0.4)),
            )
        ],
        follower=rl.Follower(motion=rl.rpo.SafetyEllipse(relative_to="stage", radial_m=500, cross_track_m=600)),
        ptu=rl.Ptu(
            point=rl.TrackPoint(at="stage"),
            response=rl.SecondOrder(natural_hz=4.0, damping=0.7, max_rate_deg_s=30.0),
            errors=rl.PointingErrors(jitter_deg=0.002, encoder_noise_deg=0.002),
        ),
        lidar=rl.Lidar(preset="gsfl_1064"),
    )


@dataclass
class Watched:
    """A run as seen from beside: seconds, frames and megabytes held at each look, by the run and by who follows it."""

    second: list[float] = field(default_factory=list)
    frames: list[int] = field(default_factory=list)
    run_mb: list[float] = field(default_factory=list)
    follow_mb: list[float] = field(default_factory=list)

    @property
    def first_s(self) -> float:
        """Return when the first new frame was seen [s]."""
        return next(s for s, n in zip(self.second, self.frames, strict=True) if n > self.frames[0])

    @property
    def rate_hz(self) -> float:
        """Return the frames a second, from the first look that saw a new frame to the last."""
        begun = next(k for k, n in enumerate(self.frames) if n > self.frames[0])
        return (self.frames[-1] - self.frames[begun]) / max(self.second[-1] - self.second[begun], 1e-9)

    def halves_mb(self) -> tuple[float, float]:
        """Return the memory [MB] a tenth of the way and at the end, each the median of a tenth of the looks."""
        n = len(self.run_mb)
        tenth = max(n // 10, 1)
        return float(np.median(self.run_mb[tenth : 2 * tenth])), float(np.median(self.run_mb[-tenth:]))


def resident_mb(process: int) -> float:
    """Return the memory that a process holds [MB], 0 where it has ended."""
    try:
        return int(Path(f"/proc/{process}/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE") / 1e6
    except (OSError, IndexError):
        return 0.0


def come(output: Path) -> int:
    """Return how many frames of a recording are whole."""
    try:
        return read_status(output).frames
    except RecordingError:  # not begun
        return 0


def watched(file: Path, output: Path, until: int, *more: str) -> tuple[Watched, int, int]:
    """Return what was seen of a run up to so many frames, when it is killed, with the exit codes of run and follower."""
    seen, quiet, began = Watched(), {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}, time.monotonic()
    run = subprocess.Popen([*COMMAND, "run", str(file), "-o", str(output), *more], **quiet)
    before = come(output)
    while run.poll() is None and come(output) <= before:
        time.sleep(0.05)
    follow = subprocess.Popen([*COMMAND, "info", str(output), "--follow", "--every", "1"], **quiet)
    seen.second.append(0.0)
    seen.frames.append(before)
    while run.poll() is None:
        count = come(output)
        seen.second.append(time.monotonic() - began)
        seen.frames.append(count)
        seen.run_mb.append(resident_mb(run.pid))
        seen.follow_mb.append(resident_mb(follow.pid))
        if count >= until:
            run.send_signal(signal.SIGKILL)
            break
        time.sleep(LOOK_S if count > before + RATE_HZ else 0.05)
    code = run.wait()
    seen.second.append(time.monotonic() - began)
    seen.frames.append(come(output))
    return seen, code, follow.wait(timeout=60)


def different(flown: rl.Scenario, output: Path, numbers: Sequence[int]) -> list[int]:
    """Return those of some frames that differ in any bit of any array on disk when they are flown by themselves."""
    found = []
    with rl.open(output) as recording:
        for frame in rl.simulate(flown, frames=numbers):
            for path, value in collect_values(frame).items():
                stored = recording.dataset(path)[frame.index]
                if np.asarray(value, stored.dtype).tobytes() != np.asarray(stored).tobytes():
                    found.append(frame.index)
                    break
    return found


def spent(*words: str) -> tuple[float, float]:
    """Return the seconds and the greatest memory [MB] of a command, looked at every 20 ms."""
    began, most_mb = time.monotonic(), 0.0
    process = subprocess.Popen([*COMMAND, *words], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)
    while process.poll() is None:
        most_mb = max(most_mb, resident_mb(process.pid))
        time.sleep(0.02)
    seconds = time.monotonic() - began
    if process.returncode:
        said = process.stderr.read().decode() if process.stderr else ""
        raise SystemExit(f"{' '.join(words)}: exit {process.returncode}: {said}")
    return seconds, most_mb


def reading(output: Path, folder: Path, frames: int) -> Iterator[tuple[str, str]]:
    """Yield what reading a few frames of the recording costs, as rows."""
    began = time.monotonic()
    with rl.open(output) as recording:
        yield "to open it", f"{1e3 * (time.monotonic() - began):.0f} ms"
        taken = []
        for k in np.random.default_rng(6).integers(0, frames, 30).tolist():
            began = time.monotonic()
            _ = recording[k].range_m
            taken.append(time.monotonic() - began)
        yield "to read a frame anywhere in it, median of 30", f"{1e3 * float(np.median(taken)):.0f} ms"
    name, middle = str(output), frames // 2
    few = ["--frames", f"{middle}:{middle + 10}"]
    for what, words in {
        "`info`": ["info", name],
        "`plot --frame`, one of the middle": ["plot", name, "--frame", str(middle), "-o", str(folder / "one.png")],
        "`export --to .pcd`, ten of the middle": ["export", name, "--to", str(folder / "ten.pcd"), *few],
        "`track`, ten of the middle": ["track", name, *few],
        "`export --to .tum`, all poses": ["export", name, "--to", str(folder / "all.tum")],
    }.items():
        seconds, mb = spent(*words)
        yield what, f"{seconds:.1f} s, {mb:.0f} MB at most"


def measured(frames: int, folder: Path) -> Iterator[tuple[str, str]]:
    """Yield what was found, as rows."""
    flown, file, output = scenario(frames), folder / "orbit.toml", folder / "orbit.h5"
    file.write_text(flown.source.scenario, encoding="utf-8")
    print(f"orbit: {frames:,} frames, killed at a third", file=sys.stderr)
    first, killed, followed = watched(file, output, frames // 3)
    at_kill = first.frames[-1]
    yield "first frame on disk after", f"{first.first_s:.1f} s"
    yield "killed (SIGKILL)", f"at {at_kill:,} frames, exit {killed}; `info --follow` then says so, exit {followed}"
    print(f"orbit: resumed after {at_kill:,} frames", file=sys.stderr)
    second, ended, followed = watched(file, output, frames + 1, "--resume")
    yield "first new frame after `--resume`", f"{second.first_s:.1f} s, with {at_kill:,} frames taken over"
    yield "resumed run", f"exit {ended}; `info --follow`, exit {followed}"
    total_s = first.second[-1] + second.second[-1]
    yield "frames/s while flying, before and after", f"{first.rate_hz:.0f} and {second.rate_hz:.0f}"
    yield "all of it", f"{total_s / 60.0:.1f} min for {frames / RATE_HZ / 60.0:.1f} min flown"
    for word, seen in (("first", first), ("second", second)):
        early, late = seen.halves_mb()
        yield f"memory of the {word} run, a tenth of the way and at the end", f"{early:.0f} and {late:.0f} MB"
    follow_mb = [*first.follow_mb, *second.follow_mb]
    yield "memory of `info --follow`, at most", f"{max(follow_mb):.0f} MB"
    with rl.open(output) as recording:
        whole = np.array_equal(recording.frame_index[:], np.arange(frames))
    yield "the file", f"{output.stat().st_size / 1e9:.2f} GB, {output.stat().st_size / frames / 1e3:.1f} kB a frame"
    left = sorted(entry.name for entry in folder.iterdir() if entry not in (file, output))
    yield "every frame once, in order", "yes" if whole else "**no**"
    yield "left beside it", ", ".join(left) or "nothing"
    about = np.clip([0, at_kill - 1, at_kill, at_kill + 1, frames - 1], 0, frames - 1)
    chosen = np.unique([*about, *np.random.default_rng(7).integers(0, frames, SAMPLED - about.size)]).tolist()
    print(f"orbit: {len(chosen)} frames by themselves", file=sys.stderr)
    odd = different(flown, output, chosen)
    yield f"{len(chosen)} frames flown by themselves, bit for bit", f"**{odd} differ**" if odd else "equal"
    yield from reading(output, folder, frames)


def run(*, quick: bool, frames: int | None = None) -> Findings:
    """Return the table of the long run."""
    with tempfile.TemporaryDirectory() as folder:
        rows = list(measured(frames or (2_000 if quick else FRAMES), Path(folder)))
    of = "" if (frames or FRAMES) == FRAMES and not quick else f", its first {frames or 2_000:,} frames"
    return Findings({"orbit": table((f"an orbit at 20 Hz{of}", "measured"), rows)})
