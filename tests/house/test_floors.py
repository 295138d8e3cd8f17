"""The floors of the house: imports only go down, and each heavy library has its room (house contract in pyproject)."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
LINTER = Path(sys.executable).with_name("lint-imports")


def lint(folder, tmp_path):
    """Run the linter over the package in `folder`; return its exit status and report."""
    run = subprocess.run(
        [LINTER, "--no-logo", "--config", folder / "pyproject.toml", "--cache-dir", tmp_path / "cache"],
        cwd=folder,
        env={**os.environ, "PYTHONPATH": str(folder), "COLUMNS": "200"},
        capture_output=True,
        text=True,
    )
    return run.returncode, run.stdout + run.stderr


def test_every_contract_is_kept(tmp_path):
    status, report = lint(ROOT, tmp_path)
    assert status == 0, report
    assert " 0 broken" in report


@pytest.fixture(scope="module")
def burgled(tmp_path_factory):
    """Report on a copy of the package in which every contract is broken by one line."""
    folder = tmp_path_factory.mktemp("house")
    shutil.copy(ROOT / "pyproject.toml", folder)
    shutil.copytree(ROOT / "rso_lidar", folder / "rso_lidar", ignore=shutil.ignore_patterns("__pycache__"))
    faults = {
        "units": "from rso_lidar.records import Frame",  # up the stairs
        "pose": "import rso_lidar",  # the root
        "optics/planted": "from rso_lidar import orbit, scene\n"
        "import h5py, embreex, trimesh, skyfield, matplotlib, typer, rerun",
    }
    for module, fault in faults.items():
        with (folder / "rso_lidar" / f"{module}.py").open("a") as file:
            file.write(f"\n{fault}\n")
    status, report = lint(folder, folder)
    assert status == 1, report
    return report


@pytest.mark.parametrize(
    "contract",
    [
        "Imports only go down, and rooms on one floor have no doors between them",
        "Nothing inside imports the root package",
        "embreex lives in scene",
        "trimesh lives in scene",
        "skyfield and sgp4 live in orbit",
        "Light and files know nothing of orbits: rooms beside motion take records",
        "h5py and its like live in export",
        "matplotlib and Pillow live in picture, in figures beside their question, and where files of the world are images",
        "Rerun lives in one module of picture",
        "typer and rich live in cli",
    ],
)
def test_a_planted_fault_breaks_the_contract(burgled, contract):
    assert f"{contract} BROKEN" in burgled


def test_a_door_between_rooms_is_seen(burgled):
    assert "rso_lidar.optics is not allowed to import rso_lidar.scene" in burgled
