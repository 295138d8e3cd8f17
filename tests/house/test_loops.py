"""Loops for numba: each module beside the NumPy that it repeats, compared with it by a test, and imported when needed."""

import ast
from pathlib import Path

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


def test_loops_stand_beside_the_module_that_asks_for_them():
    beside = {path: path.with_name(path.name.replace("_loops", "")) for path in LOOPS if path.stem != "packets_loops"}
    assert not [path for path, near in beside.items() if not near.is_file() or path.stem not in near.read_text("utf-8")]


def test_a_test_compares_them():
    def compared(path):
        tests = Path("tests", path.parent.name).glob("test_*.py")
        return any(path.stem in test.read_text("utf-8") or test.stem == f"test_{path.stem}" for test in tests)

    assert not [path for path in LOOPS if not compared(path)]


def test_nothing_imports_loops_before_they_are_needed():
    others = {path: imported_at_once(path) for path in sorted(set(PACKAGE.rglob("*.py")) - set(LOOPS))}
    assert len(others) > 300
    assert not {
        path: names for path, names in others.items() if any(name and name.endswith("_loops") for name in names)
    }


def test_loops_take_constants_only_from_where_a_change_is_noticed():
    """Machine code is kept on disk until a module of the room, units or arithmetic changes; records are types alone."""
    known = {"rso_lidar", "rso_lidar.arithmetic", "rso_lidar.units"}
    far = {}
    for path in LOOPS:
        ours = {name for name in imported_at_once(path) if name and name.startswith("rso_lidar")}
        far[path] = [name for name in ours - known if not name.startswith(f"rso_lidar.{path.parent.name}.")]
    assert not {path: names for path, names in far.items() if names}
