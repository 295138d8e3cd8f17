"""Search for poses and hinge angles: without a guess, among the turns about the axes of a body, and about its hinges."""

from __future__ import annotations

from typing import Any

import numpy as np

from rso_lidar.pose import pose
from rso_lidar.track.pose.icp import Alignment, HalfField, align, find_outline, make_rotation, misfit_m
from rso_lidar.track.pose.sampled_mesh import SampledMesh, spread_rotations

# "Assumed": no record says how the value was chosen. docs/tracking.md has the errors at half and double of some.
_COARSE_POINTS, _COARSE_STEPS = 150, 12  # for each of the starts without a guess; assumed
_UNLIKE_RAD = 0.5  # 29 deg: two poses without a guess differ if they are farther apart; assumed
_TURNS, _TURN_POINTS = 24, 200  # about each axis: a step of 15 deg is within the reach of an alignment; 200 is assumed
_TURNS_TRIED = 6  # of them, the best are aligned; assumed
LIKELIER = 10.0  # log-likelihood over that of the first pose, above which a turn is better: odds of 22,000 to 1 for
# independent errors. Assumed, as errors of neighbouring points are not independent; half and double were tried.
_UNLIKELY = 1.1  # misfit over that of the first pose, above which a turn puts the model outside the outline; assumed
# Greatest distance that counts, in shares of the radius: 0.3 m of a stage, six times its range noise. Assumed; half and
# double were tried.
_FAR = 0.04
# Ratio of two mean square distances below which two angles of a hinge are not told apart: the points of a model are some
# centimetres apart, and that error does not average out over the points of a cloud. The value is assumed.
_SAME_FIT = 1.2
_HINGED_SHARE = 4  # of the starts without a guess, the best quarter is searched for hinge angles, to save time; assumed
_HINGE_ANGLES = 48  # over the circle; a step of 7.5 deg is within the reach of an alignment


