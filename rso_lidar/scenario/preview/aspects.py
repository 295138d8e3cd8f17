"""Attitudes of a target relative to the lidar over a run, as truths of single epochs."""

from __future__ import annotations

import math

import numpy as np

from rso_lidar.pose import Link, PoseTree
from rso_lidar.records import Truth
from rso_lidar.scenario.mission.mission import Mission
from rso_lidar.scenario.preview.geometry import Preview

_SAME_ATTITUDE_RAD = 2e-3  # 0.1 deg: a smaller rotation changes the light by less than the sampling error
_SAME_RANGE = 0.05  # relative difference in range up to which the attitude of another epoch is used


def collect_attitudes(mission: Mission, preview: Preview, number: int, row: int, most: int) -> list[Truth]:
    """Collect the attitudes that a target has near one epoch, each as a truth with the place of that epoch."""
    name = mission.target[number].name
    here = preview.truth.at(row)
    range_m = preview.targets[number].range_m
    if most == 1 or not range_m[row] > 0.0:
        return [here]
    off = np.flatnonzero(np.abs(range_m - range_m[row]) > _SAME_RANGE * range_m[row])
    first, last = int(off[off < row].max(initial=-1)) + 1, int(off[off > row].min(initial=len(range_m)))
    near = np.arange(first, last)
    rows = np.unique(near[np.linspace(0, len(near) - 1, most).round().astype(int)])
    turns = np.broadcast_to(preview.truth.poses.place("lidar", name)[1], (len(range_m), 3, 3))
    places = np.broadcast_to(preview.truth.poses.place("lidar", name)[0], (len(range_m), 3))
    rotations: list[np.ndarray] = []
    truths = []
    for at in [row, *(int(other_row) for other_row in rows if other_row != row)]:
        turned = rotation_between(places[at], places[row]) @ turns[at]
        # The trace of a rotation matrix is 1 + 2 cos(angle).
        if any(np.trace(rotation.T @ turned) > 1.0 + 2.0 * math.cos(_SAME_ATTITUDE_RAD) for rotation in rotations):
            continue
        rotations.append(turned)
        links = link_surfaces(mission, number, preview.truth.at(at), places[row], turned)
        for surface in mission.surfaces:
            if surface.name not in links:
                links[surface.name] = Link(here.poses.place("lidar", surface.name), np.zeros(3), np.zeros(3))
        truths.append(build_truth(here.time_s, links))
    return truths


def link_surfaces(
    mission: Mission, number: int, there: Truth, place_m: np.ndarray, turned: np.ndarray
) -> dict[str, Link]:
    """Compute lidar_from_surface of each surface of a target that is moved to another pose, its hinges unchanged.

    Parameters
    ----------
    there : the truth that gives the hinge angles
    place_m, turned : lidar_from_target, as translation (3) [m] and matrix (3, 3)
    """
    name = mission.target[number].name
    lidar_from_target = Link((place_m, turned), np.zeros(3), np.zeros(3))
    return {
        surface.name: lidar_from_target * Link(there.poses.place(name, surface.name), np.zeros(3), np.zeros(3))
        for surface in mission.surfaces_of(number)
    }


def build_truth(time_s: float, links: dict[str, Link]) -> Truth:
    """Build a truth that holds only the lidar and surfaces in its axes, without bodies and without a Sun."""
    parents = dict.fromkeys(links, "lidar") | {"lidar": "inertial"}
    return Truth(time_s, PoseTree(parents, {"lidar": Link.still(), **links}), {}, np.full(3, np.nan))


def rotation_between(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Return the smallest rotation matrix (3, 3) that turns the direction of `a` into that of `b`."""
    a, b = a / np.linalg.norm(a), b / np.linalg.norm(b)
    axis, cosine = np.cross(a, b), float(a @ b)
    if cosine < -1.0 + 1e-9:  # opposite: the axis is undefined, and the lidar sees nothing behind it
        return np.eye(3)
    x, y, z = axis
    skew = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    turn: np.ndarray = np.eye(3) + skew + skew @ skew / (1.0 + cosine)
    return turn
