"""Recording of comparisons: what each test compared with the outside world, and which tests did not run.

A test takes the fixture `validation` and calls it for every number that it compares. With ``--validation FOLDER`` the
results of the run are written there: the ledger, all rows, and both as data for `python -m tests.ledger`.
"""

import math
from pathlib import Path

import pytest

from tests.ledger.capabilities import is_test, load_capabilities
from tests.ledger.results import COMMITTED, Results, Row, TestResult, load_results, this_version, write_results

KEY = "validation"  # of the user properties of a report, which pytest-xdist carries from its workers


def pytest_addoption(parser):
    parser.addoption("--validation", metavar="FOLDER", help="write the validation ledger and all its rows to FOLDER")


def pytest_configure(config):
    if not config.getoption("--validation", None) or hasattr(config, "workerinput"):
        return
    from rso_lidar.files import can_write_in  # here, so that other runs of pytest start without the package

    folder = Path(config.getoption("--validation"))
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        reason = "is a file" if folder.is_file() else error.strerror
        raise pytest.UsageError(f"--validation {folder}: {reason}; name a folder") from None
    if not can_write_in(folder):
        raise pytest.UsageError(f"--validation {folder}: cannot be written; name another folder")
    load_capabilities()  # an error in that file is reported before the tests run, not after
    config.pluginmanager.register(Recorder(config, folder), "validation-recorder")


@pytest.fixture
def validation(request):
    """Return the function that compares a number with the outside world's, and keeps the row for the pages."""

    def compare(*, case, source, expected, got, tolerance, unit):
        row = Row(case, source, float(expected), float(got), float(tolerance), unit)
        request.node.user_properties.append((KEY, row.as_list()))
        assert math.isfinite(row.tolerance), f"{case}: a tolerance of {tolerance} proves nothing"
        assert row.tolerance >= 0, f"{case}: a tolerance cannot be negative"
        assert row.difference <= row.tolerance, (
            f"{case}: got {row.got!r} {unit}, expected {row.expected!r} ({source}): off by {row.difference:.3g}, "
            f"allowed {row.tolerance:.3g}"
        )

    return compare


class Recorder:
    """Collects reports of tests, and writes the pages at the end."""

    def __init__(self, config, folder):
        self.config, self.folder, self.tests = config, folder, {}
        self.ledger = None

    def pytest_runtest_logreport(self, report):
        known = self.tests.get(report.nodeid)
        if report.when == "call" or report.outcome != "passed":
            outcome = "failed" if known is not None and known.outcome == "failed" else report.outcome
            rows = [Row.from_list(row) for key, row in report.user_properties if key == KEY]
            self.tests[report.nodeid] = TestResult(outcome, skip_reason(report), tuple(rows))

    def pytest_collectreport(self, report):
        if report.outcome == "skipped":  # a whole file, by pytest.importorskip
            self.tests[report.nodeid] = TestResult("skipped", skip_reason(report), ())
        elif report.outcome == "failed":
            self.tests[report.nodeid] = TestResult("failed", "cannot be collected", ())

    def pytest_sessionfinish(self):
        if self.config.option.collectonly or not self.tests:
            return
        from tests.ledger import pages

        known = load_results()
        results = Results(this_version(), self.tests).completed(known)
        if (self.folder / "validation.json").resolve() == COMMITTED:  # of any tests, on a machine without all data
            results = known.updated(results, is_test)
        self.ledger = pages.write_pages(self.folder, load_capabilities(), results)
        write_results(self.folder / "validation.json", results)

    def pytest_terminal_summary(self, terminalreporter):
        if self.ledger is not None:
            from tests.ledger import pages

            terminalreporter.section("validation ledger")
            for line in pages.summary(self.ledger):
                terminalreporter.line(line)
            terminalreporter.line(f"written: {self.folder / 'validation.md'}, {self.folder / 'validation_cases.md'}")


def skip_reason(report):
    """Return why a test was skipped, without the place of the skip."""
    if report.outcome != "skipped":
        return ""
    text = report.longrepr[2] if isinstance(report.longrepr, tuple) else str(report.longrepr)
    return " ".join(text.removeprefix("Skipped: ").split())