def acquire(
    points_m: np.ndarray, model: SampledMesh, starts: int = 96, count: int = 1, half_field_rad: HalfField = np.inf
) -> list[Alignment]:
    """Find poses lidar_from_body without a guess.

    A super-Fibonacci spiral (Alexa 2022) gives start attitudes, even over all rotations. Each is aligned for a few
    steps from the mean of the points. The misfit adds the distance of points from the model to the distance, across the
    line of sight, of the model from the points. Parts hidden behind the points therefore add nothing.

    The three best poses are aligned to the end, or `count` poses that differ by 0.5 rad or more; those whose long axes
    differ come first. For a target that looks the same from several sides, any of these may be found.

    Parameters
    ----------
    points_m : points (n, 3) in lidar axes [m]
    model : of the target
    starts : number of start attitudes
    count : most poses to return
    half_field_rad : as in `misfit_m`

    Returns
    -------
    poses, the best first
    """
    points = np.asarray(points_m, dtype=float)
    some = points[:: max(1, len(points) // _COARSE_POINTS)]
    outline = find_outline(points)
    middle = points.mean(axis=0)
    tried = []
    for rotation in spread_rotations(starts):
        start = pose(middle - rotation.apply(model.middle_m), rotation)
        alignment = align(some, model, start, _COARSE_STEPS)
        tried.append((measure_misfit_m(alignment, model, some, outline, half_field_rad), alignment))
    tried.sort(key=lambda trial: trial[0])
    if model.hinges:
        better = [
            _improve_hinges(some, model, alignment, _COARSE_STEPS) for _, alignment in tried[: starts // _HINGED_SHARE]
        ]
        tried = [(measure_misfit_m(alignment, model, some, outline, half_field_rad), alignment) for alignment in better]
        tried.sort(key=lambda trial: trial[0])
    ranked = [alignment for _, alignment in tried]
    best = ranked[:3] if count == 1 else _select_unlike(ranked, model, count)
    finished = [align_again(points, model, alignment) for alignment in best]
    for place, alignment in enumerate(finished):
        other, gain = search_turns(points, model, alignment, half_field_rad)
        if gain > LIKELIER:
            finished[place] = align_again(points, model, other)
    if model.hinges:
        finished = [keep_sides(points, model, _improve_hinges(points, model, alignment)) for alignment in finished]
    return sorted(finished, key=lambda alignment: measure_misfit_m(alignment, model, points, outline, half_field_rad))[
        :count
    ]


def align_again(points_m: np.ndarray, model: SampledMesh, alignment: Alignment, steps: int | None = None) -> Alignment:
    """Align points with a model from a pose and hinge angles that were found before.

    Parameters
    ----------
    steps : greatest number of steps; None for the default of `align`
    points_m : points (n, 3) in lidar axes [m], here as in all functions of this module
    """
    posed = model.turn_hinges(alignment.hinge_angles_rad)
    return align(points_m, posed, alignment.pose) if steps is None else align(points_m, posed, alignment.pose, steps)


def _improve_hinges(
    points_m: np.ndarray, model: SampledMesh, alignment: Alignment, steps: int | None = None
) -> Alignment:
    """Return an alignment at better hinge angles where there are any."""
    other, gain = search_hinges(points_m, model, alignment)
    return align_again(points_m, model, other, steps) if gain > LIKELIER else alignment


def measure_misfit_m(
    alignment: Alignment, model: SampledMesh, points_m: np.ndarray, outline: Any, half_field_rad: HalfField
) -> float:
    """Measure the misfit of an alignment [m], with the hinges at its angles."""
    posed = model.turn_hinges(alignment.hinge_angles_rad)
    return misfit_m(alignment.pose, posed, points_m, outline, half_field_rad)


def search_hinges(points_m: np.ndarray, model: SampledMesh, alignment: Alignment) -> tuple[Alignment, float]:
    """Search the angles of the hinges of a mesh, one after the other, for better ones.

    For each hinge, angles over the whole circle are compared by the distances of points from the planes of their facets,
    each limited. The best one is aligned together with the pose. A flat array that is turned by half a turn looks the same,
    so that of two such angles the present one is kept.

    Returns
    -------
    the best other alignment, and its log-likelihood over that of the first one, under normal errors; zero if there is no
    better one
    """
    points = np.asarray(points_m, dtype=float)
    some = points[:: max(1, len(points) // _TURN_POINTS)]
    best = alignment
    for number, hinge in enumerate(model.hinges):
        posed = model.turn_hinges(best.hinge_angles_rad)
        squares = _measure_hinge_m2(best.pose.inv().apply(some), posed, number)
        angle_rad = posed.hinge_angles_rad[number] + int(np.argmin(squares)) * (2.0 * np.pi / _HINGE_ANGLES)
        if np.argmin(squares) > 0:
            other = align(some, posed.turn_hinges({hinge.name: angle_rad}), best.pose, _COARSE_STEPS)
            before_m2, after_m2 = (_measure_alignment_m2(some, model, candidate) for candidate in (best, other))
            if before_m2 > _SAME_FIT * after_m2 and _compare(len(some), before_m2, after_m2) > LIKELIER:
                best = other
    if best is alignment:
        return best, 0.0
    return best, _compare(
        len(points), *(_measure_alignment_m2(points, model, candidate) for candidate in (alignment, best))
    )


def keep_sides(points_m: np.ndarray, model: SampledMesh, alignment: Alignment) -> Alignment:
    """Turn each hinge by half a turn where that is nearer to the model's angle and the points do not tell the two apart."""
    for hinge, near_rad in zip(model.hinges, model.hinge_angles_rad, strict=True):
        angle_rad = alignment.hinge_angles_rad[hinge.name]
        half_turns = int(np.round((angle_rad - near_rad) / np.pi))
        if half_turns:
            angles_rad = {**alignment.hinge_angles_rad, hinge.name: angle_rad - half_turns * np.pi}
            other = align(points_m, model.turn_hinges(angles_rad), alignment.pose)
            before_m2, after_m2 = (
                _measure_alignment_m2(points_m, model, candidate) for candidate in (alignment, other)
            )
            if half_turns % 2 == 0 or after_m2 < _SAME_FIT * before_m2:
                alignment = other
    return alignment


def _measure_hinge_m2(seen_m: np.ndarray, model: SampledMesh, hinge: int) -> np.ndarray:
    """Measure the mean square distance [m2] of points from planes, each limited, at angles of a hinge over the circle.

    Parameters
    ----------
    seen_m : points (n, xyz) in body axes [m]
    hinge : index of the hinge; the first angle is the present one of the model
    """
    steps = 2.0 * np.pi / _HINGE_ANGLES * np.arange(_HINGE_ANGLES)
    apart, off = np.full(len(seen_m), np.inf), np.zeros(len(seen_m))
    for part in (part for part in range(-1, len(model.hinges)) if part != hinge):
        here, there = _measure_part(seen_m, model, part)
        apart, off = np.minimum(apart, here), np.where(here < apart, there, off)
    clouds = np.concatenate([model.hinges[hinge].turn(seen_m, -angle) for angle in steps])
    here, there = (distances_m.reshape(_HINGE_ANGLES, -1) for distances_m in _measure_part(clouds, model, hinge))
    limited = np.minimum(np.abs(np.where(here < apart, there, off)), _FAR * model.radius_m)
    squares: np.ndarray = np.mean(limited**2, axis=1)
    return squares


def _measure_part(seen_m: np.ndarray, model: SampledMesh, part: int) -> tuple[np.ndarray, np.ndarray]:
    """Return distances (n) of points from the nearest point of a part, and from its plane [m].

    Parameters
    ----------
    seen_m : points (n, xyz) in body axes [m]
    part : index of the hinge, -1 for the body
    """
    angle_rad = model.hinge_angles_rad[part] if part >= 0 else 0.0
    apart, nearest = model.find_nearest_on_part(seen_m, part, angle_rad)
    return apart, ((seen_m - model.points_m[nearest]) * model.normals[nearest]).sum(axis=1)


def _compare(count: int, first_m2: float, other_m2: float) -> float:
    """Return the log-likelihood of another alignment over that of the first one.

    Errors are independent and normal, with the mean square of the other alignment as their variance.

    Parameters
    ----------
    first_m2, other_m2 : mean square distances of the alignments [m2]
    """
    return 0.5 * count * (first_m2 / other_m2 - 1.0)


def _measure_alignment_m2(points_m: np.ndarray, model: SampledMesh, alignment: Alignment) -> float:
    """Measure the mean square distance [m2] of points from planes at an alignment, each limited."""
    posed = model.turn_hinges(alignment.hinge_angles_rad)
    return float(_measure_planes_m2(alignment.pose.inv().apply(points_m)[None], posed)[0])


def search_turns(
    points_m: np.ndarray, model: SampledMesh, alignment: Alignment, half_field_rad: HalfField = np.inf
) -> tuple[Alignment, float]:
    """Search the turns of a pose about the principal axes of the model for the best other one.

    A body that is nearly round about an axis is aligned at any turn about it. What is not round, such as tanks, brackets
    and nozzles, then lies beside the model, and the distances of points from the planes of their facets show it. Each
    distance is limited, so that a few points do not outweigh the rest. The likeliest turns of 15 degrees each are aligned.

    Returns
    -------
    the best other pose, and its log-likelihood over that of the first one, under normal errors; minus infinity if it would
    put the model outside the outline of the points
    """
    points = np.asarray(points_m, dtype=float)
    model = model.turn_hinges(alignment.hinge_angles_rad)
    some = points[:: max(1, len(points) // _TURN_POINTS)]
    steps = [(axis, step) for axis in range(3) for step in range(1, _TURNS)]
    turns = [make_rotation(step * (2.0 * np.pi / _TURNS) * model.principal_axes[axis]) for axis, step in steps]
    seen, middle = alignment.pose.inv().apply(some), model.middle_m
    squares = _measure_planes_m2(np.array([turn.apply(seen - middle) + middle for turn in turns]), model)
    chosen: list[int] = []
    for number in np.argsort(squares).tolist():
        beside = {(steps[k][0], steps[k][1] + off) for k in chosen for off in (-1, 1)}
        if len(chosen) < _TURNS_TRIED and steps[number] not in beside:
            chosen.append(number)
    tried = []
    for number in chosen:
        turn = turns[number]  # body_from_lidar becomes turn * body_from_lidar, about the middle of the model
        start = pose(middle - turn.apply(middle), turn) * alignment.pose.inv()
        aligned = align(some, model, start.inv(), _COARSE_STEPS)
        tried.append(_improve_hinges(some, model, aligned, _COARSE_STEPS))
    first, *others = (_measure_alignment_m2(points, model, candidate) for candidate in (alignment, *tried))
    best = int(np.argmin(others))
    gain, outline = _compare(len(points), first, others[best]), find_outline(points)
    other = tried[best]
    before_m, after_m = (
        measure_misfit_m(candidate, model, points, outline, half_field_rad) for candidate in (alignment, other)
    )
    return other, -np.inf if after_m > _UNLIKELY * before_m else gain


def _measure_planes_m2(clouds_m: np.ndarray, model: SampledMesh) -> np.ndarray:
    """Measure mean square distances (cloud) [m2] of points (cloud, n, 3) from their nearest facets' planes, each limited."""
    _, nearest = model.find_nearest(clouds_m.reshape(-1, 3))
    off = ((clouds_m.reshape(-1, 3) - model.points_m[nearest]) * model.normals[nearest]).sum(axis=1)
    limited = np.minimum(np.abs(off), _FAR * model.radius_m)
    squares: np.ndarray = np.mean(limited.reshape(clouds_m.shape[:2]) ** 2, axis=1)
    return squares


def _select_unlike(ranked: list[Alignment], model: SampledMesh, count: int) -> list[Alignment]:
    """Select poses that differ, first those whose long axes do."""
    chosen: list[Alignment] = []
    for by_axis in (True, False):
        for alignment in ranked:
            if len(chosen) < count and all(
                _angle_between_rad(alignment, other, model, by_axis) > _UNLIKE_RAD for other in chosen
            ):
                chosen.append(alignment)
    return chosen


def _angle_between_rad(first: Alignment, second: Alignment, model: SampledMesh, by_axis: bool) -> float:
    """Compute the angle between two poses, or between the directions of their long axes [rad]."""
    if by_axis:
        a, b = (alignment.pose.rotation.apply(model.long_axis) for alignment in (first, second))
        return float(np.arctan2(np.linalg.norm(np.cross(a, b)), np.dot(a, b)))
    return float((first.pose.rotation.inv() * second.pose.rotation).magnitude())
