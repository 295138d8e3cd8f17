"""Errors of estimated poses: rotation up to the symmetry of the target, translation, and distances of the model's surface.

ADD is the mean distance between points of the model in the estimated and in the true pose (Hinterstoisser et al., ACCV
2012). ADD-S pairs each point with the closest one instead, so that a pose that looks the same is not an error (Xiang et
al., "PoseCNN", RSS 2018).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from rso_lidar.dataset.metrics.merits import (
    HIGHER,
    LOWER,
    BinnedScores,
    Bins,
    FigureOfMerit,
    find_bins,
    find_even_edges,
    find_log_edges,
)
from rso_lidar.dataset.metrics.weighted_statistics import Quantile, Ratios
from rso_lidar.dataset.scoring.ground_truth import FrameTruth
from rso_lidar.records import Symmetry, rotation_error_rad
from rso_lidar.track import SampledMesh
from rso_lidar.units import DEG

if TYPE_CHECKING:
    from scipy.spatial.transform import RigidTransform


TOLERANCE = 0.1  # of the diameter: a pose within it is correct (Hinterstoisser et al., ACCV 2012, sec. 4)
_POINTS = 500  # of the model, whose distances are averaged
_DIRECTIONS = 600  # of half a sphere, on a Fibonacci lattice


@dataclass(frozen=True, eq=False)
class ModelSurface:
    """Surface of a model: points spread evenly over its area, of which some are moved with the pose."""

    mesh: SampledMesh

    @cached_property
    def points_m(self) -> np.ndarray:
        """Points (point, xyz) that are moved [m]."""
        step = max(1, len(self.mesh.points_m) // _POINTS)
        points: np.ndarray = self.mesh.points_m[::step][:_POINTS]
        return points

    @cached_property
    def diameter_m(self) -> float:
        """Greatest distance between two points of the surface [m], to 0.2 %."""
        from scipy.spatial.distance import pdist

        # Some direction is within 0.06 rad of the diameter; the points farthest along it are at least cos(0.06) of it apart.
        height = 1.0 - (np.arange(_DIRECTIONS) + 0.5) / _DIRECTIONS
        turn = np.pi * (3.0 - np.sqrt(5.0)) * np.arange(_DIRECTIONS)
        across = np.sqrt(1.0 - height**2)
        along = self.mesh.points_m @ np.stack([across * np.cos(turn), across * np.sin(turn), height])
        ends = np.unique(np.concatenate([along.argmax(axis=0), along.argmin(axis=0)]))
        return float(pdist(self.mesh.points_m[ends]).max())

    def find_distances(self, estimated: RigidTransform, true: RigidTransform) -> tuple[float, float]:
        """Return the mean distance of points to themselves (ADD) and to the closest points (ADD-S) [m].

        Parameters
        ----------
        found, true : lidar_from_target as estimated, and as it was
        """
        moved = (estimated.inv() * true).apply(self.points_m)
        closest, _ = self.mesh.tree.query(moved)
        return float(np.linalg.norm(moved - self.points_m, axis=1).mean()), float(closest.mean())


@dataclass(frozen=True, eq=False)
class PoseErrors:
    """Errors (frame) of poses: infinite where the prediction is missing, NaN where there is nothing to estimate.

    `rotation_rad` is the least angle over all attitudes that look the same. `add_m` and `adds_m` are NaN for a model whose
    surface is not known, and `diameter_m` is that of the model.
    """

    rotation_rad: np.ndarray
    translation_m: np.ndarray
    add_m: np.ndarray
    adds_m: np.ndarray
    diameter_m: np.ndarray


def find_pose_errors(
    truth: FrameTruth,
    position_m: np.ndarray,
    quaternion_xyzw: np.ndarray,
    surfaces: Mapping[int, ModelSurface],
    symmetries: Sequence[Symmetry | None],
) -> PoseErrors:
    """Compute the errors of estimated poses.

    Parameters
    ----------
    position_m, quaternion_xyzw : (frame, 3) and (frame, 4) of the estimated lidar_from_target, NaN where missing
    symmetries : symmetry of each model, in the axes of the poses; None for none
    """
    from scipy.spatial.transform import RigidTransform, Rotation

    asked = truth.is_lit & np.isfinite(truth.position_m).all(axis=1)
    given = asked & np.isfinite(position_m).all(axis=1) & np.isfinite(quaternion_xyzw).all(axis=1)
    rotation, translation, add, adds = (np.where(asked, np.inf, np.nan) for _ in range(4))
    diameter = np.full(len(truth), np.nan)
    translation[given] = np.linalg.norm(position_m[given] - truth.position_m[given], axis=1)
    for model in np.unique(truth.model_id[asked]).tolist():
        rows = np.flatnonzero(given & (truth.model_id == model))
        estimated, true = Rotation.from_quat(quaternion_xyzw[rows]), Rotation.from_quat(truth.quaternion_xyzw[rows])
        rotation[rows] = rotation_error_rad(quaternion_xyzw[rows], truth.quaternion_xyzw[rows], symmetries[model])
        of_model = asked & (truth.model_id == model)
        surface = surfaces.get(model)
        if surface is None:
            add[of_model] = adds[of_model] = np.nan
            continue
        diameter[of_model] = surface.diameter_m
        for row, turned, upright in zip(rows.tolist(), estimated, true, strict=True):
            add[row], adds[row] = surface.find_distances(
                RigidTransform.from_components(position_m[row], turned),
                RigidTransform.from_components(truth.position_m[row], upright),
            )
    return PoseErrors(rotation, translation, add, adds, diameter)


def score_poses(truth: FrameTruth, errors: PoseErrors) -> BinnedScores:
    """Score the errors of poses."""
    all_of = truth.encounters
    asked = ~np.isnan(errors.translation_m)
    with np.errstate(divide="ignore", invalid="ignore"):
        relative = errors.translation_m / truth.range_to_target_m
    merits = []
    for name, unit, values, word in (
        (
            "rotation_error",
            "deg",
            errors.rotation_rad / DEG,
            "angle of the rotation error, the least over attitudes that look the same",
        ),
        ("translation_error", "m", errors.translation_m, "distance of the estimated origin from the true one"),
        ("relative_translation_error", "1", relative, "translation error over range"),
    ):
        median = Quantile(all_of, values, asked)
        is_compared = values is not relative
        merits.append(FigureOfMerit(f"{name}_median", unit, LOWER, f"median {word}", median, is_compared))
        merits.append(
            FigureOfMerit(
                f"{name}_90", unit, LOWER, f"90th percentile: {word}", Quantile(all_of, values, asked, 0.9), False
            )
        )
    measured = asked & np.isfinite(errors.diameter_m)
    if measured.any():
        for name, values, word in (("add", errors.add_m, "ADD"), ("adds", errors.adds_m, "ADD-S")):
            share = np.where(measured, values, 0.0) / np.where(measured, errors.diameter_m, 1.0)
            merits.append(
                FigureOfMerit(
                    f"{name}_recall", "1", HIGHER, f"share of poses whose {word} is below {TOLERANCE:.0%} of the diameter",
                    Ratios(all_of, measured & (share < TOLERANCE), measured, is_proportion=True),
                )
            )  # fmt: skip
            area = np.where(measured, np.clip(1.0 - share / TOLERANCE, 0.0, None), 0.0)
            merits.append(
                FigureOfMerit(
                    f"{name}_area", "1", HIGHER, f"area under the recall over thresholds of {word} up to {TOLERANCE:.0%}",
                    Ratios(all_of, area, measured), False,
                )
            )  # fmt: skip
    return BinnedScores(tuple(merits), tuple(_bin_medians(truth, errors, asked)))


def _bin_medians(truth: FrameTruth, errors: PoseErrors, asked: np.ndarray) -> list[Bins]:
    """Make median errors of the asked frames (frame) in bins of range and of lit pixels."""
    binned = []
    for quantity, unit, values, edges in (
        ("range", "m", truth.range_to_target_m, find_even_edges(truth.range_to_target_m[asked], 8)),
        ("lit_pixels", "1", truth.lit_pixels, find_log_edges(truth.lit_pixels[asked])),
    ):
        bins = find_bins(values, edges)
        for name, of_frames in (
            ("rotation_error_deg", errors.rotation_rad / DEG),
            ("translation_error_m", errors.translation_m),
        ):
            series = [Quantile(truth.encounters, of_frames, asked & (bins == k)) for k in range(len(edges) - 1)]
            binned.append(Bins(name, quantity, unit, edges, {"median": series}))
        measured = asked & np.isfinite(errors.diameter_m)
        if measured.any():
            within = {
                word: measured & (np.nan_to_num(of_frames, nan=np.inf) < TOLERANCE * errors.diameter_m)
                for word, of_frames in (("ADD", errors.add_m), ("ADD-S", errors.adds_m))
            }
            series_by_word = {
                word: [
                    Ratios(truth.encounters, rows & (bins == k), measured & (bins == k), is_proportion=True)
                    for k in range(len(edges) - 1)
                ]
                for word, rows in within.items()
            }
            binned.append(Bins("pose_recall", quantity, unit, edges, series_by_word))
    return binned
