"""A test that hangs fails alone, soon and in words; a failure is printed before the other tests have ended."""

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
OWN = ["-p", "xdist", "-p", "no:cacheprovider", "-o", "addopts=", "--rootdir", "."]


def start(folder, text, *options, limit_s):
    (folder / "conftest.py").write_text(CONFTEST)
    (folder / "test_it.py").write_text(text)
    variables = {"RSO_LIDAR_TEST_LIMIT_S": str(limit_s), "PYTHONPATH": str(ROOT), "PYTEST_DISABLE_PLUGIN_AUTOLOAD": "1"}
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
    with start(tmp_path, FAILS, "-n", "2", limit_s=300) as session:
        for line in session.stdout:
            if "'this' == 'that'" in line:
                (tmp_path / "go").touch()  # only now can the other one end
                break
        rest = session.stdout.read()
    assert "1 failed, 1 passed" in rest
