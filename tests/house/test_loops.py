"""Loops for numba: each module beside the NumPy that it repeats, compared with it by a test, and imported when needed."""

import ast
from pathlib import Path

import pytest

PACKAGE = Path("rso_lidar")
LOOPS = sorted(PACKAGE.glob("*/*_loops.py"))


def imported_at_once(path):
    """Return the modules that a module imports when it is imported itself."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    return {node.module for node in tree.body if isinstance(node, ast.ImportFrom)} | {
        name.name for node in tree.body if isinstance(node, ast.Import) for name in node.names
    }


def test_there_are_loops():
    assert len(LOOPS) > 10


@pytest.mark.parametrize("path", LOOPS, ids=lambda path: path.stem)
def test_loops_stand_beside_the_module_that_asks_for_them(path):
    beside = path.with_name(path.name.replace("_loops", ""))
    assert beside.is_file()
    assert path.stem in beside.read_text(encoding="utf-8") or path.stem == "packets_loops"


@pytest.mark.parametrize("path", LOOPS, ids=lambda path: path.stem)
def test_a_test_compares_them(path):
    tests = [*Path("tests", path.parent.name).glob("test_*.py")]
    assert any(path.stem in test.read_text(encoding="utf-8") or test.stem == f"test_{path.stem}" for test in tests)


@pytest.mark.parametrize("path", sorted(set(PACKAGE.rglob("*.py")) - set(LOOPS)), ids=str)
def test_nothing_imports_loops_before_they_are_needed(path):
    assert not [name for name in imported_at_once(path) if name and name.endswith("_loops")]


@pytest.mark.parametrize("path", LOOPS, ids=lambda path: path.stem)
def test_loops_take_constants_only_from_where_a_change_is_noticed(path):
    """Machine code is kept on disk until a module of the room, units or arithmetic changes; records are types alone."""
    known = {"rso_lidar", "rso_lidar.arithmetic", "rso_lidar.units"}
    ours = {name for name in imported_at_once(path) if name and name.startswith("rso_lidar")}
    assert not [name for name in ours - known if not name.startswith(f"rso_lidar.{path.parent.name}.")]
