"""`rso-lidar info --follow`: lines while a run goes on, and how it ends."""

import os
import signal
import subprocess
import sys
import time

import pytest

from rso_lidar.cli import main

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="locks and SIGKILL are POSIX")
COMMAND = [sys.executable, "-m", "rso_lidar"]


@pytest.fixture
def bench(text, tmp_path):
    path = tmp_path / "bench.toml"
    path.write_text(text, encoding="utf-8")
    return path


@pytest.fixture
def call(capsys):
    """Return a function that runs the command and gives status, standard output and the lines of standard error."""

    def run(*arguments):
        with pytest.raises(SystemExit) as left:
            main([str(argument) for argument in arguments])
        printed = capsys.readouterr()
        return left.value.code or 0, printed.out, printed.err.splitlines()

    return run


def appears(folder, start):
    """Wait until a file of that name is there."""
    until = time.monotonic() + 60
    while not any(name.startswith(start) for name in os.listdir(folder)):
        assert time.monotonic() < until
        time.sleep(0.01)


def test_a_run_followed_to_its_end(bench, tmp_path):
    output = tmp_path / "run.h5"
    many = ["--set", "time.duration_s=60", "--set", "lidar.receiver.n_rows=16", "--set", "lidar.receiver.n_cols=16"]
    flying = subprocess.Popen([*COMMAND, "run", str(bench), "-o", str(output), *many], stderr=subprocess.DEVNULL)
    try:
        appears(tmp_path, "run.h5.tmp-")
        follow = [*COMMAND, "info", str(output), "--follow", "--every", "0.1", "--timeout", "100"]
        done = subprocess.run(follow, capture_output=True, text=True, timeout=120)
        assert flying.wait(60) == 0
    finally:
        flying.kill()
        flying.wait()
    assert (done.returncode, done.stderr) == (0, "")
    first, *lines, last = done.stdout.splitlines()
    assert first.startswith(("following ", "waiting "))
    assert last == f"complete    {output} holds 300 frames"
    counts = [int(line.split()[1].rstrip(",")) for line in lines]
    assert counts == sorted(counts) and counts[-1] <= 300
    assert all("frames/s, at " in line and line.endswith(" of 60 s") for line in lines)


def test_a_run_that_is_killed(bench, tmp_path):
    output = tmp_path / "run.h5"
    flying = subprocess.Popen(
        [*COMMAND, "run", str(bench), "-o", str(output), "--set", "time.duration_s=6000"],
        stderr=subprocess.DEVNULL,
    )
    follow = None
    try:
        appears(tmp_path, "run.h5.tmp-")
        follow = subprocess.Popen(
            [*COMMAND, "info", str(output), "--follow", "--every", "0.05", "--timeout", "100"],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )
        follow.stdout.readline()
        assert follow.stdout.readline().startswith("frames ")
        flying.send_signal(signal.SIGKILL)
        flying.wait()
        said, error = follow.communicate(timeout=60)
    finally:
        for process in (flying, follow):
            if process is not None:
                process.kill()
                process.wait()
    assert follow.returncode == 1
    assert "complete" not in said
    assert error.startswith(f"error: {output}: the run that wrote it has ended after ") and error.count("\n") == 1
    assert f"go on with: rso-lidar run SCENARIO -o {output} --resume" in error


def test_time_is_up(bench, tmp_path):
    output = tmp_path / "run.h5"
    flying = subprocess.Popen(
        [*COMMAND, "run", str(bench), "-o", str(output), "--set", "time.duration_s=6000"],
        stderr=subprocess.DEVNULL,
    )
    try:
        appears(tmp_path, "run.h5.tmp-")
        follow = [*COMMAND, "info", str(output), "--follow", "--timeout", "0.3"]
        done = subprocess.run(follow, capture_output=True, text=True, timeout=120)
    finally:
        flying.kill()
        flying.wait()
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.splitlines()[-1].startswith("unfinished ")


def test_what_is_complete_is_said_at_once(call, bench, tmp_path):
    output = tmp_path / "run.h5"
    assert call("run", bench, "-o", output, "--frames", "0:3")[0] == 0
    status, said, errors = call("info", output, "--follow")
    assert (status, errors) == (0, [])
    assert said.splitlines()[-1] == f"complete    {output} holds 3 frames"


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--follow"], "there is no such file; record it first"),
        (["--follow", "--every", "0"], "--every 0: needs seconds above 0"),
        (["--follow", "--every", "nan"], "--every nan: needs seconds above 0"),
        (["--follow", "--timeout", "-1"], "--timeout -1: needs seconds above 0"),
        (["--timeout", "3"], "--every and --timeout: are for --follow"),
        (["--follow", "--every", "soon"], "is not a valid float"),
    ],
)
def test_bad_input(call, tmp_path, options, message):
    status, said, errors = call("info", tmp_path / "no.h5", *options)
    assert (status, said, len(errors)) == (2, "", 1)
    assert message in errors[0]
