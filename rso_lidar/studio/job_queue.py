"""The queue of jobs: commands of the command line that wait, run in processes of their own, and end."""

from __future__ import annotations

import contextlib
import json
import os
import re
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass, field, fields, replace
from typing import IO

from rso_lidar.errors import RsoLidarError, ScenarioError
from rso_lidar.export import FORMATS, read_status
from rso_lidar.files import write_text
from rso_lidar.studio.model.recording_list import RECORDINGS
from rso_lidar.studio.model.root_folder import Folder
from rso_lidar.user_settings import NO_FOLDERS, USER_SETTINGS

_JOURNAL = ".rso_lidar_studio.json"  # jobs that are not done, for the next start of the studio
_POLL_S, _LAST_BYTES, _MOST_JOBS, _MOST_JOURNAL_BYTES = 0.5, 4000, 100, 2**20
_STILL_RUNNING = "still running, begun by an earlier studio"
_STEPS = re.compile(r"^\w+ (\d+)/(\d+)(?:, ([\d.]+) \w+/s|$)")  # lines of progress of the command line
# Whoever has the password of a studio may write a file into a folder that its user trusts.
_NO_TRUST = {setting.variable: NO_FOLDERS for setting in USER_SETTINGS.values() if setting.kind == "folders"}
_EXPORT_SUFFIXES = tuple(suffix for form in FORMATS.values() for suffix in form.suffixes)


@dataclass(frozen=True)
class JobKind:
    """A kind of job: its title, its command with the two files, and the suffixes of the files it reads and makes."""

    title: str
    command: str
    reads: tuple[str, ...]
    makes: tuple[str, ...]


KINDS = {
    "run": JobKind("Run", "run {source} -o {output}", (".toml",), RECORDINGS),
    "timeline": JobKind("Timeline", "timeline {source} -o {output}", (".toml",), (".png", ".csv", ".svg")),
    "budget": JobKind("Link budget", "budget {source} -o {output}", (".toml",), (".png", ".csv", ".svg")),
    "trade": JobKind("Trade study", "trade {source} -o {output}", (".toml",), (".html",)),
    "dataset": JobKind("Dataset", "dataset make {source} -o {output}", (".toml",), ("",)),
    "export": JobKind("Export", "export {source} --to {output}", RECORDINGS, _EXPORT_SUFFIXES),
    "sheet": JobKind("Contact sheet", "plot {source} -o {output}", RECORDINGS, (".png",)),
    "curves": JobKind("Curves", "plot {source} --curves -o {output}", RECORDINGS, (".png", ".svg")),
    "animate": JobKind("Animation", "animate {source} {output}", RECORDINGS, (".gif", ".mp4")),
    "track": JobKind("Tracking report", "track {source} -o {output}", RECORDINGS, (".png", ".csv")),
}


FLIES_SCENARIO = ("run", "timeline", "budget")  # kinds whose source is a scenario


@dataclass(frozen=True)
class JobRequest:
    """What a user asks for: names in the folder, and options of a run as the command line takes them."""

    kind: str
    source: str
    output: str
    frames: str = ""
    seed: str = ""
    keep: str = ""
    overwrite: bool = False
    resume: bool = False

    @property
    def is_plain(self) -> bool:
        """Whether all its values have the types that they are declared with, which a damaged journal may not."""
        return all(type(getattr(self, declared.name)).__name__ == declared.type for declared in fields(self))

    def command(self) -> list[str]:
        """Return the command. Python does not import from the working folder (-P), which may hold any file."""
        source, output = (
            f"./{name}" if name.startswith("-") else name for name in (self.source, self.output)
        )  # no options
        words = [word.format(source=source, output=output) for word in KINDS[self.kind].command.split()]
        given = {"frames": self.frames, "seed": self.seed, "keep": self.keep} if self.kind == "run" else {}
        words += [f"--{name}={value}" for name, value in given.items() if value]
        words += ["--overwrite"] * (self.overwrite and self.kind != "dataset")
        words += ["--resume"] * (self.resume and self.kind in ("run", "dataset"))
        return [sys.executable, "-P", "-m", "rso_lidar", *words]


@dataclass(eq=False)
class Job:
    """One job: `state` is waiting, running, done, failed or stopped; `message` is the last line of its command."""

    request: JobRequest
    state: str = "waiting"
    message: str = ""
    done: int = 0
    total: int = 0  # 0: unknown
    rate_hz: float = 0.0
    is_stopping: bool = False
    process: subprocess.Popen[bytes] | None = field(default=None, repr=False)

    @property
    def is_active(self) -> bool:
        """Whether it waits or runs."""
        return self.state in ("waiting", "running")


