"""Pose and hinge angles from points against the target's mesh, from a guess: point-to-plane ICP.

Besl and McKay (1992) with the plane's distance of Chen and Medioni (1992), linearised; nearest neighbours are scipy's.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from rso_lidar.errors import ScenarioError
from rso_lidar.pose import pose
from rso_lidar.track.pose.sampled_mesh import SampledMesh

if TYPE_CHECKING:
    from scipy.spatial.transform import RigidTransform, Rotation

HalfField = float | tuple[float, float]

UNKNOWN_ANGLE_RAD = np.pi / np.sqrt(3.0)  # standard deviation of an angle that is uniform over the circle
# "Assumed": no record says how the value was chosen. docs/tracking.md has the errors at half and double of some.
# Distance over the median, above which a pair is left out of a step: 2 sigma of a normal error; assumed.
_FARTHEST = 3.0
_STEPS = 60  # greatest number of steps; assumed
_STILL = 1e-6  # greatest rotation [rad], and shift in radii of the model, of a last step; assumed
_ROUNDING = 1e-9  # of the model's radius: a distance that is none, as in points taken from the model itself
_SILHOUETTE = 500  # model points whose outline is compared with the points; assumed
_FEWEST = 6  # unknowns of a pose
_STIFFNESS = 1e-6  # for each pair, whose own squares are about 1: too small to move what the points determine; assumed
# Assumed: of five points, one gives the angle and four check it. Fewer may be returns from the edges of other parts.
_FEWEST_ON_HINGE = 5
_MOST_HINGE_STEP_RAD = 0.35  # 20 deg: beyond it, the pairs of an array are others, and the linear step is not valid


@dataclass(frozen=True, eq=False)
class Alignment:
    """Result of an alignment: lidar_from_body, the rms distance of points from facets [m], and the number of steps.

    `hinge_angles_rad` are the angles of the mesh's hinges by name, right-handed about their axes from the mesh at zero, and
    `hinge_sigmas_rad` their standard deviations for independent errors of the points.
    """

    pose: RigidTransform
    rms_m: float
    steps: int
    hinge_angles_rad: Mapping[str, float] = field(default_factory=dict)
    hinge_sigmas_rad: Mapping[str, float] = field(default_factory=dict)


def align(
    points_m: np.ndarray,
    model: SampledMesh,
    guess: RigidTransform,
    steps: int = _STEPS,
    hinge_sigmas_rad: Mapping[str, float] | None = None,
) -> Alignment:
    """Align points with a model by point-to-plane ICP from a guess.

    Each step pairs every point with the nearest one of the model, and drops pairs more than three times the median
    apart. It then solves for the small rotation and shift that bring the points into the planes of the model, and for the
    small turn of each hinge. The angles of the model are the guess of the hinges.

    Parameters
    ----------
    points_m : points (n, 3) in lidar axes [m]
    model : points and normals of the target
    guess : lidar_from_body to start from
    steps : greatest number of steps
    hinge_sigmas_rad : standard deviation of the guess of each hinge by name [rad]. A hinge that is not named has that of an
        angle of which nothing is known, uniform over the circle: 104 degrees. A hinge that no point shows keeps its guess

    Returns
    -------
    pose lidar_from_body and hinge angles, with the rms distance of the points

    Raises
    ------
    ScenarioError
        If there are fewer than six points
    """
    from scipy.spatial.transform import Rotation

    points = np.asarray(points_m, dtype=float)
    if points.ndim != 2 or points.shape[1] != 3 or len(points) < _FEWEST:
        raise ScenarioError(f"icp: a pose needs at least {_FEWEST} points (n, 3), not {points.shape}")
    sigmas = hinge_sigmas_rad or {}
    sigma_rad = np.array([sigmas.get(hinge.name, UNKNOWN_ANGLE_RAD) for hinge in model.hinges])
    believed = np.array(model.hinge_angles_rad)
    body_from_lidar, angles = guess.inv().as_matrix(), believed.copy()
    matrix, shift_m = (
        body_from_lidar[:3, :3],
        body_from_lidar[:3, 3],
    )  # a product of transforms takes longer than a step
    taken, off, rows = 0, np.zeros(1), np.zeros((1, _FEWEST + len(believed)))
    while taken < steps:
        taken += 1
        seen = np.einsum("ij,nj->ni", matrix, points) + shift_m
        apart, nearest = model.find_nearest(seen, angles)
        kept = apart <= max(_FARTHEST * float(np.median(apart)), _ROUNDING * model.radius_m)
        at = seen[kept]
        on, normal = model.locate(nearest[kept], angles)
        middle = at.mean(axis=0)
        arm = np.cross(at - middle, normal) / model.radius_m
        off = ((on - at) * normal).sum(axis=1)
        rows = np.concatenate([arm, normal, *_turn_rows(at, normal, nearest[kept], model)], axis=1)
        # A small stiffness fixes what the points do not determine, such as the rotation of a disc about its axis.
        square = np.einsum("ni,nj->ij", rows, rows) + _STIFFNESS * len(rows) * np.eye(rows.shape[1])
        right = np.einsum("ni,n->i", rows, off)
        if model.hinges:
            weight = np.mean(off**2) / (sigma_rad * model.radius_m) ** 2
            square[_FEWEST:, _FEWEST:] += np.diag(weight)
            right[_FEWEST:] += weight * (believed - angles) * model.radius_m
        small = np.linalg.solve(square, right)
        turn, shift = small[:3] / model.radius_m, small[3:_FEWEST]
        rotation = make_rotation(turn).as_matrix()
        matrix, shift_m = rotation @ matrix, rotation @ (shift_m - middle) + middle + shift
        swing = np.clip(small[_FEWEST:] / model.radius_m, -_MOST_HINGE_STEP_RAD, _MOST_HINGE_STEP_RAD)
        angles = angles + swing
        turned_rad = np.concatenate([turn, swing])
        if np.abs(turned_rad).max() < _STILL and np.abs(shift).max() < _STILL * model.radius_m:
            break
    lidar_from_body = pose(shift_m, Rotation.from_matrix(matrix)).inv()
    alignment = Alignment(lidar_from_body, float(np.sqrt(np.mean(off**2))), taken)
    if not model.hinges:
        return alignment
    spread_rad = _estimate_hinge_sigmas_rad(rows, off, sigma_rad, model.radius_m)
    names = [hinge.name for hinge in model.hinges]
    return replace(
        alignment,
        hinge_angles_rad=dict(zip(names, angles.tolist(), strict=True)),
        hinge_sigmas_rad=dict(zip(names, spread_rad.tolist(), strict=True)),
    )


def _turn_rows(at: np.ndarray, normal: np.ndarray, nearest: np.ndarray, model: SampledMesh) -> list[np.ndarray]:
    """Return the rows (n, 1) of each hinge in the least squares: zero for points that it does not carry, and for too few.

    Parameters
    ----------
    at, normal : points (n, xyz) in body axes [m], and normals of their planes
    nearest : numbers (n) of the points of the model
    """
    columns = []
    for number, hinge in enumerate(model.hinges):
        assert model.hinge_of is not None
        carried = model.hinge_of[nearest] == number
        arm_m = np.cross(normal, at - np.array(hinge.position_m)) @ hinge.direction  # a turn brings planes to points
        is_shown = np.count_nonzero(carried) >= _FEWEST_ON_HINGE
        columns.append(np.where(carried & is_shown, arm_m / model.radius_m, 0.0)[:, None])
    return columns


def _estimate_hinge_sigmas_rad(rows: np.ndarray, off: np.ndarray, sigma_rad: np.ndarray, radius_m: float) -> np.ndarray:
    """Return standard deviations of the hinge angles (hinge) [rad], from the distances that are left.

    Parameters
    ----------
    rows, off : of the last step of the least squares, with distances [m]
    sigma_rad : standard deviations of the guess (hinge) [rad]
    radius_m : of the model, the unit of the columns
    """
    noise_m2 = max(float(off @ off) / max(len(rows) - rows.shape[1], 1), (_ROUNDING * radius_m) ** 2)
    square = np.einsum("ni,nj->ij", rows, rows)
    square[:_FEWEST, :_FEWEST] += _STIFFNESS * len(rows) * np.eye(_FEWEST)
    square[_FEWEST:, _FEWEST:] += np.diag(noise_m2 / (sigma_rad * radius_m) ** 2)
    sigmas: np.ndarray = np.sqrt(noise_m2 * np.diag(np.linalg.inv(square))[_FEWEST:]) / radius_m
    return sigmas


def find_outline(points_m: np.ndarray) -> Any:
    """Return the directions x/z, y/z (n, 2) of points [m] in lidar axes, as scipy's k-d tree."""
    from scipy.spatial import cKDTree

    return cKDTree(points_m[:, :2] / points_m[:, 2:])


