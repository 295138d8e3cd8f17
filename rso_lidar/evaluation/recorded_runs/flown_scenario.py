"""The scenario of a recording, and the surfaces of its targets."""

from __future__ import annotations

from pathlib import Path

from rso_lidar.errors import RecordingError, did_you_mean, suppress_warnings
from rso_lidar.records import Source
from rso_lidar.scenario import Scenario
from rso_lidar.scene import Surface


def load_scenario(source: Source, folder: Path | None = None) -> Scenario:
    """Load the scenario of a recording, without its warnings.

    Parameters
    ----------
    source : of the recording
    folder : folder of the mesh files that the scenario names (None: the working folder)

    Returns
    -------
    Scenario
        Python code and FMUs that it names are not run.

    Raises
    ------
    ScenarioError
        For a text that is no valid scenario, and for files that are missing.
    """
    with suppress_warnings():
        return Scenario.loads(source.scenario, folder=folder, where="recording", trust_code=None)


def load_surfaces(scenario: Scenario, source: Source, number: int, asked_by: str) -> tuple[Surface, ...]:
    """Load the surfaces of one target, that of its body first, if its mesh is the recorded one.

    Parameters
    ----------
    number : index of the target

    Raises
    ------
    RecordingError
        For another mesh than the recorded one.
    """
    with suppress_warnings():
        surfaces = scenario.surfaces_of(number)
    sha256 = source.targets[number].mesh_sha256
    if surfaces[0].mesh.sha256 != sha256:
        raise RecordingError(
            f"{asked_by}: {scenario.target[number].model} is not the mesh that was recorded (SHA-256 {sha256[:12]}...); "
            "put that one in its place"
        )
    return surfaces


def find_target(source: Source, target: str | None, asked_by: str) -> int:
    """Find the index of a target.

    Parameters
    ----------
    target : its name (None: the first)

    Raises
    ------
    RecordingError
        For a recording without targets, or without that target.
    """
    names = [entry.name for entry in source.targets]
    if not names:
        raise RecordingError(f"{asked_by}: the recording has no target; record one")
    if target is not None and target not in names:
        raise RecordingError(
            f"{asked_by}: no target named '{target}'{did_you_mean(target, names)} (known: {', '.join(names)})"
        )
    return 0 if target is None else names.index(target)
