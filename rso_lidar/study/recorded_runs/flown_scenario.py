"""From a recording back to what was flown: its scenario, and the surfaces of its targets, once they are the same."""

from __future__ import annotations

from pathlib import Path

from rso_lidar.errors import RecordingError, unwarned
from rso_lidar.records import Source
from rso_lidar.scenario import Scenario
from rso_lidar.scene import Surface


def load_scenario(source: Source, folder: Path | None = None) -> Scenario:
    """Return the scenario that a recording holds; `folder` is where mesh files lie that it names (None: as for any)."""
    with unwarned():
        return Scenario.loads(source.scenario, folder=folder, where="recording")


def load_surfaces(scenario: Scenario, source: Source, number: int, asked_by: str) -> tuple[Surface, ...]:
    """Return the surfaces of one target by number, its body's first, of the mesh that was recorded and no other."""
    with unwarned():
        surfaces = scenario.surfaces_of(number)
    sha256 = source.targets[number].mesh_sha256
    if surfaces[0].mesh.sha256 != sha256:
        raise RecordingError(
            f"{asked_by}: {scenario.target[number].model} is not the mesh that was recorded (SHA-256 {sha256[:12]}...); "
            "put that one in its place"
        )
    return surfaces
