"""What a session of tests does beside the tests.

A test that hangs fails alone, soon and in words. A failure is printed before the other tests have ended. A quick test that
takes long is listed, and fails if it takes far too long. Plugins of other packages are not loaded.
"""

import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
CONFTEST = """
import pytest
from tests import limits

@pytest.hookimpl(trylast=True)
def pytest_configure(config):
    limits.watch(config)
"""
OWN = ["-p", "xdist", "-p", "no:cacheprovider", "-o", "addopts=", "-o", "markers=slow: by nature", "--rootdir", "."]


def start(folder, text, *options, limit_s=300.0, quick_s=30.0):
    (folder / "conftest.py").write_text(CONFTEST)
    (folder / "test_it.py").write_text(text)
    variables = {
        "RSO_LIDAR_TEST_LIMIT_S": str(limit_s),
        "RSO_LIDAR_QUICK_TEST_S": str(quick_s),
        "PYTHONPATH": str(ROOT),
        "NUMBA_CACHE_DIR": str(folder),  # tests beside may compile kernels meanwhile
    }
    (folder / "old.nbi").touch()
    os.utime(folder / "old.nbi", (0, 0))
    return subprocess.Popen(
        [sys.executable, "-m", "pytest", *OWN, *options, "."],
        cwd=folder,
        env=os.environ | variables,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )


HANGS = """
import ctypes, threading

def test_hangs():
    threading.Event().wait()

def test_next():
    pass

def test_holds():
    ctypes.PyDLL(None).pause()  # in C, with the interpreter's lock

def test_last():
    pass
"""


@pytest.mark.skipif(sys.platform == "win32", reason="Windows interrupts no test")
def test_a_test_that_hangs_fails_and_the_next_one_runs(tmp_path):
    with start(tmp_path, HANGS, "-n", "1", limit_s=0.2) as session:
        said = session.stdout.read()
    assert "2 failed, 2 passed" in said
    assert "took over 0.2 s of an idle machine" in said
    assert "test_hangs: over 0.2 s of an idle machine, and stands here:" in said and "threading.py" in said
    assert "worker 'gw0' crashed while running 'test_it.py::test_holds'" in said
    assert "Timeout (" in said and "in test_holds" in said


FAILS = """
import os, time

def test_fails():
    assert "this" == "that"

def test_waits():
    while not os.path.exists("go"):
        time.sleep(0.01)
"""


def test_a_failure_is_printed_while_others_run(tmp_path):
    with start(tmp_path, FAILS, "-n", "2") as session:
        for line in session.stdout:
            if "'this' == 'that'" in line:
                (tmp_path / "go").touch()  # only now can the other one end
                break
        rest = session.stdout.read()
    assert "1 failed, 1 passed" in rest


LONG = """
import subprocess, sys, time
import pytest
from tests import limits

WORK = "import time\\nwhile time.process_time() < {}: pass"

@pytest.fixture
def made():
    exec(WORK.format(time.process_time() + 0.4))

def test_quick(made):
    pass

def test_at_limit(monkeypatch):
    monkeypatch.setattr(limits, "slowness", lambda: 1.0)
    exec(WORK.format(time.process_time() + 0.3))

def test_in_process():
    subprocess.run([sys.executable, "-c", WORK.format(1.6 * limits.slowness())])

@pytest.mark.slow
def test_slow():
    subprocess.run([sys.executable, "-c", WORK.format(0.5)])
"""


def test_quick_tests_that_take_long_are_listed_and_fail(tmp_path):
    """One takes 1.5 times the limit, one eight times: from five on it fails, with room for a machine whose speed changes.

    A fixture and a test marked slow may take longer.
    """
    with start(tmp_path, LONG, "-n", "1", quick_s=0.2) as session:
        said = session.stdout.read()
    assert "1 failed, 3 passed" in said
    assert "s of CPU, over 0.2 s: make it cheaper, or mark it slow" in said
    _, _, listed = said.partition("over 0.2 s of CPU without the mark slow ===")
    names = [line.split("::")[1] for line in listed.splitlines() if "s  test_it.py::" in line]
    assert names == ["test_in_process", "test_at_limit"]


def test_plugins_of_other_packages_are_not_loaded(tmp_path):
    """Neither here, nor where a test starts pytest. Some packages bring one that fails, or warns as an error."""
    about = tmp_path / "old_plugin-1.0.dist-info"
    about.mkdir()
    (about / "METADATA").write_text("Metadata-Version: 2.1\nName: old-plugin\nVersion: 1.0\n")
    (about / "entry_points.txt").write_text("[pytest11]\nold = old_plugin\n")
    (tmp_path / "old_plugin.py").write_text("raise RuntimeError('loaded')\n")
    environment = {name: value for name, value in os.environ.items() if not name.startswith("PYTEST_")}
    environment["PYTHONPATH"] = f"{ROOT}{os.pathsep}{tmp_path}"
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider"]
    elsewhere = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True)
    assert "RuntimeError: loaded" in elsewhere.stderr
    command += ["tests/test_units.py"]
    here = subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True)
    assert here.returncode == 0 and " passed" in here.stdout, here.stdout + here.stderr