def misfit_m(
    lidar_from_body: RigidTransform,
    model: SampledMesh,
    points_m: np.ndarray,
    outline: Any,
    half_field_rad: HalfField = np.inf,
) -> float:
    """Measure the misfit of a pose: rms distance of points from the model, plus that of the model from their outline.

    Parts of the model outside the field of view are not compared with the outline, nor is what a hinge carries with fewer
    than five points: cells that face the Sun may reflect the light away from the lidar, whatever the pose.

    Parameters
    ----------
    points_m : points (n, 3) in lidar axes [m]
    outline : result of `find_outline`; distances from it are across the line of sight
    half_field_rad : half of the side of a square field of view [rad], or its half width and half height; infinite for a
        target that is entirely inside

    Returns
    -------
    misfit [m]; infinite if the model is not entirely ahead of the lidar, or entirely outside the field of view
    """
    apart, nearest = model.find_nearest(lidar_from_body.inv().apply(points_m))
    every = max(1, len(model.points_m) // _SILHOUETTE)
    shown = lidar_from_body.apply(model.points_m[::every])
    if not (shown[:, 2] > 0.0).all():
        return np.inf
    if model.hinges:
        shown = shown[_find_returning(model, nearest)[::every]]
    across, ahead_m = shown[:, :2] / shown[:, 2:], shown[:, 2]
    if np.isfinite(half_field_rad).all():
        inside = (np.abs(across) <= np.tan(half_field_rad)).all(axis=1)
        if not inside.any():
            return np.inf
        across, ahead_m = across[inside], ahead_m[inside]
    beside, _ = outline.query(across)
    return float(np.sqrt(np.mean(apart**2)) + np.sqrt(np.mean((beside * ahead_m) ** 2)))


def _find_returning(model: SampledMesh, nearest: np.ndarray) -> np.ndarray:
    """Return whether the body, or a hinge with enough of the `nearest` points to turn it, carries each point of a mesh."""
    assert model.hinge_of is not None
    n_points = np.bincount(model.hinge_of[nearest] + 1, minlength=len(model.hinges) + 1)
    returning: np.ndarray = (model.hinge_of < 0) | (n_points >= _FEWEST_ON_HINGE)[model.hinge_of + 1]
    return returning


def make_rotation(turn_rad: np.ndarray) -> Rotation:
    """Return the rotation by a rotation vector (xyz) [rad]."""
    from scipy.spatial.transform import Rotation

    return Rotation.from_rotvec(turn_rad)
