"""The queue of jobs: runs equal those of the command line, one after the other, stopped, resumed, killed and refused."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

import rso_lidar as rl
from rso_lidar.errors import ScenarioError
from rso_lidar.studio.jobs.queue import KINDS, Job, JobQueue, JobRequest
from rso_lidar.studio.jobs.recordings import RecordingList
from rso_lidar.studio.root_folder import Folder


@pytest.fixture
def folder(tmp_path: Path) -> Folder:
    """Return a folder with a short scenario."""
    rl_scenario = (Path(__file__).parents[3] / "examples" / "bench_plate.toml").read_text(encoding="utf-8")
    (tmp_path / "short.toml").write_text(rl_scenario, encoding="utf-8")
    return Folder(tmp_path)


def wait(job: Job, *states: str, limit_s: float = 120.0) -> None:
    """Wait until a job has one of some states."""
    end = time.monotonic() + limit_s
    while job.state not in states:
        assert time.monotonic() < end, f"{job.state}: {job.message}"
        time.sleep(0.02)


def read(path: Path) -> dict[str, np.ndarray]:
    """Read all arrays of a recording."""
    with rl.open(path) as recording:
        return {name: recording.dataset(name)[:] for name in recording.paths}


def assert_equal(one: Path, other: Path) -> None:
    """Assert that two recordings hold the same bytes in their arrays."""
    first, second = read(one), read(other)
    assert first.keys() == second.keys()
    for name, values in first.items():
        assert values.tobytes() == second[name].tobytes(), name


def test_jobs_run_one_after_the_other_and_equal_the_command_line(folder: Folder) -> None:
    queue = JobQueue(folder, lambda request: 3)
    jobs = [queue.add(JobRequest("run", "short.toml", f"{name}.h5", frames="0:3", seed="7")) for name in "ab"]
    wait(jobs[0], "done")
    assert jobs[1].state in ("waiting", "running")
    wait(jobs[1], "done")
    assert jobs[0].done == jobs[0].total == 3
    command = [sys.executable, "-m", "rso_lidar", "run", "short.toml", "-o", "c.h5", "--frames", "0:3", "--seed", "7"]
    subprocess.run(command, cwd=folder.path, check=True, capture_output=True)
    for name in "ab":
        assert_equal(folder.path / f"{name}.h5", folder.path / "c.h5")
    assert [status.complete for status in RecordingList(folder).read()] == [True] * 3


def test_a_stopped_and_a_killed_run_keep_their_frames_and_resume(folder: Folder) -> None:
    queue = JobQueue(folder)
    job = queue.add(JobRequest("run", "short.toml", "stopped.h5"))
    for end in ("stopped", "failed"):
        before = job.done
        wait_for_frames(job, before)
        if end == "stopped":
            queue.stop(job)
        else:
            assert job.process is not None
            os.kill(job.process.pid, signal.SIGKILL)
        wait(job, end)
        assert f"{job.done} " in job.message
        assert "kept" in job.message
        assert not (folder.path / "stopped.h5").exists()
        assert JobQueue(folder).jobs[0].request.output == "stopped.h5"  # what a restarted studio finds
        job = queue.resume(job)
    wait(job, "done")
    whole = queue.add(JobRequest("run", "short.toml", "whole.h5"))
    wait(whole, "done")
    assert_equal(folder.path / "stopped.h5", folder.path / "whole.h5")


def wait_for_frames(job: Job, before: int) -> None:
    """Wait until a run has written more frames than before."""
    end = time.monotonic() + 120.0
    while job.done <= before and job.is_active:
        assert time.monotonic() < end
        time.sleep(0.01)


def test_a_job_that_must_not_start_says_why(folder: Folder) -> None:
    def refuse(request: JobRequest) -> int:
        raise ScenarioError(f"{request.source}: names code")

    job = JobQueue(folder, refuse).add(JobRequest("run", "short.toml", "a.h5"))
    wait(job, "failed")
    assert job.message == "short.toml: names code"
    assert job.process is None


def test_names_outside_the_folder_and_existing_outputs_are_refused(folder: Folder) -> None:
    queue = JobQueue(folder)
    (folder.path / "old.h5").write_bytes(b"precious")
    for source, output, words in (
        ("../short.toml", "a.h5", "not a file name inside"),
        ("short.toml", "/a.h5", "not a file name inside"),
        ("short.toml", "old.h5", "exists"),
        ("none.toml", "a.h5", "save it first"),
        ("short.toml", "a.sh", "must end with"),
    ):
        with pytest.raises(ScenarioError, match=words):
            queue.add(JobRequest("run", source, output))
    assert (folder.path / "old.h5").read_bytes() == b"precious"
    assert not queue.jobs


def test_options_are_values_and_never_words_of_their_own() -> None:
    command = JobRequest("run", "-x.toml", "a.h5", frames="0:3 --trust-fmu", keep="--live").command()
    assert command[1:3] == ["-P", "-m"]  # nothing in the folder is imported
    assert "./-x.toml" in command
    assert "--frames=0:3 --trust-fmu" in command
    assert "--trust-fmu" not in command
    assert "--live" not in command


@pytest.mark.parametrize("kind", KINDS)
def test_each_kind_makes_a_command_with_its_two_files(kind: str) -> None:
    command = JobRequest(kind, "in.toml", "out.png").command()
    assert "in.toml" in command
    assert "out.png" in command


def test_a_folder_that_has_gone_is_said(folder: Folder) -> None:
    queue = JobQueue(folder, lambda _: folder.path.rename(folder.path.with_name("gone")) and 0)
    job = queue.add(JobRequest("run", "short.toml", "a.h5"))
    wait(job, "failed")
    assert "No such file" in job.message
