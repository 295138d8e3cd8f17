"""The validation page: what each physics test compared, with whom, and how close it came.

A physics test takes the fixture `validation` and calls it for every number that it checks against the outside world.
With ``--validation-page PATH`` the rows of the tests that passed are written as a page of markdown.
"""

import inspect
import math
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path

import pytest

ROWS = pytest.StashKey[list]()


@dataclass(frozen=True, order=True)
class Row:
    """One number of one test, and the number of the outside world."""

    case: str
    source: str
    expected: float
    got: float
    tolerance: float
    unit: str

    def cells(self):
        unit = "" if self.unit in ("", "1") else f" {self.unit}"
        numbers = [digits(self.expected, self.tolerance), digits(self.got, self.tolerance), f"{self.tolerance:.3g}"]
        return [plain(self.case), plain(self.source), *(number + unit for number in numbers)]


def digits(value, tolerance):
    """Return a number with one digit more than its tolerance can tell apart."""
    if value == 0 or tolerance <= 0:
        return f"{value:.12g}"
    told = math.floor(math.log10(abs(value))) - math.floor(math.log10(tolerance)) + 2
    return f"{value:.{min(max(told, 1), 15)}g}"


def plain(text):
    return " ".join(text.split()).replace("|", "\\|")


def pytest_addoption(parser):
    parser.addoption("--validation-page", metavar="PATH", help="write what the physics tests compared to this page")


def pytest_configure(config):
    config.stash[ROWS] = []
    if config.getoption("--validation-page", None) and config.getoption("numprocesses", None):
        raise pytest.UsageError("--validation-page: rows are collected in one process: leave out -n")


@pytest.fixture
def validation(request):
    """Return the function that compares a number with the outside world's, and keeps the row for the page."""

    def compare(*, case, source, expected, got, tolerance, unit):
        row = Row(case, source, float(expected), float(got), float(tolerance), unit)
        rows.append(row)
        assert math.isfinite(row.tolerance), f"{case}: a tolerance of {tolerance} proves nothing"
        assert row.tolerance >= 0, f"{case}: a tolerance cannot be negative"
        error = abs(row.got - row.expected)
        assert error <= row.tolerance, (
            f"{case}: got {row.got!r} {unit}, expected {row.expected!r} ({source}): off by {error:.3g}, "
            f"allowed {row.tolerance:.3g}"
        )

    rows = request.node.stash.setdefault(ROWS, [])
    return compare


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item, call):
    report = yield
    keep_rows(item, report, "tests/physics")
    return report


def keep_rows(item, report, folder):
    """Keep the rows of a test that passed; `folder` is where the page says that its file lies."""
    if report.when == "call" and report.passed:
        file = f"{folder}/{Path(item.path).name}"
        title = (inspect.getdoc(item.module) or "").partition("\n")[0]
        item.config.stash[ROWS] += [(file, title, row) for row in item.stash.get(ROWS, [])]


def pytest_sessionfinish(session):
    path = session.config.getoption("--validation-page", None)
    if path:
        Path(path).parent.mkdir(parents=True, exist_ok=True)
        Path(path).write_text(page(session.config.stash[ROWS], version("rso-lidar")), encoding="utf-8")


def page(collected, package_version):
    """Return the page: one table for each test file, files and cases in order."""
    lines = [
        "# Validation",
        "",
        f"What rso_lidar {package_version} was compared with, and how close it came. `make validate` writes this page",
        "from the tests in `tests/physics` and `tests/peers`: a test that passed checked every row, and the tolerance is",
        "the test's own.",
    ]
    for file, title in sorted({(file, title) for file, title, _ in collected}):
        lines += ["", f"## {title.rstrip('.') or file}", "", f"`{file}`", ""]
        lines += ["| case | source | expected | got | tolerance |", "| --- | --- | ---: | ---: | ---: |"]
        rows = sorted({row for other, _, row in collected if other == file})
        lines += [f"| {' | '.join(row.cells())} |" for row in rows]
    return "\n".join(lines) + "\n"
