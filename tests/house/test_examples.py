"""Each example stands twice, as TOML and as Python, and the two build equal scenarios."""

import runpy
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"
TOML = sorted(EXAMPLES.glob("*.toml"))


def test_there_are_examples():
    assert TOML


def test_no_twin_is_alone():
    assert {file.stem for file in TOML} == {file.stem for file in EXAMPLES.glob("*.py")}


@pytest.mark.parametrize("file", TOML, ids=lambda file: file.stem)
def test_twins_are_equal(file):
    import rso_lidar as rl

    twin = runpy.run_path(str(file.with_suffix(".py")), run_name="twin")["scenario"]
    scenario = rl.Scenario.load(file)
    assert isinstance(twin, rl.Scenario)
    assert scenario == twin
    assert scenario != twin.replace(seed=twin.seed + 1)


@pytest.mark.slow
def test_nothing_lands_among_the_examples(tmp_path):
    """Commands that name no output, dynamics that are imported, twins and a study's table, from another folder."""
    shutil.copytree(EXAMPLES, tmp_path / "examples", ignore=shutil.ignore_patterns("__pycache__"))
    few = """
version = 1
name = "few"
scenario = "../bench_plate.toml"
sampling = { type = "latin_hypercube", points = 2 }
frames   = "0:1"
merits   = ["detection_fraction"]

[[axis]]
field = "lidar.laser.energy_mj"
low   = 20
high  = 50

[report]
pictures = 0
"""
    (tmp_path / "examples" / "studies" / "few.toml").write_text(few, encoding="utf-8")
    before = sorted((tmp_path / "examples").rglob("*"))
    commands = [
        ["timeline", "examples/bench_plate.toml", "--every", "20"],
        ["truth", "examples/thrusters.toml", "--trust-code", "-o", "truth.csv", "--every", "60"],
        ["trade", "examples/studies/few.toml"],
    ]
    program = (
        "import runpy, sys, rso_lidar.cli\n"
        f"for words in {commands}:\n"
        "    try: rso_lidar.cli.main(words)\n"
        "    except SystemExit as left: assert not left.code, words\n"
        "for name in ('thrusters', 'closed_loop', 'lunar_descent'):\n"
        "    runpy.run_path(f'examples/{name}.py', run_name='twin')\n"
    )
    run = subprocess.run([sys.executable, "-c", program], cwd=tmp_path, capture_output=True, text=True)
    assert run.returncode == 0, run.stdout + run.stderr
    assert sorted((tmp_path / "examples").rglob("*")) == before
    made = {"bench_plate_timeline.png", "truth.csv", "few.csv", "few.html", "examples"}
    assert {file.name for file in tmp_path.iterdir()} == made
