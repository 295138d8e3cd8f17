"""The validation page holds what passed, in order, and a number that is off fails its test."""

import shutil
import subprocess
import sys
from importlib.metadata import version
from pathlib import Path

import pytest

CONFTEST = Path(__file__).resolve().parents[1] / "physics" / "conftest.py"
TESTS = '''
"""Two-body motion against closed forms."""
import math
import pytest

@pytest.mark.parametrize("case", ["b: period | GEO", "a: period"])
def test_passes(validation, case):
    validation(case=case, source="Kepler's third law", expected=86164.0905, got=86164.0911, tolerance=0.001, unit="s")

def test_is_off(validation):
    validation(case="c: fine", source="none", expected=1, got=1, tolerance=0, unit="1")
    validation(case="d: off", source="none", expected=1, got=1.2, tolerance=0.1, unit="m")

@pytest.mark.parametrize(("got", "tolerance"), [(math.nan, 1.0), (1.0, math.inf), (1.0, math.nan), (1.0, -1.0)])
def test_proves_nothing(validation, got, tolerance):
    validation(case="e", source="none", expected=1, got=got, tolerance=tolerance, unit="m")
'''


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """Run those tests in a folder of their own; return that folder and what pytest printed."""
    folder = tmp_path_factory.mktemp("physics")
    shutil.copy(CONFTEST, folder)
    (folder / "test_motion.py").write_text(TESTS)
    (folder / "test_beam.py").write_text(TESTS.replace("Two-body motion", "Beams"))
    (folder / "pytest.ini").write_text("[pytest]\naddopts = --import-mode=importlib\n")
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "--validation-page=docs/page.md", "."]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True)
    return folder, done.stdout


def test_numbers_that_are_off_fail(run):
    _, printed = run
    assert "10 failed, 4 passed" in printed
    assert "d: off: got 1.2 m, expected 1.0 (none): off by 0.2, allowed 0.1" in printed


def test_page_holds_what_passed_in_order(run):
    folder, _ = run
    rows = [
        "| a: period | Kepler's third law | 86164.0905 s | 86164.0911 s | 0.001 s |",
        r"| b: period \| GEO | Kepler's third law | 86164.0905 s | 86164.0911 s | 0.001 s |",
    ]
    page = (folder / "docs" / "page.md").read_text()
    assert [
        line for line in page.splitlines() if line.startswith("| ") and "case" not in line and "---" not in line
    ] == (rows + rows)
    assert f"rso_lidar {version('rso-lidar')} " in page
    assert page.index("## Beams against closed forms\n") < page.index("## Two-body motion against closed forms\n")
    assert "`tests/physics/test_motion.py`" in page
