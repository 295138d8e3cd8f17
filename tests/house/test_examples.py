"""Each example stands twice, as TOML and as Python, and the two build equal scenarios."""

import runpy
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
