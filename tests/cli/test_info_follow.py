"""`rso-lidar info --follow`: lines while a run goes on, and how it ends."""

import subprocess
import sys
import threading
import time

import pytest

from rso_lidar import export
from rso_lidar.cli.info import follow_recording
from rso_lidar.errors import RunError
from rso_lidar.files import is_locked

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="Windows renames no open file and has no SIGKILL")


@pytest.fixture
def call(rso_lidar):
    return rso_lidar


@pytest.fixture
def fly(bench, tmp_path):
    """Return a function that starts a run in another process, and gives it back when it has begun."""
    flying = []

    def start(seconds):
        settings = ["--set", f"time.duration_s={seconds}", "--set", "lidar.receiver.n_rows=8", "--threads", "1"]
        command = [sys.executable, "-m", "rso_lidar", "run", str(bench), "-o", str(tmp_path / "run.h5"), *settings]
        flying.append(subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL))
        while not any(is_locked(lock) for lock in tmp_path.glob(".run.h5.tmp-*.lock")):
            assert flying[-1].poll() is None, "it ended before it began to record"
            time.sleep(0.01)
        return flying[-1]

    yield start
    for process in flying:
        process.kill()
        process.wait()


@pytest.mark.slow
def test_a_run_followed_to_its_end(call, fly, tmp_path):
    output = tmp_path / "run.h5"
    flying = fly(60)
    status, said, errors = call("info", output, "--follow", "--every", "0.05", "--timeout", "100000")
    assert flying.wait() == 0
    assert (status, errors) == (0, [])
    first, *lines, last = said.splitlines()
    assert first.startswith(("following   run.h5.tmp-", "waiting     run.h5.tmp-"))
    assert last == f"complete    {output} holds 300 frames"
    counts = [int(line.split()[1].rstrip(",")) for line in lines]
    assert counts
    assert counts == sorted(counts) and counts[-1] <= 300
    assert all("frames/s, at " in line and line.endswith(" of 60 s") for line in lines)


@pytest.mark.slow
def test_a_run_that_is_killed(fly, tmp_path, capsys):
    output = tmp_path / "run.h5"
    flying = fly(100_000)

    def kill():
        while not list(tmp_path.glob("run.h5.tmp-????????")):
            time.sleep(0.02)
        time.sleep(0.2)
        flying.kill()

    killer = threading.Thread(target=kill)
    killer.start()
    with pytest.raises(RunError) as ended:
        follow_recording(output, 0.05, 100_000.0)
    killer.join()
    assert "complete" not in capsys.readouterr().out
    frames = len(export.open(next(tmp_path.glob("run.h5.tmp-*"))))
    assert str(ended.value) == (
        f"{output}: the run that wrote it has ended after {frames} frames, which are in "
        f"{next(tmp_path.glob('run.h5.tmp-*')).name}; continue with: rso-lidar run SCENARIO -o {output} --resume, "
        "and the same --set, --seed, --frames and --keep as before"
    )


@pytest.mark.slow
def test_time_is_up(call, fly, tmp_path):
    fly(100_000)
    status, said, errors = call("info", tmp_path / "run.h5", "--follow", "--timeout", "0.3")
    assert (status, errors) == (0, [])
    assert said.splitlines()[-1].startswith("unfinished ")


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
        (["--follow", "--every", "soon"], "unable to parse"),
    ],
)
def test_bad_input(call, tmp_path, options, message):
    status, said, errors = call("info", tmp_path / "no.h5", *options)
    assert (status, said, len(errors)) == (2, "", 1)
    assert message in errors[0]
