"""The scenario of a recording, and the surfaces of its targets, also as trackers use them."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from rso_lidar.errors import RecordingError, did_you_mean, suppress_warnings
from rso_lidar.records import Source
from rso_lidar.scenario import Scenario
from rso_lidar.scene import Surface
from rso_lidar.track import MeshHinge, SampledMesh, sample_mesh


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


def find_recorded_target(source: Source, target: str | None, asked_by: str) -> int:
    """Find the index of a target by name (None: the first).

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


def sample_target(scenario: Scenario, number: int = 0, *, hinged: bool = True) -> SampledMesh:
    """Sample the mesh of a target for ICP.

    Parameters
    ----------
    scenario : with the target
    number : index of the target
    hinged : whether its hinges may turn; otherwise it is a rigid mesh with all of them at zero

    Returns
    -------
    points of the mesh with all hinges at zero.
    """
    corners, joints = scenario.corners_of(number), scenario.target[number].joints
    if not (hinged and joints):
        return sample_mesh(corners)
    counts = [len(surface.corners) for surface in scenario.surfaces_of(number)]  # of the body, then of each hinge
    return sample_mesh(
        corners,
        hinges=[MeshHinge(joint.name, joint.position_m, joint.axis) for joint in joints],
        hinge_of_facet=np.repeat(np.arange(-1, len(joints)), counts),
    )
