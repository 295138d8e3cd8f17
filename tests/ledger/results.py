"""Results of a run of the comparisons: rows of numbers, and tests that passed, failed or did not run."""

import json
import math
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
COMMITTED = ROOT / "docs" / "validation.json"


@dataclass(frozen=True, order=True)
class Row:
    """One number of one test, and the number of the outside world."""

    case: str
    source: str
    expected: float
    got: float
    tolerance: float
    unit: str

    @property
    def difference(self):
        return abs(self.got - self.expected)

    @property
    def share(self):
        """Difference over tolerance, 0 where both are 0."""
        return self.difference / self.tolerance if self.tolerance else (0.0 if self.difference == 0 else math.inf)

    def as_list(self):
        return [self.case, self.source, self.expected, self.got, self.tolerance, self.unit]

    @classmethod
    def from_list(cls, values):
        case, source, expected, got, tolerance, unit = values
        return cls(case, source, float(expected), float(got), float(tolerance), unit)


@dataclass(frozen=True)
class TestResult:
    """Outcome of one test: passed, failed or skipped; why it was skipped; and the rows that it compared.

    A skipped test has the rows that are known of it from the committed results.
    """

    __test__ = False  # not a class of tests

    outcome: str
    reason: str
    rows: tuple[Row, ...]


@dataclass(frozen=True)
class Results:
    """Results of a run, by pytest's name of the test."""

    version: str
    tests: dict[str, TestResult]

    def updated(self, newer, exists):
        """Return these results with newer ones in their place; a test that was skipped now keeps what it had.

        `exists` says of a name without parameters whether there is such a test; results of others are dropped.
        """
        tests = {name: result for name, result in self.tests.items() if exists(name.partition("[")[0])}
        for name, result in newer.tests.items():
            if result.outcome != "skipped" or name not in tests:
                tests[name] = result
        return Results(newer.version, tests)

    def completed(self, known):
        """Return the results with the rows that skipped tests would have compared, as far as `known` has them.

        Where a whole file was skipped, or a fixture's parameters could not be listed, the tests that `known` has of it
        count as skipped, too.
        """
        tests = dict(self.tests)
        for name, result in self.tests.items():
            if result.outcome == "skipped" and not result.rows:
                if name in known.tests:
                    tests[name] = TestResult("skipped", result.reason, known.tests[name].rows)
                elif "::" not in name and (of_file := [k for k in known.tests if k.startswith(f"{name}::")]):
                    del tests[name]
                    tests |= {k: TestResult("skipped", result.reason, known.tests[k].rows) for k in of_file}
        return Results(self.version, tests)


def this_version():
    return version("rso-lidar")


def load_results(path=COMMITTED):
    """Return committed results; without the file, results of no test."""
    if not Path(path).is_file():
        return Results(this_version(), {})
    table = json.loads(Path(path).read_text(encoding="utf-8"))
    tests = {
        name: TestResult(entry["outcome"], entry.get("reason", ""), tuple(map(Row.from_list, entry.get("rows", []))))
        for name, entry in table["tests"].items()
    }
    return Results(table["version"], tests)


def write_results(path, results):
    """Write results as JSON with one line for each test."""
    from rso_lidar.files import write_text  # here, so that pytest starts without the package

    lines = []
    for name, result in sorted(results.tests.items()):
        entry = {"outcome": result.outcome}
        if result.reason:
            entry["reason"] = result.reason
        if result.rows:
            entry["rows"] = [[*row.as_list()[:2], *map(shortened, row.as_list()[2:5]), row.unit] for row in result.rows]
        lines.append(f"{json.dumps(name)}: {json.dumps(entry, ensure_ascii=False)}")
    text = f'{{"version": {json.dumps(results.version)}, "tests": {{\n' + ",\n".join(lines) + "\n}}\n"
    write_text(path, text, overwrite=True)


def shortened(value):
    """Return a number with the digits that matter on a page."""
    return float(f"{value:.15g}") if math.isfinite(value) else str(value)
