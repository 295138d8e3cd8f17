"""A scenario runs no code that its file or its text names, whatever reads it, unless that code is trusted."""

import sys

import numpy as np
import pytest

import rso_lidar as rl
from rso_lidar.errors import ScenarioError
from rso_lidar.evaluation import load_scenario
from rso_lidar.motion.dynamics import flight

CODE = """
from pathlib import Path
Path(__file__).with_name("it_ran").touch()
def drift(t, x, u):
    return [*x[3:], 0.0, 0.0, 0.0]
"""
MOTION = "motion = { type = 'state_space', axes = 'local', dynamics = '%s', initial_state = [0, 0, 0, 0, 0, 0] }"


@pytest.fixture(params=["file", "module"])
def named(request, text, tmp_path, monkeypatch):
    """Return the folder, and the text of a scenario that names code in a file or in a module."""
    name = f"strange_dynamics_{tmp_path.name}"  # flights are remembered by the name of their dynamics
    (tmp_path / f"{name}.py").write_text(CODE)
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.chdir(tmp_path)
    place = f"{name}.py:drift" if request.param == "file" else f"{name}:drift"
    old = 'motion = { type = "fixed", position_m = [0, 0, 0] }'
    assert old in text
    yield tmp_path, text.replace(old, MOTION % place)
    sys.modules.pop(name, None)


@pytest.fixture
def recording(named):
    """Return a recording whose scenario names code, and make sure that the code has not run since it was made."""
    folder, text = named
    (folder / "s.toml").write_text(text)
    path = rl.save(folder / "x.h5", rl.simulate(rl.Scenario.load(folder / "s.toml", trust_code=True), frames=[0, 1, 2]))
    assert (folder / "it_ran").exists()
    (folder / "it_ran").unlink()
    (code,) = folder.glob("strange_dynamics_*.py")
    sys.modules.pop(code.stem, None)
    code.write_text(CODE + "# changed, so that no cache holds it\n")
    flight._cache_flight.cache_clear()
    return path


def test_a_file_runs_the_code_it_names_only_where_it_is_trusted(named):
    folder, text = named
    (folder / "s.toml").write_text(text)
    with pytest.raises(
        ScenarioError, match=r"^s\.toml: follower\.motion: dynamics: .* in Python trust_code=True, or trust its folder"
    ):
        next(rl.simulate(rl.Scenario.load(folder / "s.toml")))
    assert not (folder / "it_ran").exists()
    assert next(rl.simulate(rl.Scenario.load(folder / "s.toml", trust_code=True))).index == 0
    assert (folder / "it_ran").exists()


def test_reading_a_recording_runs_nothing(recording, call_line):
    folder = recording.parent
    with rl.open(recording) as read:
        text = read.source.scenario
        assert "strange_dynamics" in text and len(list(read)) == 3
    for words in (
        ["info", recording],
        ["plot", recording, "-o", folder / "p.png"],
        ["animate", recording, folder / "a.gif"],
        ["track", recording],
        ["export", recording, "--to", folder / "x.npz"],
        ["export", recording, "--to", folder / "x.csv"],
    ):
        status, said = call_line(words)
        assert status == 0, said
        assert not (folder / "it_ran").exists(), words
    assert not [name for name in sys.modules if name.startswith("strange_dynamics_")]


def test_a_recording_whose_code_would_be_needed_is_refused_with_a_cure_that_exists(recording):
    scenario = load_scenario(rl.open(recording).source, recording.parent)
    with pytest.raises(
        ScenarioError, match=r"^recording: follower\.motion: dynamics: names the Python code '.*'"
    ) as refused:
        _ = scenario.bodies
    assert str(refused.value).endswith("which never runs from a recording; take a recording of other motions")


def test_flying_the_text_of_a_recording_is_refused_unless_it_is_trusted(recording):
    with rl.open(recording) as read:
        text, first = read.source.scenario, read[0]
    scenario = rl.Scenario.loads(text, where="recording")
    for fly in (lambda: next(rl.simulate(scenario)), scenario.describe, lambda: rl.timeline(scenario), scenario.dumps):
        with pytest.raises(ScenarioError, match=r"recording: follower\.motion: dynamics: names the Python code"):
            fly()
    with pytest.raises(ScenarioError, match="names the Python code"):
        next(rl.simulate(scenario.replace(seed=3)))
    assert not (recording.parent / "it_ran").exists()
    frame = next(rl.simulate(rl.Scenario.loads(text, trust_code=True)))
    assert np.array_equal(frame.range_m, first.range_m, equal_nan=True)
    assert (recording.parent / "it_ran").exists()


@pytest.fixture
def call_line(capsys):
    from rso_lidar.cli import main

    def run(words):
        with pytest.raises(SystemExit) as left:
            main([str(word) for word in words])
        printed = capsys.readouterr()
        return left.value.code or 0, printed.out + printed.err

    return run
