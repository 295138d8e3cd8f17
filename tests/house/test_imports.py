"""Each module imports, in any order, quickly and without the heavy libraries; so does the package."""

import ast
import json
import subprocess
import sys
from graphlib import TopologicalSorter
from pathlib import Path

import pytest

from tests.house.sources import parse

ROOT = Path(__file__).resolve().parents[2]
HEAVY = [
    "trimesh",
    "embreex",
    "skyfield",
    "sgp4",
    "h5py",
    "matplotlib",
    "PIL",
    "imageio_ffmpeg",
    "rerun",
    "typer",
    "rich",
]
AT_HOME = {"rso_lidar.cli": {"typer", "rich"}, "rso_lidar.__main__": {"typer", "rich"}}  # nothing imports these


def dotted(file):
    words = file.relative_to(ROOT).with_suffix("").parts
    return ".".join(words[:-1] if words[-1] == "__init__" else words)


MODULES = sorted(dotted(file) for file in (ROOT / "rso_lidar").rglob("*.py"))

# In one process, one after the other: the traceback of each that fails, and the heavy libraries that it brought along.
EACH = """
import importlib, json, sys, traceback

heavy, names = json.loads(sys.argv[1]), json.loads(sys.argv[2])
for name in names:
    before = {library for library in heavy if library in sys.modules}
    try:
        importlib.import_module(name)
        problem = ""
    except BaseException:
        problem = traceback.format_exc(limit=-3)
    print(json.dumps([name, problem, [library for library in heavy if library in sys.modules and library not in before]]))
"""


@pytest.fixture(scope="module")
def each():
    """Return, for each module, the traceback (or nothing) and the heavy libraries that came along; those at home last."""
    at_home = [name for name in MODULES if name.startswith(tuple(AT_HOME))]
    names = [name for name in MODULES if name not in at_home] + at_home
    command = [sys.executable, "-W", "ignore", "-c", EACH, json.dumps(HEAVY), json.dumps(names)]
    run = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True)
    return {name: (problem, heavy) for name, problem, heavy in map(json.loads, run.stdout.splitlines())}


def imported(file):
    """Return the modules of the package that a module imports while it is imported itself, with the doors on the way."""
    found, waiting = set(), [parse("rso_lidar")[file.relative_to(ROOT).as_posix()]]
    while waiting:
        node = waiting.pop()
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.Lambda):
            continue
        if isinstance(node, ast.If) and "TYPE_CHECKING" in ast.unparse(node.test):
            waiting += node.orelse
            continue
        waiting += ast.iter_child_nodes(node)
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            found |= {node.module, *(f"{node.module}.{alias.name}" for alias in node.names)}
    doors = {".".join(name.split(".")[:n]) for name in found for n in range(2, name.count(".") + 1)}
    me = dotted(file)
    return {name for name in (found | doors) & set(MODULES) if not f"{me}.".startswith(f"{name}.")}


def test_the_ground_floors_are_among_the_modules():
    assert {"rso_lidar", "rso_lidar.units", "rso_lidar.errors", "rso_lidar.part", "rso_lidar.records"} <= set(MODULES)


def test_modules_import_in_any_order(each):
    """Each imports, and none needs another that needs it: then it does not matter which comes first."""
    assert sorted(each) == MODULES
    assert not {module: problem for module, (problem, _) in each.items() if problem}
    needs = {dotted(file): imported(file) for file in (ROOT / "rso_lidar").rglob("*.py")}
    assert sum(map(len, needs.values())) > 1000
    TopologicalSorter(needs).prepare()  # which refuses a circle, and names it


def test_modules_leave_heavy_libraries_for_later(each):
    early = {}
    for module, (_, heavy) in each.items():
        allowed = next((libraries for room, libraries in AT_HOME.items() if module.startswith(room)), set())
        early[module] = set(heavy) - allowed
    assert not {module: libraries for module, libraries in early.items() if libraries}


def test_what_the_package_exports_imports_without_heavy_libraries():
    code = "import rso_lidar as rl, sys; [getattr(rl, name) for name in rl.__all__]\n"
    code += f"print([name for name in {HEAVY} if name in sys.modules])"
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert run.stdout.strip() == "[]"