class JobQueue:
    """Jobs in the order in which they were given; one runs at a time, because a command uses all cores.

    Jobs go on when the studio crashes. Those that are not done stand in a hidden file of the folder, so that the next
    studio can resume them. When the studio ends cleanly, `close` stops them; a run keeps the frames that it has made.
    """

    def __init__(self, folder: Folder, check: Callable[[JobRequest], int] = lambda _: 0) -> None:
        """Begin with the jobs that an earlier studio left.

        Parameters
        ----------
        check : called just before a job starts; it raises an error where the job must not start, else returns its number
            of frames (0: unknown)
        """
        self.folder, self._check = folder, check
        self._lock, self._journal_lock = threading.RLock(), threading.Lock()
        self.jobs = [
            Job(
                request,
                "stopped",
                _STILL_RUNNING if self._has_status(request, "running") else "left by an earlier studio",
            )
            for request in self._read_journal()
        ]
        self._worker: threading.Thread | None = None
        self._is_closing = False

    @property
    def is_active(self) -> bool:
        """Whether a job waits or runs."""
        return any(job.is_active for job in self.jobs)

    def add(self, request: JobRequest) -> Job:
        """Queue a job.

        Raises
        ------
        ScenarioError
            If a name is not allowed, the input is missing, or the output exists or belongs to another job.
        """
        kind = KINDS[request.kind]
        if not self.folder.resolve(request.source, kind.reads).exists():
            raise ScenarioError(f"{request.source}: is not in the folder; save it first")
        output = self.folder.resolve(request.output, kind.makes)
        if output.exists() and not (request.overwrite or request.resume):
            raise ScenarioError(f"{request.output}: exists; give another name, or allow it to be replaced")
        with self._lock:
            if any(job.is_active and job.request.output == request.output for job in self.jobs):
                raise ScenarioError(f"{request.output}: another job is to write it; give another name")
            if len(self.jobs) >= _MOST_JOBS:
                raise ScenarioError(f"the list holds {_MOST_JOBS} jobs; remove some that have ended")
            job = Job(request)
            self.jobs.append(job)
            if self._worker is None:
                self._worker = threading.Thread(target=self._work, name="jobs", daemon=True)
                self._worker.start()
        self._save_journal()
        return job

    def stop(self, job: Job) -> None:
        """Stop a job; a run keeps its frames."""
        with self._lock:
            if job.is_active:
                job.is_stopping, job.message = True, "stopping"
                if job.process is not None:
                    job.process.terminate()
                elif job.state == "waiting":
                    job.state, job.message = "stopped", "stopped before it began"

    def resume(self, job: Job) -> Job:
        """Queue a job again in place of one that has ended, so that it continues where it can.

        Raises
        ------
        ScenarioError
            As for `add`; and if the process of an earlier studio still writes the recording.
        """
        if job.is_active:
            return job
        if self._has_status(job.request, "running"):
            raise ScenarioError(f"{job.request.output}: {_STILL_RUNNING}; it can be resumed if that ends early")
        new_job = self.add(replace(job.request, resume=job.request.kind in ("run", "dataset")))
        with self._lock:  # only now: what cannot be queued again stays in the list
            self.jobs.remove(new_job)
            self.jobs[self.jobs.index(job)] = new_job
        self._save_journal()
        return new_job

    def remove(self, job: Job) -> None:
        """Remove a job that has ended from the list; its files stay."""
        with self._lock:
            if not job.is_active and job in self.jobs:
                self.jobs.remove(job)
        self._save_journal()

    def close(self) -> None:
        """Stop all jobs, because the studio ends; they can be resumed."""
        self._is_closing = True
        for job in list(self.jobs):
            self.stop(job)
        for job in self.jobs:
            if job.process is not None:
                with contextlib.suppress(subprocess.TimeoutExpired):
                    job.process.wait(3.0)

    def _work(self) -> None:
        """Run waiting jobs one after the other, until none is left."""
        while True:
            with self._lock:
                job = next((job for job in self.jobs if job.state == "waiting"), None)
                if job is None or self._is_closing:
                    self._worker = None
                    return
                job.state = "running"
            try:
                self._run(job)
            except RsoLidarError as error:
                self._end(job, "failed", str(error))
            except OSError as error:
                self._end(job, "failed", f"{error.filename or job.request.output}: {error.strerror}; check the folder")
            except Exception as error:
                self._end(job, "failed", f"{type(error).__name__}: {error}")

    def _run(self, job: Job) -> None:
        """Run a job in a session of its own, which signals to the studio do not reach."""
        job.total = self._check(job.request)
        with tempfile.TemporaryFile("a+b") as log:  # not a pipe: a process would fail with the studio that reads it
            with self._lock:
                if job.is_stopping:
                    self._end(job, "stopped", "stopped before it began")
                    return
                job.process = subprocess.Popen(
                    job.request.command(), cwd=self.folder.path, stdin=subprocess.DEVNULL, stdout=log,
                    stderr=subprocess.STDOUT, start_new_session=True,
                    env={**os.environ, **_NO_TRUST},
                )  # fmt: skip
            first: tuple[float, int] | None = None
            while True:
                with contextlib.suppress(subprocess.TimeoutExpired):
                    code = job.process.wait(_POLL_S)
                    break
                job.message = "stopping" if job.is_stopping else _read_last_line(log)
                self._measure(job)
                first = first or ((time.monotonic(), job.done) if job.done else None)
                if first and job.done > first[1] and job.request.kind == "run":
                    job.rate_hz = (job.done - first[1]) / (time.monotonic() - first[0])
            self._measure(job)
            line = _read_last_line(log)
        if code < 0 and not job.is_stopping:
            is_kept = job.request.kind == "run" and job.done
            kept = f"; {job.done} frames are kept, resume it" if is_kept else "; start it again"
            line = f"the process was killed ({signal.Signals(-code).name}){kept}"
        line = f"{job.done:,} frames" if code == 0 and job.request.kind == "run" else line
        self._end(job, "done" if code == 0 else "stopped" if job.is_stopping else "failed", line)

    def _end(self, job: Job, state: str, message: str) -> None:
        """Note that a job has ended."""
        with self._lock:
            job.state, job.message = state, message or state
        if not self._is_closing:
            self._save_journal()

    def _measure(self, job: Job) -> None:
        """Read the progress of a run from its recording, of other jobs from their lines."""
        if job.request.kind == "run":
            with contextlib.suppress(RsoLidarError, OSError):
                job.done = read_status(self.folder.path / job.request.output).frames
        elif match := _STEPS.search(job.message):
            job.done, job.total, job.rate_hz = int(match[1]), int(match[2]), float(match[3] or 0.0)

    def _read_journal(self) -> list[JobRequest]:
        """Read the jobs that an earlier studio left; damaged entries are left out."""
        requests, entries = list[JobRequest](), []
        with contextlib.suppress(OSError, ValueError, RecursionError), (self.folder.path / _JOURNAL).open("rb") as file:
            entries = json.loads(file.read(_MOST_JOURNAL_BYTES))
        for entry in entries[:_MOST_JOBS] if isinstance(entries, list) else []:
            with contextlib.suppress(TypeError, RsoLidarError):
                request = JobRequest(**entry)
                if request.is_plain and request.kind in KINDS and not self._has_status(request, "complete"):
                    self.folder.resolve(request.output, KINDS[request.kind].makes)
                    requests.append(request)
        return requests

    def _has_status(self, request: JobRequest, name: str) -> bool:
        """Return whether the recording of a run is `running`, so that a process writes it, or `complete`."""
        with contextlib.suppress(RsoLidarError, OSError):
            status = read_status(self.folder.resolve(request.output, RECORDINGS))
            return request.kind == "run" and bool(getattr(status, name))
        return False

    def _save_journal(self) -> None:
        """Write the jobs that are not done, outside the lock of the queue: `close` may interrupt it in a signal."""
        with self._journal_lock, contextlib.suppress(RsoLidarError, OSError):  # a job runs where it cannot be written
            left = [asdict(job.request) for job in list(self.jobs) if job.state != "done"]
            write_text(self.folder.path / _JOURNAL, json.dumps(left, indent=1), overwrite=True)


def _read_last_line(log: IO[bytes]) -> str:
    """Return the last line of an output that may still grow."""
    log.seek(max(os.fstat(log.fileno()).st_size - _LAST_BYTES, 0))
    lines = log.read().decode("utf-8", "replace").split("\n")
    return next((line.strip() for line in reversed(lines) if line.strip()), "")
