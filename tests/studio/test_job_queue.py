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
from rso_lidar.export import RecordingStatus
from rso_lidar.studio.job_queue import KINDS, Job, JobQueue, JobRequest
from rso_lidar.studio.model.recording_list import RecordingList
from rso_lidar.studio.model.root_folder import Folder


@pytest.fixture
def folder(tmp_path: Path) -> Folder:
    """Return a folder with a short scenario."""
    rl_scenario = (Path(__file__).parents[2] / "examples" / "bench_plate.toml").read_text(encoding="utf-8")
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


@pytest.mark.slow
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


@pytest.mark.slow
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


@pytest.mark.parametrize(
    "text",
    ["", "{", "5", '{"a": 1}', "[[[[", '[{"kind": "run", "source": "a.toml", "output": "../x.h5"}]', "[" * 100_000],
)
def test_a_damaged_journal_loses_no_other_entry(folder: Folder, text: str) -> None:
    journal = folder.path / ".rso_lidar_studio.json"
    journal.write_text(text, encoding="utf-8")
    assert JobQueue(folder).jobs == []
    good = '{"kind": "run", "source": "short.toml", "output": "a.h5"}'
    journal.write_text(f'[5, {{"kind": "run"}}, {{"kind": 7, "source": "", "output": ""}}, {good}]', encoding="utf-8")
    assert [job.request.output for job in JobQueue(folder).jobs] == ["a.h5"]


def test_an_unexpected_error_ends_its_job_only(folder: Folder) -> None:
    def check(request: JobRequest) -> int:
        if request.output == "a.h5":
            raise ZeroDivisionError("by a fault")
        return 1

    queue = JobQueue(folder, check)
    jobs = [queue.add(JobRequest("run", "short.toml", f"{name}.h5", frames="0:1")) for name in "ab"]
    wait(jobs[1], "done")
    assert (jobs[0].state, jobs[0].message) == ("failed", "ZeroDivisionError: by a fault")
    again = queue.resume(jobs[0])
    assert queue.jobs.index(again) == 0
    wait(again, "failed")


def test_a_run_that_goes_on_without_its_studio_is_not_begun_twice(
    folder: Folder, monkeypatch: pytest.MonkeyPatch
) -> None:
    from rso_lidar.studio import job_queue as module

    (folder.path / ".rso_lidar_studio.json").write_text(
        '[{"kind": "run", "source": "short.toml", "output": "a.h5"}]', encoding="utf-8"
    )
    output = folder.path / "a.h5"
    running = RecordingStatus(output, output, running=True, complete=False)
    monkeypatch.setattr(module, "read_status", lambda path: running)
    (job,) = (queue := JobQueue(folder)).jobs
    assert job.message == "still running, begun by an earlier studio"
    with pytest.raises(ScenarioError, match=r"a\.h5: still running"):
        queue.resume(job)


@pytest.mark.parametrize("kind", KINDS)
def test_no_job_runs_code_that_a_file_names(kind: str) -> None:
    assert not any(word.startswith("--trust") for word in JobRequest(kind, "in.toml", "out.png").command())


def test_no_job_trusts_the_folders_of_the_users_settings() -> None:
    from rso_lidar.studio.job_queue import _NO_TRUST

    assert _NO_TRUST == {"RSO_LIDAR_TRUST_CODE": "none", "RSO_LIDAR_TRUST_FMU": "none"}
