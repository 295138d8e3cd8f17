"""The ledger of validation: all that users can name is in it, and nothing is called validated without a comparison."""

import ast
from functools import cache
from pathlib import Path

import pytest

from tests.house.sources import parse
from tests.ledger import __main__ as command
from tests.ledger.assumed_defaults import list_assumed_defaults
from tests.ledger.capabilities import (
    Evidence,
    LedgerError,
    build_ledger,
    load_capabilities,
    outside_tests,
)
from tests.ledger.inventory import list_names
from tests.ledger.pages import best_kind, how_near, ledger_page
from tests.ledger.results import Results, Row, TestResult, load_results

ROOT = Path(__file__).resolve().parents[2]
HEAD = '[[capability]]\nname = "a"\narea = "b"\n'
GAP = 'gap = "c"\n'


@cache
def all_tests():
    """Return the names of all tests at the top of their files, as `test_names` does for a file."""
    return [
        f"{file}::{node.name}"
        for file, tree in parse("tests").items()
        if file.rpartition("/")[2].startswith("test_")
        for node in tree.body
        if isinstance(node, ast.FunctionDef) and node.name.startswith("test_")
    ]


def test_everything_that_users_can_name_belongs_to_one_capability():
    held = [name for capability in load_capabilities() for name in capability.has]
    assert not list_names() - set(held), "add each to a capability in tests/ledger/capabilities.toml, or a new one"
    assert not set(held) - list_names(), "nothing of this name is in the package any more"
    assert len(held) == len(set(held))


def test_every_test_of_physics_and_peers_is_evidence():
    evidence = [each for capability in load_capabilities() for each in capability.evidence]
    tests = [name for name in all_tests() if name.startswith(("tests/physics/", "tests/peers/"))]
    assert len(tests) > 250
    assert not [name for name in tests if not any(each.matches(name) for each in evidence)]


def test_every_row_is_evidence():
    evidence = [each for capability in load_capabilities() for each in capability.evidence]
    rows = [(name, row) for name, result in load_results().tests.items() for row in result.rows]
    assert len(rows) > 800
    missed = [row.case for name, row in rows if not any(each.matches(name) and each.covers(row) for each in evidence)]
    assert not missed, "no capability has these cases"


def test_evidence_names_tests_that_there_are():
    tests = all_tests()
    stale = [
        f"{capability.name}: {glob}"
        for capability in load_capabilities()
        for each in capability.evidence
        for glob in each.tests
        if not any(map(Evidence(each.kind, each.against, (glob,)).matches, tests))
    ]
    assert not stale
    assert all("::" in name or (ROOT / name).is_file() for name in outside_tests(load_capabilities()))


def test_evidence_narrowed_to_cases_has_rows():
    ledger = build_ledger(load_capabilities(), load_results())
    narrowed = [each for entry in ledger.entries for each in entry.compared if each.evidence.cases != ("*",)]
    assert len(narrowed) > 10
    assert not [each.evidence for each in narrowed if not each.rows]


def capability(tmp_path, text):
    path = tmp_path / "capabilities.toml"
    path.write_text(HEAD + text)
    return load_capabilities(path)


EVIDENCE = 'evidence = [{ kind = "program", against = "other", tests = ["physics/test_x.py"], cases = ["a*"] }]\n'
ROW = Row("a: one", "other", 1.0, 1.05, 0.1, "m")


@pytest.mark.parametrize(
    ("text", "results", "status"),
    [
        (EVIDENCE, {"passed": (ROW,)}, "validated"),
        (EVIDENCE, {"skipped": (ROW,)}, "not run"),
        (EVIDENCE, {"failed": (ROW,)}, "failed"),
        (EVIDENCE, {}, "not run"),
        (EVIDENCE.replace("a*", "b*"), {"passed": (ROW,)}, "not run"),  # no row of that case
        (EVIDENCE.replace("program", "itself") + GAP + 'reference = "d"\n', {"passed": (ROW,)}, "modelled"),
        (EVIDENCE.replace("program", "itself") + GAP, {"passed": (ROW,)}, "assumed"),
        (GAP + 'reference = "d"\n', {}, "modelled"),
        (GAP, {}, "assumed"),
    ],
)
def test_status_follows_from_what_ran(tmp_path, text, results, status):
    tests = {
        f"tests/physics/test_x.py::test_{outcome}": TestResult(outcome, "why", rows)
        for outcome, rows in results.items()
    }
    ledger = build_ledger(capability(tmp_path, text), Results("1.0", tests))
    assert ledger.entries[0].status == status
    page = ledger_page(ledger)
    assert f"1 {status}" in page.partition("| area |")[0]
    assert f"## {status.capitalize()}" in page
    if status == "validated":
        assert best_kind(ledger.entries[0]) == "program"
        assert how_near(ledger.entries[0].compared[0]) == "1 number: a: one, 0.05 m off, 0.1 m allowed"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "capability 'a': has no independent comparison; say in 'gap' what is missing or assumed"),
        ("gpa = 'c'\n", "capability 'a': unknown key 'gpa'"),
        (GAP + HEAD.replace('"b"', '""'), "capability 'a': lacks 'area'"),
        (GAP + HEAD + GAP, "capability 'a' occurs twice; join the two"),
        (EVIDENCE.replace("program", "hearsay"), "kind 'hearsay' is none of measurement, program"),
        (EVIDENCE.replace('against = "other", ', ""), "'against' and 'tests' are needed"),
        (EVIDENCE.replace("cases", "case"), "evidence: unknown key 'case'"),
        (EVIDENCE.replace('["physics/test_x.py"]', "[]"), "'against' and 'tests' are needed"),
        ("= 3", "Invalid statement"),
        (GAP.replace('"c"', "3"), "'gap' is not a text"),
        ("has = 3\n" + GAP, "'has' is not a list of texts"),
        ("evidence = 3\n" + GAP, "'evidence' is not a list of tables"),
    ],
)
def test_wrong_lines_are_refused_in_one_line(tmp_path, text, message):
    with pytest.raises(LedgerError) as caught:
        capability(tmp_path, text)
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)


def test_files_that_cannot_be_read_are_refused_in_one_line(tmp_path):
    (tmp_path / "empty.toml").write_text("")
    (tmp_path / "binary.toml").write_bytes(b"\xff\xfe\x00")
    for path in (tmp_path / "empty.toml", tmp_path / "binary.toml", tmp_path / "none.toml", tmp_path):
        with pytest.raises(LedgerError) as caught:
            load_capabilities(path)
        assert str(path) in str(caught.value) and "\n" not in str(caught.value)


def test_assumed_defaults_are_found_by_their_descriptions():
    assert "Readout.electrons_per_count" in list_assumed_defaults(["Readout"])
    assert "Readout.samples" not in list_assumed_defaults(["Readout"])
    assert list_assumed_defaults(["command:run"]) == []


def test_the_command_takes_no_other_word(capsys):
    assert command.main(["--nonsense"]) == 2
    assert capsys.readouterr().err == "usage: python -m tests.ledger [--tests]\n"
    assert command.main(["--tests"]) == 0
    assert "tests/test_philox.py" in capsys.readouterr().out
