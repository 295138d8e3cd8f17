"""The validation pages hold what was compared; numbers that are off fail, and what did not run is shown as not run."""

import ast
import json
import os
import subprocess
import sys
from importlib.metadata import version
from pathlib import Path

import pytest

from tests.house.sources import parse, walk
from tests.ledger import pages
from tests.ledger.capabilities import build_ledger, is_test, load_capabilities, test_names
from tests.ledger.results import COMMITTED, Results, Row, TestResult, load_results

ROOT = Path(__file__).resolve().parents[2]
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

def test_needs_data(validation):
    pytest.skip("no data here")

def test_of_a_word():
    assert True
'''


def run_pytest(folder, *options):
    plugins = ["-p", "xdist", "-p", "tests.ledger.recording", "-p", "no:cacheprovider"]
    command = [sys.executable, "-m", "pytest", "-q", *plugins, *options]
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, env=environment, check=False)


@pytest.fixture(scope="module", params=[(), ("-n", "2")], ids=["alone", "two workers"])
def run(request, tmp_path_factory):
    """Run those tests in a folder of their own; return that folder and what pytest printed."""
    folder = tmp_path_factory.mktemp("physics")
    for name in ("test_motion.py", "test_beam.py"):
        (folder / name).write_text(TESTS)
    (folder / "test_absent.py").write_text(
        "import pytest\npytest.importorskip('no_such_package', reason='not there')\n"
    )
    (folder / "pytest.ini").write_text("[pytest]\naddopts = --import-mode=importlib\n")
    done = run_pytest(folder, "--validation=made", *request.param, ".")
    assert done.returncode == 1
    return folder, done.stdout


def test_numbers_that_are_off_fail(run):
    _, printed = run
    assert "10 failed, 6 passed, 3 skipped" in printed
    assert "d: off: got 1.2 m, expected 1.0 (none): off by 0.2, allowed 0.1" in printed
    assert "tests: 6 passed, 10 failed, 3 not run" in printed
    assert "not run: no data here (2)" in printed


def test_page_holds_what_was_compared_in_order(run):
    folder, _ = run
    rows = [
        "| a: period | Kepler's third law | 86164.0905 s | 86164.0911 s | 0.001 s |",
        r"| b: period \| GEO | Kepler's third law | 86164.0905 s | 86164.0911 s | 0.001 s |",
        "| c: fine | none | 1 | **failed**: 1 | 0 |",
        "| d: off | none | 1 m | **failed**: 1.2 m | 0.1 m |",
    ]
    page = (folder / "made" / "validation_cases.md").read_text()
    found = [line for line in page.splitlines() if line.startswith("| ") and line[2:4] in ("a:", "b:", "c:", "d:")]
    assert found == rows + rows
    assert f"rso_lidar {version('rso-lidar')} " in page
    assert "1 check without a number passed: of a word." in page
    assert "**Not run**: needs data (no data here)." in page
    assert "**Not run**: test absent.py (not there)." in page or "(not there)" in page


def test_validation_takes_a_folder(tmp_path):
    (tmp_path / "file").write_text("")
    done = run_pytest(tmp_path, "--validation=file")
    assert done.returncode == 4
    assert "--validation file: is a file; name a folder" in done.stderr


def test_committed_pages_are_those_of_the_committed_results():
    results = load_results()
    ledger = build_ledger(load_capabilities(), results)
    renew = "python -m tests.ledger"
    assert (ROOT / "docs" / "validation.md").read_text(encoding="utf-8") == pages.ledger_page(ledger), renew
    assert (ROOT / "docs" / "validation_cases.md").read_text(encoding="utf-8") == pages.cases_page(results), renew


def test_committed_results_are_of_the_tests_that_there_are():
    """And they were made where all data were there: nothing failed, and nothing lacked real data."""
    results = load_results()
    recorded = {name.partition("[")[0] for name in results.tests}
    files = sorted((ROOT / "tests" / "physics").glob("test_*.py")) + sorted(
        (ROOT / "tests" / "peers").glob("test_*.py")
    )
    needed = {name for file in files for name in test_names(file.relative_to(ROOT).as_posix())}
    renew = "run the tests concerned with --validation=docs, or all by make validate PAGES=docs"
    assert needed <= recorded, renew
    assert not [name for name in recorded if not is_test(name)], renew
    assert not [name for name, result in results.tests.items() if result.outcome == "failed"]
    assert not [reason for reason, _ in pages.skip_reasons(results) if "real data" in reason]
    assert json.loads(COMMITTED.read_text(encoding="utf-8"))["version"] == version("rso-lidar")


def test_rows_of_a_file_that_is_skipped_are_shown_as_not_run():
    row = Row("a: period", "Kepler", 1.0, 1.0, 0.1, "s")
    known = Results("1.0", {"tests/physics/test_x.py::test_a": TestResult("passed", "", (row,))})
    for name in ("tests/physics/test_x.py::test_a", "tests/physics/test_x.py"):
        now = Results("1.0", {name: TestResult("skipped", "no data here", ())}).completed(known)
        assert list(now.tests) == ["tests/physics/test_x.py::test_a"]
        assert "| a: period | Kepler | 1 s | **not run** | 0.1 s |" in pages.cases_page(now)
        assert "Not run: no data here." in pages.cases_page(now)


def test_committed_results_are_renewed_test_by_test():
    old = TestResult("passed", "", (Row("a", "b", 1.0, 1.0, 0.1, "s"),))
    new = TestResult("failed", "", (Row("a", "b", 1.0, 2.0, 0.1, "s"),))
    skipped = TestResult("skipped", "no data here", ())
    before = Results("1.0", {"x::test_a[1]": old, "x::test_b": old, "x::test_gone": old, "x::test_c": old})
    after = before.updated(
        Results("1.1", {"x::test_a[1]": new, "x::test_b": skipped, "x::test_new": skipped}), lambda n: "gone" not in n
    )
    assert after.version == "1.1"
    assert after.tests == {"x::test_a[1]": new, "x::test_b": old, "x::test_c": old, "x::test_new": skipped}
    assert is_test("tests/house/test_validation_page.py") and not is_test(
        "tests/house/test_validation_page.py::test_gone"
    )
    assert is_test("tests/house/test_validation_page.py::test_committed_results_are_renewed_test_by_test")


def test_each_number_of_physics_and_peers_has_a_source():
    """A test that compares a number calls `validation` with a case and a source, by name."""
    bare = []
    for file, tree in parse("tests/physics", "tests/peers").items():
        for node in walk(tree):
            if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == "validation":
                keys = {keyword.arg for keyword in node.keywords}
                if None not in keys and not {"case", "source"} <= keys:
                    bare.append(f"{file}:{node.lineno}")
    assert not bare
