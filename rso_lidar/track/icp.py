"""Pose from points against the target's mesh: point-to-plane ICP, from a guess or from none.

Besl and McKay (1992) with the plane's distance of Chen and Medioni (1992), linearised; nearest neighbours are scipy's.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from rso_lidar.errors import ScenarioError
from rso_lidar.pose import pose

if TYPE_CHECKING:
    from scipy.spatial.transform import RigidTransform, Rotation

_FARTHEST = 3.0  # distance over the median, above which a pair is left out of a step
_STEPS, _STILL = 60, 1e-6  # of a step, in radians and in shares of the model's radius
_COARSE_POINTS, _COARSE_STEPS = 150, 12  # for each of the starts without a guess
_SILHOUETTE = 500  # model points whose outline is compared with the points
_FEWEST = 6  # unknowns of a pose
_UNLIKE_RAD = 0.5
_TURNS, _TURN_POINTS = 24, 200  # about each axis; a step of 15 deg is within the reach of an alignment
_TURNS_TRIED = 6  # of them, the best are aligned
LIKELIER = 10.0  # log-likelihood over that of the first pose, above which a turn is better: odds of 20,000 to 1
_UNLIKELY = 1.1  # misfit over that of the first pose, above which a turn puts the model outside the outline
_FAR = 0.04  # greatest distance that counts, in shares of the model's radius


@dataclass(frozen=True, eq=False)
class SampledMesh:
    """Points (point, 3) [m] spread evenly over a mesh, in body axes, with their facets' unit normals."""

    points_m: np.ndarray
    normals: np.ndarray

    @cached_property
    def tree(self) -> Any:
        """Points as scipy's k-d tree."""
        from scipy.spatial import cKDTree

        return cKDTree(self.points_m)

    @cached_property
    def middle_m(self) -> np.ndarray:
        """Mean of the points (xyz) [m]."""
        middle: np.ndarray = self.points_m.mean(axis=0)
        return middle

    @cached_property
    def principal_axes(self) -> np.ndarray:
        """Unit vectors (axis, xyz) of the principal axes of the points, that of the least spread first."""
        off = self.points_m - self.middle_m
        axes: np.ndarray = np.linalg.eigh(np.einsum("ni,nj->ij", off, off))[1].T
        return axes

    @property
    def long_axis(self) -> np.ndarray:
        """Unit vector (xyz) along which the points spread most."""
        longest: np.ndarray = self.principal_axes[-1]
        return longest

    @cached_property
    def radius_m(self) -> float:
        """Distance of the farthest point from the mean [m]."""
        return float(np.sqrt(((self.points_m - self.middle_m) ** 2).sum(axis=1).max()))


@dataclass(frozen=True, eq=False)
class Alignment:
    """Result of an alignment: lidar_from_body, the rms distance of points from facets [m], and the number of steps."""

    pose: RigidTransform
    rms_m: float
    steps: int


def sample_mesh(corners_m: np.ndarray, count: int = 20_000, rng: np.random.Generator | None = None) -> SampledMesh:
    """Sample points evenly over the area of a mesh.

    Parameters
    ----------
    corners_m : corners (facet, 3, xyz) of its facets [m].
    count : number of points.
    rng : random generator for the points; None for a fixed sequence.

    Returns
    -------
    points and normals of the mesh, in its axes.

    Raises
    ------
    ScenarioError
        If the corners have another shape.
    """
    corners = np.asarray(corners_m, dtype=float)
    if corners.ndim != 3 or corners.shape[1:] != (3, 3) or not len(corners):
        raise ScenarioError(f"icp: the corners of facets are (facet, 3, xyz), not {corners.shape}")
    rng = rng or np.random.Generator(np.random.Philox(count))
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    double = np.sqrt((normal**2).sum(axis=1))
    facet = rng.choice(len(corners), count, p=double / double.sum())
    a, b = np.sort(rng.random((2, count)), axis=0)  # even over a triangle
    first, second, third = (corners[facet, k] for k in range(3))
    points = a[:, None] * first + (b - a)[:, None] * second + (1.0 - b)[:, None] * third
    return SampledMesh(points, normal[facet] / double[facet, None])


