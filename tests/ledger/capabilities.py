"""The ledger: capabilities of the package, and how each is validated, modelled or assumed.

`capabilities.toml` lists the capabilities with their references and the tests that compare them. The status follows from
the results of the tests: nothing is called validated for which no comparison ran.
"""

import ast
import fnmatch
import functools
import re
import tomllib
from dataclasses import dataclass
from pathlib import Path

from tests.ledger.results import ROOT, Row

PATH = Path(__file__).with_name("capabilities.toml")
KINDS = {  # of evidence, those of most weight first; the last alone validates nothing
    "measurement": "published measurement",
    "program": "other program",
    "published": "published number",
    "closed form": "closed form",
    "itself": "the package itself",
}
STATUSES = ("failed", "not run", "assumed", "modelled", "validated")  # gaps first


@dataclass(frozen=True)
class Evidence:
    """A comparison with one source: its kind, the source in words, the tests, and the cases where not all count."""

    kind: str
    against: str
    tests: tuple[str, ...]
    cases: tuple[str, ...] = ("*",)

    def matches(self, test):
        """Return whether a test, by pytest's name, belongs to this evidence."""
        return self._pattern.match(test.partition("[")[0]) is not None

    @functools.cached_property
    def _pattern(self):
        globs = [f"tests/{glob}" if "::" in glob else f"tests/{glob}::*" for glob in self.tests]
        return re.compile("|".join(map(fnmatch.translate, globs)))

    def covers(self, row):
        return any(fnmatch.fnmatchcase(row.case, glob) for glob in self.cases)


@dataclass(frozen=True)
class Capability:
    """Something that a user can name: what belongs to it, where it comes from, and what compares it."""

    name: str
    area: str
    has: tuple[str, ...] = ()
    reference: str = ""
    gap: str = ""
    evidence: tuple[Evidence, ...] = ()


@dataclass(frozen=True)
class Compared:
    """Evidence as a run found it: rows that were compared, tests without rows that passed, and tests that did not run."""

    evidence: Evidence
    rows: tuple[Row, ...]
    checks: int
    failed: tuple[str, ...]
    skipped: tuple[tuple[str, str], ...]

    @property
    def ran(self):
        return bool(self.rows or self.checks)


@dataclass(frozen=True)
class Entry:
    """A line of the ledger: a capability, its evidence as a run found it, and the status that follows."""

    capability: Capability
    compared: tuple[Compared, ...]

    @property
    def independent(self):
        return tuple(each for each in self.compared if each.evidence.kind != "itself")

    @property
    def status(self):
        if any(each.failed for each in self.compared):
            return "failed"
        if any(each.ran for each in self.independent):
            return "validated"
        if self.independent:
            return "not run"
        return "modelled" if self.capability.reference else "assumed"


@dataclass(frozen=True)
class Ledger:
    """The lines of the ledger, and the results from which they follow."""

    entries: tuple[Entry, ...]
    results: object

    def count(self, status):
        return sum(entry.status == status for entry in self.entries)


class LedgerError(ValueError):
    """An error in capabilities.toml."""


