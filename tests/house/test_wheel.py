"""The wheel holds all that is needed: it is built, unpacked and run in another folder, far from the checkout."""

import json
import os
import subprocess
import sys
import tomllib
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
EXAMPLES = sorted((ROOT / "examples").glob("*.toml"))
pytestmark = pytest.mark.slow
VERSION = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["version"]

# Isolated (-I): neither the working folder nor PYTHONPATH counts. What an editable install adds comes after the wheel.
RUN = """
import runpy, sys
sys.path.insert(0, sys.argv.pop(1))
import rso_lidar
assert rso_lidar.__file__.startswith(sys.path[0]), rso_lidar.__file__
"""


def call(*command, **options):
    run = subprocess.run(command, capture_output=True, text=True, **options)
    assert run.returncode == 0, run.stdout + run.stderr
    return run.stdout


@pytest.fixture(scope="module")
def wheel(tmp_path_factory):
    """Build the wheel as `python -m build` does, without a network."""
    folder = tmp_path_factory.mktemp("wheel")
    call(sys.executable, "-m", "build", "--wheel", "--no-isolation", "--outdir", str(folder), str(ROOT), cwd=folder)
    (file,) = folder.glob("*.whl")
    return file


@pytest.fixture(scope="module")
def away(wheel, tmp_path_factory):
    """Install the wheel on its own; return a function that runs code against it from an empty folder."""
    site = tmp_path_factory.mktemp("site").resolve()
    folder = tmp_path_factory.mktemp("elsewhere")
    pip = ["-m", "pip", "install", "-qq", "--no-deps", "--no-index", "--target", str(site), str(wheel)]
    call(sys.executable, *pip, cwd=folder, env={**os.environ, "PIP_DISABLE_PIP_VERSION_CHECK": "1"})

    machine_code = {
        **os.environ,
        "NUMBA_CACHE_DIR": str(tmp_path_factory.mktemp("machine_code")),
    }  # not beside the code

    def run(code, *arguments, **variables):
        environment = machine_code | variables
        return call(sys.executable, "-I", "-c", RUN + code, str(site), *arguments, cwd=folder, env=environment)

    run.site, run.installed = site, set(site.rglob("*"))
    return run


def test_wheel_holds_the_package_and_its_data_and_nothing_else(wheel):
    with zipfile.ZipFile(wheel) as archive:
        names = set(archive.namelist())
    sources = {file.relative_to(ROOT).as_posix() for file in (ROOT / "rso_lidar").rglob("*.py")}
    data = {
        f"rso_lidar/{file.relative_to(ROOT).as_posix()}"
        for folder in ("tle", "models", "gravity", "stars", "examples")
        for file in (ROOT / folder).rglob("*")
        if file.is_file() and "__pycache__" not in file.parts and file.suffix != ".png"  # pictures of pages
        if ROOT / "models" / "build" not in file.parents  # what writes the models
    }
    for name in ("presets.toml", "*.js", "*.css"):
        data |= {file.relative_to(ROOT).as_posix() for file in (ROOT / "rso_lidar").rglob(name)}
    info = f"rso_lidar-{VERSION}.dist-info"
    assert {"rso_lidar/tle/index.toml", "rso_lidar/models/index.toml"} <= data
    assert names - {name for name in names if name.startswith(info)} == sources | data | {"rso_lidar/py.typed"}
    assert f"{info}/licenses/LICENSE" in names
    with zipfile.ZipFile(wheel) as archive:
        assert not [name for name in sources if archive.read(name) != (ROOT / name).read_bytes()]


def test_wheel_says_its_version(away):
    assert VERSION in away("runpy.run_module('rso_lidar', run_name='__main__', alter_sys=True)", "--version")


def test_wheel_finds_what_it_ships(away):
    away(
        "from rso_lidar.shipped import shipped\n"
        "assert shipped('models/index.toml').is_file()\n"
        "assert shipped('tle/index.toml').is_file()\n"
        "assert str(shipped()).startswith(sys.path[0])"
    )


def test_wheel_writes_a_scenario_from_each_example_and_reads_all_that_it_names(away):
    """`new` finds the example, and what it needs, in the wheel. The README's flies: its code is that of the checkout.

    It flies a small sensor with loops that run as Python: to compile all loops anew takes most of a minute.
    """
    code = """
import json, rso_lidar.cli
read = {}
small = "n_rows=16 n_cols=16 rays_per_pixel=4 min_rays_per_target=0".split()
for example in sys.argv[1:]:
    flight = ["run", f"my_{example}.toml", "-o", f"{example}.h5", "--frames", "0:2"]
    flight += [word for setting in small for word in ("--set", f"lidar.receiver.{setting}")]
    for words in (["new", f"my_{example}", "--from", example], *[flight] * (example == "tdrs_approach")):
        try:
            rso_lidar.cli.main(words)
        except SystemExit as left:
            assert not left.code, words
    scenario = rso_lidar.Scenario.load(f"my_{example}.toml", trust_code=True)  # its code is ours
    epochs = scenario.epochs().at(slice(2))  # bodies and surfaces of two frames read all that a scenario names
    bodies = rso_lidar.motion.truth(
        scenario.bodies, epochs, local=scenario.is_local, sun_direction=scenario.world.sun_direction
    )
    read[example] = scenario.instrument.receiver.n_rows > 0 and len(bodies.states) > 0 and len(scenario.surfaces) > 0
with rso_lidar.open("tdrs_approach.h5") as recording:
    print(json.dumps((read, len(recording), recording[1].range_m.ndim)))
"""
    names = [example.stem for example in EXAMPLES]
    assert len(names) > 8
    assert json.loads(away(code, *names, NUMBA_DISABLE_JIT="1").splitlines()[-1]) == [dict.fromkeys(names, True), 2, 2]


def test_loops_of_the_wheel_compile(away):
    away(
        "import numpy as np\n"
        "from rso_lidar.kernels import has_machine_code\n"
        "from rso_lidar.optics.rays.scan_lines import normalise\n"
        "normalise(np.ones((3, 4)))\n"
        "assert has_machine_code(normalise)"
    )


def test_runs_leave_nothing_among_the_installed_data(away):
    """pip has compiled all of it to bytecode and machine code goes elsewhere, so that a run adds nothing at all."""
    assert set(away.site.rglob("*")) - away.installed == set()