def align(points_m: np.ndarray, model: SampledMesh, guess: RigidTransform, steps: int = _STEPS) -> Alignment:
    """Align points with a model by point-to-plane ICP from a guess.

    Each step pairs every point with the nearest one of the model, and drops pairs more than three times the median
    apart. It then solves for the small rotation and shift that bring the points into the planes of the model.

    Parameters
    ----------
    points_m : points (n, 3) in lidar axes [m].
    model : points and normals of the target.
    guess : lidar_from_body to start from.
    steps : greatest number of steps.

    Returns
    -------
    pose lidar_from_body, with the rms distance of the points.

    Raises
    ------
    ScenarioError
        If there are fewer than six points.
    """
    points = np.asarray(points_m, dtype=float)
    if points.ndim != 2 or points.shape[1] != 3 or len(points) < _FEWEST:
        raise ScenarioError(f"icp: a pose needs at least {_FEWEST} points (n, 3), not {points.shape}")
    body_from_lidar = guess.inv()
    taken, off = 0, np.zeros(1)
    while taken < steps:
        taken += 1
        seen = body_from_lidar.apply(points)
        apart, nearest = model.tree.query(seen)
        kept = apart <= max(_FARTHEST * float(np.median(apart)), 1e-9 * model.radius_m)
        at, normal = seen[kept], model.normals[nearest[kept]]
        middle = at.mean(axis=0)
        arm = np.cross(at - middle, normal) / model.radius_m
        off = ((model.points_m[nearest[kept]] - at) * normal).sum(axis=1)
        rows = np.concatenate([arm, normal], axis=1)
        # A small stiffness fixes what the points do not determine, such as the rotation of a disc about its axis.
        square = np.einsum("ni,nj->ij", rows, rows) + 1e-6 * len(rows) * np.eye(6)
        small = np.linalg.solve(square, np.einsum("ni,n->i", rows, off))
        turn, shift = small[:3] / model.radius_m, small[3:]
        rotation = _make_rotation(turn)
        body_from_lidar = pose(middle + shift - rotation.apply(middle), rotation) * body_from_lidar
        if np.abs(turn).max() < _STILL and np.abs(shift).max() < _STILL * model.radius_m:
            break
    return Alignment(body_from_lidar.inv(), float(np.sqrt(np.mean(off**2))), taken)