@functools.cache
def load_capabilities(path=PATH):
    """Return the capabilities of a file.

    Raises
    ------
    LedgerError : a line that names the capability, the problem and the cure.
    """
    try:
        table = tomllib.loads(Path(path).read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        reason = " ".join(str(error).split())
        raise LedgerError(f"{path}: {reason}") from None
    found = []
    for number, given in enumerate(table.get("capability", []), 1):
        found.append(_capability(given, f"{Path(path).name}: capability {given.get('name', number)!r}"))
    names = [capability.name for capability in found]
    if twice := sorted({name for name in names if names.count(name) > 1}):
        raise LedgerError(f"{Path(path).name}: capability {twice[0]!r} occurs twice; join the two")
    if not found:
        raise LedgerError(f"{path}: lists no capability")
    return tuple(found)


def _capability(given, place):
    if unknown := set(given) - {"name", "area", "has", "reference", "gap", "evidence"}:
        raise LedgerError(f"{place}: unknown key {sorted(unknown)[0]!r}")
    if missing := [key for key in ("name", "area") if not given.get(key)]:
        raise LedgerError(f"{place}: lacks {missing[0]!r}")
    if wrong := [key for key in ("name", "area", "reference", "gap") if not isinstance(given.get(key, ""), str)]:
        raise LedgerError(f"{place}: {wrong[0]!r} is not a text")
    if not _are_texts(given.get("has", [])):
        raise LedgerError(f"{place}: 'has' is not a list of texts")
    tables = given.get("evidence", [])
    if not isinstance(tables, list) or not all(isinstance(each, dict) for each in tables):
        raise LedgerError(f"{place}: 'evidence' is not a list of tables")
    evidence = tuple(_evidence(each, place) for each in tables)
    capability = Capability(
        given["name"],
        given["area"],
        tuple(given.get("has", ())),
        given.get("reference", ""),
        given.get("gap", ""),
        evidence,
    )
    if all(each.kind == "itself" for each in evidence) and not capability.gap:
        raise LedgerError(f"{place}: has no independent comparison; say in 'gap' what is missing or assumed")
    return capability


def _evidence(given, place):
    if unknown := set(given) - {"kind", "against", "tests", "cases"}:
        raise LedgerError(f"{place}: evidence: unknown key {sorted(unknown)[0]!r}")
    if given.get("kind") not in KINDS:
        raise LedgerError(f"{place}: evidence: kind {given.get('kind')!r} is none of {', '.join(KINDS)}")
    if not given.get("against") or not given.get("tests"):
        raise LedgerError(f"{place}: evidence: 'against' and 'tests' are needed")
    for key in ("tests", "cases"):
        if not _are_texts(given.get(key, [])):
            raise LedgerError(f"{place}: evidence: {key!r} is not a list of texts")
    return Evidence(given["kind"], given["against"], tuple(given["tests"]), tuple(given.get("cases", ("*",))))


def _are_texts(value):
    return isinstance(value, list) and all(isinstance(each, str) for each in value)


def build_ledger(capabilities, results):
    """Return the ledger that follows from the results of tests."""
    return Ledger(
        tuple(Entry(each, tuple(_compare(e, results) for e in each.evidence)) for each in capabilities), results
    )


def _compare(evidence, results):
    rows, checks, failed, skipped = set(), 0, [], []
    for name, result in results.tests.items():
        if not (evidence.matches(name) or _is_file_of(name, evidence)):
            continue
        covered = {row for row in result.rows if evidence.covers(row)}
        if result.rows and not covered:
            continue
        if result.outcome == "failed":
            failed.append(name)
        elif result.outcome == "skipped":
            skipped.append((name, result.reason))
        elif covered:
            rows |= covered
        elif evidence.cases == ("*",):
            checks += 1
    return Compared(evidence, tuple(sorted(rows)), checks, tuple(failed), tuple(skipped))


def _is_file_of(name, evidence):
    """Return whether a whole file that could not be collected belongs to the evidence."""
    return "::" not in name and any(f"tests/{glob.partition('::')[0]}" == name for glob in evidence.tests)


def outside_tests(capabilities):
    """Return the tests outside tests/physics and tests/peers that are evidence, by the names that pytest takes."""
    found = set()
    for evidence in (each for capability in capabilities for each in capability.evidence):
        for glob in evidence.tests:
            file, _, function = glob.partition("::")
            if not file.startswith(("physics/", "peers/")):
                names = [name for name in test_names(f"tests/{file}") if evidence.matches(name)] if function else []
                found |= set(names or [f"tests/{file}"])
    return sorted(found)


@functools.cache
def test_names(file):
    """Return the names of the tests of a file, without parameters."""
    body = ast.parse((ROOT / file).read_text(encoding="utf-8")).body
    return [
        f"{file}::{each.name}" for each in body if isinstance(each, ast.FunctionDef) and each.name.startswith("test_")
    ]


test_names.__test__ = False  # no test


def is_test(name):
    """Return whether there is a test, or a file of tests, of this name."""
    file, _, function = name.partition("::")
    return (ROOT / file).is_file() and (not function or name in test_names(file))


def file_title(file):
    """Return the first line of the docstring of a test file."""
    if not (ROOT / file).is_file():
        return file
    text = ast.get_docstring(ast.parse((ROOT / file).read_text(encoding="utf-8"))) or ""
    return text.partition("\n")[0].rstrip(".") or file
