"""The mesh of a target as trackers use it, and the truth of its hinges."""

from __future__ import annotations

import numpy as np

from rso_lidar.records import Truth
from rso_lidar.scenario import Scenario
from rso_lidar.track import MeshHinge, SampledMesh, sample_mesh


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


def measure_hinges_rad(truth: Truth, target: str, hinges: tuple[MeshHinge, ...]) -> np.ndarray:
    """Return the true angles (hinge) [rad] of a target's hinges, from -pi to pi."""
    turns = [truth.pose(target, f"{target}.{hinge.name}").rotation.as_rotvec() @ hinge.direction for hinge in hinges]
    return np.array(turns, dtype=float)
