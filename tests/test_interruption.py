"""A signal ends a command at any instant: status, one line, no process left, and frames that go on."""

import contextlib
import importlib.util
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from rso_lidar import export, interruption

SCRIPT = Path(sys.executable).with_name("rso-lidar")
pytestmark = pytest.mark.skipif(not Path("/proc/self").is_dir(), reason="looks at processes in /proc")


@pytest.fixture
def bench(text, tmp_path):
    path = tmp_path / "bench.toml"
    path.write_text(text.replace("duration_s    = 2", "duration_s    = 2000"), encoding="utf-8")  # 10,000 frames
    return path


# A shell starts what it runs in the background with SIGINT ignored, nohup with SIGHUP, and these tests may be run so.
LISTENING = """
import os, signal, sys
for number in (signal.SIGINT, signal.SIGHUP, signal.SIGTERM):
    signal.signal(number, signal.SIG_DFL)
os.execvp(sys.argv[1], sys.argv[1:])
"""


def started(bench, *options, command=(SCRIPT,), last=signal.SIGHUP, **environment):
    """Start a run, and return its process once it has its own handlers, of which `last` is the last."""
    words = [sys.executable, "-c", LISTENING, *command, "run", bench, "-o", bench.with_name("out.h5"), *options]
    process = subprocess.Popen(
        [str(word) for word in words],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
        env={**os.environ, **environment},
    )
    wait_until(lambda: catches(process.pid, last) or process.poll() is not None)
    return process


def wait_until(happened):
    while not happened():  # a hang is ended by the limit on each test, which scales with the load of the machine
        time.sleep(0.002)


def catches(pid, number):
    """Return whether a process has a handler for a signal."""
    with contextlib.suppress(OSError):
        for line in Path(f"/proc/{pid}/status").read_text().splitlines():
            if line.startswith("SigCgt:"):
                return bool(int(line.split()[1], 16) >> (number - 1) & 1)
    return False


def descendants(pid):
    """Return the processes that a process has started, and those that these have."""
    parents = {}
    for entry in Path("/proc").glob("[0-9]*"):
        with contextlib.suppress(OSError):
            parents[int(entry.name)] = int((entry / "stat").read_text().rpartition(")")[2].split()[1])
    found = {pid}
    while more := {child for child, parent in parents.items() if parent in found} - found:
        found |= more
    return found - {pid}


def is_running(pid):
    with contextlib.suppress(OSError):
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    return False


def ended(process, number=signal.SIGINT):
    """Send a signal; return the last line of standard error once it is sure that all was as it must be."""
    children = descendants(process.pid)
    process.send_signal(number)
    _, said = process.communicate()
    assert process.returncode == 128 + number, said
    ours = [line for line in said.splitlines() if not line.startswith(("frame ", "compiling "))]
    assert len(ours) == 1, said
    wait_until(lambda: not any(is_running(child) for child in children))
    return ours[0]


NEEDS_DASK = pytest.mark.skipif(
    importlib.util.find_spec("distributed") is None, reason="needs the extra dask: pip install 'rso-lidar[dask]'"
)
WAYS = [
    (),
    pytest.param(("--workers", "2"), marks=pytest.mark.slow),
    pytest.param(("--engine", "dask", "--workers", "2"), marks=(pytest.mark.slow, NEEDS_DASK)),
]


@pytest.mark.parametrize("options", WAYS, ids=["threads", "workers", "dask"])
def test_ctrl_c_at_any_instant_of_a_run(bench, options):
    rng = np.random.default_rng(1420)
    for number in range(5):
        process = started(bench, *options)
        time.sleep(0.0 if number == 0 else rng.uniform(0.0, 2.5))  # imports, the scenario, workers that start, frames
        said = ended(process)
        assert said.startswith("interrupted")
        assert not [entry.name for entry in bench.parent.iterdir() if entry.name.endswith((".lock", ".starting"))]


@pytest.mark.slow
def test_ctrl_c_while_numba_compiles(bench, tmp_path):
    process = started(bench, NUMBA_CACHE_DIR=str(tmp_path / "cache"))
    assert process.stderr.readline().startswith("compiling ")
    time.sleep(np.random.default_rng(7).uniform(0.0, 1.0))
    assert ended(process).startswith("interrupted: no frame was recorded")


def frames_in(temporary):
    with export.open(temporary) as recording:
        return len(recording)


@pytest.mark.slow
@pytest.mark.parametrize("options", WAYS, ids=["threads", "workers", "dask"])
def test_sigterm_keeps_the_frames_as_ctrl_c_does_and_the_run_goes_on(bench, options):
    output = bench.with_name("out.h5")
    process = started(bench, *options)
    wait_until(lambda: list(bench.parent.glob("out.h5.tmp-????????")))
    temporary = next(bench.parent.glob("out.h5.tmp-????????"))
    wait_until(lambda: frames_in(temporary) > 2)
    said = ended(process, signal.SIGTERM)
    kept = frames_in(temporary)
    told = int(said.removeprefix("terminated: ").split()[0])
    assert 0 <= kept - told <= 1  # a frame may be whole before it is counted
    assert f"of 10000 frames are kept in {temporary}; continue with --resume" in said
    assert sorted(entry.name for entry in bench.parent.iterdir()) == [bench.name, temporary.name]
    assert not output.exists()
    inode = temporary.stat().st_ino
    process = started(bench, "--resume", *options)
    wait_until(lambda: temporary.stat().st_ino != inode)  # the frames are copied
    said = ended(process)
    assert f"{temporary}" in said and "continue with --resume" in said
    assert frames_in(temporary) >= kept > 2


def test_as_a_module_too(bench):
    process = started(bench, command=(sys.executable, "-m", "rso_lidar"))
    assert ended(process).startswith("interrupted")


def test_a_signal_that_is_ignored_stays_ignored(bench):
    """As under nohup: the shell ignores the signal, and what it starts goes on when the terminal is closed."""
    process = started(bench, command=("sh", "-c", 'trap "" HUP; exec "$@"', "sh", SCRIPT), last=signal.SIGTERM)
    process.send_signal(signal.SIGHUP)
    time.sleep(0.2)
    assert process.poll() is None
    assert ended(process).startswith("interrupted")


LIBRARY = """
import signal, sys, threading
before = [signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)]
import rso_lidar
assert before == [signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)]
assert signal.set_wakeup_fd(-1) == -1
assert threading.active_count() == 1
print("untouched")
"""


def test_a_program_that_imports_the_package_keeps_its_signals(tmp_path):
    script = tmp_path / "program.py"
    script.write_text(LIBRARY)
    done = subprocess.run([sys.executable, script, "run"], capture_output=True, text=True)
    assert (done.stdout, done.stderr) == ("untouched\n", "")


def test_what_a_command_would_remove_is_removed(tmp_path):
    draft = tmp_path / "x.part"
    with interruption.remove_on_signal(draft.unlink):
        assert interruption._removals == [draft.unlink]
    assert interruption._removals == []
    with interruption.make_temporary_folder() as folder:
        Path(folder, "file").touch()
        assert len(interruption._removals) == 1
    assert not Path(folder).exists()


def test_the_line_says_what_is_kept(monkeypatch):
    monkeypatch.setattr(interruption, "_advice", None)
    assert interruption.format_ending(signal.SIGINT) == "interrupted"
    interruption.set_advice(lambda: "3 of 4\nframes")
    assert interruption.format_ending(signal.SIGTERM) == "terminated: 3 of 4 frames"
