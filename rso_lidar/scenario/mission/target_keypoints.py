"""Keypoints of a target: those of the scenario, of a table beside its mesh, or of its model."""

from __future__ import annotations

import csv
import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from rso_lidar.errors import ScenarioError, add_place
from rso_lidar.files import read_text
from rso_lidar.records import Keypoint, TargetEntry
from rso_lidar.scenario.mission.target_surfaces import place_mesh
from rso_lidar.scenario.tables.joints import ModelPlacement
from rso_lidar.scenario.tables.target import Target
from rso_lidar.scene import Mesh, load_mesh, model

_HEADS = ("name", "x", "y", "z")
_MOST_BYTES = 1_000_000  # of a table: some ten thousand points, far more than a craft has
_MOST_POINTS = 1000


class CarriedPoints(NamedTuple):
    """Keypoints that some axes carry: of a body, or of one of its hinges.

    Attributes
    ----------
    axes : name of the axes
    place : (point), index of each among the keypoints of all targets
    position_m : (point, xyz) in these axes [m]
    radius_m : radius of the target about its origin [m]
    """

    axes: str
    place: np.ndarray
    position_m: np.ndarray
    radius_m: float


def group_keypoints(
    targets: Sequence[Target], entries: Sequence[TargetEntry], radii_m: Sequence[float]
) -> tuple[CarriedPoints, ...]:
    """Group the keypoints of all targets by the axes that carry them.

    Parameters
    ----------
    radii_m : radius of each target about its origin [m]
    """
    groups, first = [], 0
    for target, entry, radius_m in zip(targets, entries, radii_m, strict=True):
        carriers = {part: joint for joint in target.joints for part in joint.parts}
        of_axes: dict[str, list[tuple[int, np.ndarray]]] = {}
        for index, point in enumerate(entry.keypoints, first):
            joint = carriers.get(point.part or "")
            axes, origin_m = target.name, np.zeros(3)
            if joint is not None:
                axes, origin_m = target.joint_axes(joint), np.array(joint.position_m)
            of_axes.setdefault(axes, []).append((index, np.array(point.position_m) - origin_m))
        for axes, points in of_axes.items():
            place = np.array([index for index, _ in points])
            groups.append(CarriedPoints(axes, place, np.array([position for _, position in points]), radius_m))
        first += len(entry.keypoints)
    return tuple(groups)


def find_keypoints(target: Target, mesh: Mesh, file: Callable[[str], Path]) -> tuple[Keypoint, ...]:
    """Find the keypoints of a target in its body axes.

    Returns
    -------
    tuple of Keypoint
        Those of the scenario, else of its table, else of the model in the catalogue.

    Raises
    ------
    ScenarioError
        If the table cannot be read, a name is twice, or the mesh lacks a part.
    """
    with add_place("keypoint_file" if target.keypoint_file else "keypoint"):
        if target.keypoint is not None:
            points = target.keypoint
        else:
            given = () if target.is_path or target.library is not None else model(target.shape).keypoints
            if target.keypoint_file is not None:
                given = read_keypoints(file(target.keypoint_file))
            placement = _place(target, mesh, file)
            points = tuple(point.replace(position_m=placement.point(point.position_m)) for point in given)
        if len(points) > _MOST_POINTS:
            raise ScenarioError(f"gives {len(points):,} points, over {_MOST_POINTS:,}; give fewer")
        names = [point.name for point in points]
        if twice := [name for name in names if names.count(name) > 1]:
            raise ScenarioError(f"two points have the name '{twice[0]}'; rename one")
        mesh.check_parts("part", (point.part for point in points if point.part is not None))
    return points


def _place(target: Target, mesh: Mesh, file: Callable[[str], Path]) -> ModelPlacement:
    """Return the placement of a target's mesh in body axes."""
    entry = None if target.is_path else model(target.shape)
    if entry is not None:
        mesh = entry.mesh
    elif target.model is not None:
        mesh = load_mesh(file(target.shape))  # whole, which a surface with hinges is not
    scale, center_of_mass_m = place_mesh(target, mesh, entry)
    return ModelPlacement(scale, np.array(center_of_mass_m), target.mesh_axes)


def read_keypoints(path: Path) -> tuple[Keypoint, ...]:
    """Read a table of keypoints (name, x, y, z, part), .csv; positions are in the unit and axes of the table.

    Raises
    ------
    ScenarioError
        If the table cannot be read.
    """
    try:
        rows = list(csv.reader(read_text(path, _MOST_BYTES, ScenarioError, "table (.csv)").splitlines()))
    except csv.Error:
        raise ScenarioError(f"{path.name}: cannot be read; give a text with the columns name, x, y, z, part") from None
    points = []
    for line, row in enumerate(rows, start=1):
        cells = [cell.strip() for cell in row]
        if not any(cells) or (line == 1 and tuple(cells[:4]) == _HEADS):
            continue
        try:
            x, y, z = (float(cell) for cell in cells[1:4])
            if len(cells) > 5 or not all(map(math.isfinite, (x, y, z))):
                raise ValueError
        except ValueError:
            raise ScenarioError(f"{path.name}: line {line}: needs name, x, y, z, and perhaps a part") from None
        part = cells[4] if len(cells) > 4 and cells[4] else None
        with add_place(f"{path.name}: line {line}"):
            points.append(Keypoint(name=cells[0], position_m=(x, y, z), part=part))
    return tuple(points)
