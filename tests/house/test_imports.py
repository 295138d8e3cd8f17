"""Each module imports alone, quickly and without the heavy libraries; so does the package."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
HEAVY = ["trimesh", "embreex", "skyfield", "sgp4", "h5py", "matplotlib", "PIL", "rerun", "typer", "rich"]
AT_HOME = {"rso_lidar.cli": {"typer", "rich"}, "rso_lidar.__main__": {"typer", "rich"}}  # nothing imports these


def dotted(file):
    words = file.relative_to(ROOT).with_suffix("").parts
    return ".".join(words[:-1] if words[-1] == "__init__" else words)


MODULES = sorted(dotted(file) for file in (ROOT / "rso_lidar").rglob("*.py"))

# Python, numpy, scipy and pydantic are imported once; then each module gets a fork of its own. Alone means that neither
# the package nor the module's own room has been imported before: both are there by name and path only.
ALONE = """
import importlib, json, os, sys, traceback, types
from pathlib import Path
import numpy, scipy.spatial.transform, pydantic

root, heavy, names = Path(sys.argv[1]), json.loads(sys.argv[2]), json.loads(sys.argv[3])
for name in names:
    sys.stdout.flush()
    child = os.fork()
    if child:
        os.waitpid(child, 0)
        continue
    words = name.split(".")
    for n in range(1, len(words)):
        package = types.ModuleType(".".join(words[:n]))
        package.__path__ = [str(root.joinpath(*words[:n]))]
        sys.modules[package.__name__] = package
    try:
        importlib.import_module(name)
        problem = ""
    except BaseException:
        problem = traceback.format_exc(limit=-3)
    print(json.dumps([name, problem, [library for library in heavy if library in sys.modules]]), flush=True)
    os._exit(0)
"""


@pytest.fixture(scope="module")
def alone():
    """Return, for each module imported alone, the traceback (or nothing) and the heavy libraries that came along."""
    command = [sys.executable, "-W", "ignore", "-c", ALONE, ROOT, json.dumps(HEAVY), json.dumps(MODULES)]
    run = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True)
    return {name: (problem, heavy) for name, problem, heavy in map(json.loads, run.stdout.splitlines())}


def test_the_ground_floors_are_among_the_modules():
    assert {"rso_lidar", "rso_lidar.units", "rso_lidar.errors", "rso_lidar.part", "rso_lidar.records"} <= set(MODULES)


@pytest.mark.parametrize("module", MODULES)
def test_module_imports_alone(alone, module):
    assert alone[module][0] == ""


@pytest.mark.parametrize("module", MODULES)
def test_module_leaves_heavy_libraries_for_later(alone, module):
    allowed = next((libraries for room, libraries in AT_HOME.items() if module.startswith(room)), set())
    assert set(alone[module][1]) <= allowed


def test_the_package_imports_without_heavy_libraries():
    code = f"import rso_lidar, sys; print([name for name in {HEAVY} if name in sys.modules])"
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert run.stdout.strip() == "[]"