def acquire(
    points_m: np.ndarray, model: SampledMesh, starts: int = 96, count: int = 1, half_field_rad: float = np.inf
) -> list[Alignment]:
    """Find poses lidar_from_body without a guess.

    A super-Fibonacci spiral (Alexa 2022) gives start attitudes, even over all rotations. Each is aligned for a few
    steps from the mean of the points. The misfit adds the distance of points from the model to the distance, across the
    line of sight, of the model from the points. Parts hidden behind the points therefore add nothing.

    The three best poses are aligned to the end, or `count` poses that differ by 0.5 rad or more; those whose long axes
    differ come first. For a target that looks the same from several sides, any of these may be found.

    Parameters
    ----------
    points_m : points (n, 3) in lidar axes [m].
    model : of the target.
    starts : number of start attitudes.
    count : most poses to return.
    half_field_rad : as in `misfit_m`.

    Returns
    -------
    poses, the best first.
    """
    points = np.asarray(points_m, dtype=float)
    some = points[:: max(1, len(points) // _COARSE_POINTS)]
    outline = find_outline(points)
    middle = points.mean(axis=0)
    tried = []
    for rotation in _spread_rotations(starts):
        start = pose(middle - rotation.apply(model.middle_m), rotation)
        found = align(some, model, start, _COARSE_STEPS)
        tried.append((misfit_m(found.pose, model, some, outline, half_field_rad), found))
    ranked = [found for _, found in sorted(tried, key=lambda one: one[0])]
    best = ranked[:3] if count == 1 else _select_unlike(ranked, model, count)
    finished = [align(points, model, found.pose) for found in best]
    for place, found in enumerate(finished):
        other, gain = search_turns(points, model, found, half_field_rad)
        if gain > LIKELIER:
            finished[place] = align(points, model, other.pose)
    return sorted(finished, key=lambda found: misfit_m(found.pose, model, points, outline, half_field_rad))[:count]


def search_turns(
    points_m: np.ndarray, model: SampledMesh, found: Alignment, half_field_rad: float = np.inf
) -> tuple[Alignment, float]:
    """Search the turns of a pose about the principal axes of the model for the best other one.

    A body that is nearly round about an axis is aligned at any turn about it. What is not round, such as tanks, brackets
    and nozzles, then lies beside the model, and the distances of points from the planes of their facets show it. Each
    distance is limited, so that a few points do not outweigh the rest. The likeliest turns of 15 degrees each are aligned.

    Parameters
    ----------
    points_m : points (n, 3) in lidar axes [m].
    model : of the target.
    found : the pose to start from.
    half_field_rad : as in `misfit_m`.

    Returns
    -------
    the best other pose, and its log-likelihood over that of the first one, under normal errors; minus infinity if it would
    put the model outside the outline of the points.
    """
    points = np.asarray(points_m, dtype=float)
    some = points[:: max(1, len(points) // _TURN_POINTS)]
    steps = [(axis, step) for axis in range(3) for step in range(1, _TURNS)]
    turns = [_make_rotation(step * (2.0 * np.pi / _TURNS) * model.principal_axes[axis]) for axis, step in steps]
    seen, middle = found.pose.inv().apply(some), model.middle_m
    squares = _measure_planes_m2(np.array([turn.apply(seen - middle) + middle for turn in turns]), model)
    chosen: list[int] = []
    for number in np.argsort(squares).tolist():
        beside = {(steps[one][0], steps[one][1] + off) for one in chosen for off in (-1, 1)}
        if len(chosen) < _TURNS_TRIED and steps[number] not in beside:
            chosen.append(number)
    tried = []
    for number in chosen:
        turn = turns[number]  # body_from_lidar becomes turn * body_from_lidar, about the middle of the model
        start = pose(middle - turn.apply(middle), turn) * found.pose.inv()
        tried.append(align(some, model, start.inv(), _COARSE_STEPS))
    first, *others = _measure_planes_m2(np.array([one.pose.inv().apply(points) for one in (found, *tried)]), model)
    best = int(np.argmin(others))
    gain, outline = 0.5 * len(points) * float(first / others[best] - 1.0), find_outline(points)
    other = tried[best]
    before_m, after_m = (misfit_m(one.pose, model, points, outline, half_field_rad) for one in (found, other))
    return other, -np.inf if after_m > _UNLIKELY * before_m else gain


def _measure_planes_m2(clouds_m: np.ndarray, model: SampledMesh) -> np.ndarray:
    """Measure the mean square distance (cloud) [m2] of points from the planes of their nearest facets, each limited.

    Parameters
    ----------
    clouds_m : points (cloud, n, 3) in body axes [m].
    model : of the target.
    """
    _, nearest = model.tree.query(clouds_m.reshape(-1, 3))
    off = ((clouds_m.reshape(-1, 3) - model.points_m[nearest]) * model.normals[nearest]).sum(axis=1)
    limited = np.minimum(np.abs(off), _FAR * model.radius_m)
    squares: np.ndarray = np.mean(limited.reshape(clouds_m.shape[:2]) ** 2, axis=1)
    return squares


def find_outline(points_m: np.ndarray) -> Any:
    """Return the directions x/z, y/z (n, 2) of points [m] in lidar axes, as scipy's k-d tree."""
    from scipy.spatial import cKDTree

    return cKDTree(points_m[:, :2] / points_m[:, 2:])


def misfit_m(
    lidar_from_body: RigidTransform,
    model: SampledMesh,
    points_m: np.ndarray,
    outline: Any,
    half_field_rad: float = np.inf,
) -> float:
    """Measure the misfit of a pose: rms distance of points from the model, plus that of the model from their outline.

    Parts of the model outside the field of view are not compared with the outline.

    Parameters
    ----------
    lidar_from_body : the pose.
    model : points of the target.
    points_m : points (n, 3) in lidar axes [m].
    outline : result of `find_outline`; distances from it are across the line of sight.
    half_field_rad : half of the side of a square field of view [rad]; infinite for a target that is entirely inside.

    Returns
    -------
    misfit [m]; infinite if the model is not entirely ahead of the lidar, or entirely outside the field of view.
    """
    apart, _ = model.tree.query(lidar_from_body.inv().apply(points_m))
    shown = lidar_from_body.apply(model.points_m[:: max(1, len(model.points_m) // _SILHOUETTE)])
    if not (shown[:, 2] > 0.0).all():
        return np.inf
    across, ahead_m = shown[:, :2] / shown[:, 2:], shown[:, 2]
    if np.isfinite(half_field_rad):
        inside = (np.abs(across) <= np.tan(half_field_rad)).all(axis=1)
        if not inside.any():
            return np.inf
        across, ahead_m = across[inside], ahead_m[inside]
    beside, _ = outline.query(across)
    return float(np.sqrt(np.mean(apart**2)) + np.sqrt(np.mean((beside * ahead_m) ** 2)))


def _select_unlike(ranked: list[Alignment], model: SampledMesh, count: int) -> list[Alignment]:
    """Select poses that differ, first those whose long axes do.

    Parameters
    ----------
    ranked : poses, the best first.
    model : points of the target, with its long axis.
    count : greatest number of poses to select.

    Returns
    -------
    the selected poses, the best first.
    """
    chosen: list[Alignment] = []
    for by_axis in (True, False):
        for found in ranked:
            if len(chosen) < count and all(
                _angle_between_rad(found, other, model, by_axis) > _UNLIKE_RAD for other in chosen
            ):
                chosen.append(found)
    return chosen


def _angle_between_rad(one: Alignment, other: Alignment, model: SampledMesh, by_axis: bool) -> float:
    """Compute the angle between two poses [rad].

    Parameters
    ----------
    one, other : the poses.
    model : points of the target, with its long axis.
    by_axis : whether to compare the directions of the long axis only.

    Returns
    -------
    angle from 0 to pi [rad].
    """
    if by_axis:
        a, b = (found.pose.rotation.apply(model.long_axis) for found in (one, other))
        return float(np.arctan2(np.linalg.norm(np.cross(a, b)), np.dot(a, b)))
    return float((one.pose.rotation.inv() * other.pose.rotation).magnitude())


def _make_rotation(turn_rad: np.ndarray) -> Rotation:
    from scipy.spatial.transform import Rotation

    return Rotation.from_rotvec(turn_rad)


def _spread_rotations(count: int) -> list[Rotation]:
    """Return rotations that are even over all rotations (super-Fibonacci spiral, Alexa 2022)."""
    from scipy.spatial.transform import Rotation

    s = np.arange(count) + 0.5
    t = s / count
    alpha, beta = 2.0 * np.pi * s / np.sqrt(2.0), 2.0 * np.pi * s / 1.533751168755204288118041413
    near, far = np.sqrt(t), np.sqrt(1.0 - t)
    quaternions = np.stack([near * np.sin(alpha), near * np.cos(alpha), far * np.sin(beta), far * np.cos(beta)], axis=1)
    return [Rotation.from_quat(one) for one in quaternions]


def measure_visible_centroid(model: SampledMesh, directions: int = 60, cells: int = 32) -> tuple[float, float, float]:
    """Measure the offset of the visible centroid of a model from its origin, over all viewing directions.

    Parameters
    ----------
    model : of the target.
    directions : number of viewing directions.
    cells : cells per side of the grid about the model; the nearest point in each cell is visible.

    Returns
    -------
    mean along the line of sight [m], negative toward the lidar; its standard deviation [m]; rms across it per axis [m].
    """
    along, across = [], []
    width = 2.0 * model.radius_m / cells
    for rotation in _spread_rotations(directions):
        shown = rotation.apply(model.points_m)
        place = np.floor((shown[:, :2] - rotation.apply(model.middle_m)[:2]) / width).astype(int) + cells
        cell = place[:, 0] * (2 * cells) + place[:, 1]
        order = np.lexsort((shown[:, 2], cell))
        nearest = order[np.flatnonzero(np.diff(cell[order], prepend=-1))]
        middle = shown[nearest].mean(axis=0)
        along.append(middle[2])
        across.append(middle[:2])
    return float(np.mean(along)), float(np.std(along)), float(np.sqrt(np.mean(np.square(across))))
