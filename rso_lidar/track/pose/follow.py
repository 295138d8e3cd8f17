"""Pose tracking from cloud to cloud: acquired without a guess once, then predicted and aligned for each cloud."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from rso_lidar.errors import ScenarioError
from rso_lidar.pose import pose
from rso_lidar.track.pose.hinge_filter import HingeFilter
from rso_lidar.track.pose.icp import Alignment, HalfField, align, find_outline
from rso_lidar.track.pose.pose_search import (
    LIKELIER,
    acquire,
    align_again,
    keep_sides,
    measure_misfit_m,
    search_hinges,
    search_turns,
)
from rso_lidar.track.pose.sampled_mesh import SampledMesh

if TYPE_CHECKING:
    from scipy.spatial.transform import RigidTransform, Rotation

FEWEST_POSE_POINTS = 50  # default of the fewest points for a pose; assumed
# "Assumed": no record says how the value was chosen. docs/tracking.md has the errors at half and double of some.
_LOST = 2.5  # misfit over the usual one, above which the track is lost; assumed, half and double were tried
_NEW = 0.1  # weight of the newest cloud in the mean square of a hypothesis: a mean over about ten clouds; assumed
_NEW_RATE = 0.25  # weight of the newest rate: a mean over about four; assumed, half and double were tried
_WORSE = 1.25  # mean square over the best one, above which an old hypothesis is dropped; assumed
_OLD = 20  # clouds after which a hypothesis is old: twice those of its mean square
_SAME_POSE_RAD = 0.1  # 6 deg: two hypotheses nearer than this are one; assumed
_SAME_TURN_RAD = 0.4  # 23 deg, a step and a half of the search of turns: two poses nearer than this are one turn
# Greatest log-likelihood of a turn over the others: six times `LIKELIER`, so that seven clouds, each with a
# little more than `LIKELIER` against it, give up a wrong turn. Six is assumed; half and double were tried.
_MOST_CERTAIN = 60.0
# Log-likelihood of other hinge angles above which predicted ones are given up. Assumed: what one cloud may weigh at most,
# so that a hinge jumps only where the cloud contradicts all that was known.
_BETTER_ANGLES = _MOST_CERTAIN


@dataclass(eq=False)
class _Hypothesis:
    """One possible pose: the latest one in axes that do not turn, its rate, and its mean square misfit [m²].

    `hinges` are the angles of the hinges with their rates, at the latest pose.
    """

    time_s: float
    in_axes: RigidTransform
    middle_m: np.ndarray
    found: Alignment
    square_m2: float
    hinges: HingeFilter
    rate_rad_s: np.ndarray = field(default_factory=lambda: np.zeros(3))
    age: int = 1
    certainty: float = 0.0  # log-likelihood of its turn about an axis of the body over the best other one

    def guess(self, time_s: float, middle_m: np.ndarray, axes_from_lidar: Rotation) -> RigidTransform:
        """Predict lidar_from_body.

        Parameters
        ----------
        time_s : instant [s]
        middle_m : mean of the points (xyz), in axes that do not turn [m]
        axes_from_lidar : attitude of the lidar in these axes

        Returns
        -------
        the predicted pose lidar_from_body
        """
        from scipy.spatial.transform import Rotation

        turn = Rotation.from_rotvec(self.rate_rad_s * (time_s - self.time_s))
        arm = turn.apply(self.in_axes.translation - self.middle_m)
        return pose(rotation=axes_from_lidar.inv()) * pose(middle_m + arm, turn * self.in_axes.rotation)

    def move(
        self,
        time_s: float,
        alignment: Alignment,
        misfit: float,
        middle_m: np.ndarray,
        axes_from_lidar: Rotation,
        *,
        is_turned: bool,
    ) -> None:
        """Update the hypothesis with a new pose.

        Parameters
        ----------
        time_s : instant of the pose [s]
        misfit : of the pose [m]
        middle_m : mean of the points (xyz), in axes that do not turn [m]
        axes_from_lidar : attitude of the lidar in these axes
        is_turned : whether the pose was corrected by a turn about an axis of the body, which is no motion
        """
        in_axes = pose(rotation=axes_from_lidar) * alignment.pose
        if time_s > self.time_s and not is_turned:
            rate_rad_s = (in_axes.rotation * self.in_axes.rotation.inv()).as_rotvec() / (time_s - self.time_s)
            self.rate_rad_s = self.rate_rad_s + max(_NEW_RATE, 1.0 / self.age) * (rate_rad_s - self.rate_rad_s)
        share = max(_NEW, 1.0 / (self.age + 1))
        self.square_m2 += share * (misfit**2 - self.square_m2)
        self.time_s, self.in_axes, self.middle_m, self.found = time_s, in_axes, middle_m, alignment
        self.age += 1


class PoseFollower:
    """Tracker that returns a target's pose and hinge angles in each cloud by ICP; None for a cloud with too few points.

    The guess is the previous pose, rotated at the rate between the last two poses and moved with the mean of the points.
    Both are in axes that do not turn. Other turns of the best pose about the principal axes of the body are tried in each
    cloud, because a body that is nearly round can be aligned at a wrong one; their log-likelihoods add up from cloud to
    cloud, and a better turn replaces the present one. At first several hypotheses are tracked in
    parallel, and the one with the smallest misfit is returned; hypotheses that fit much worse are dropped. If the best
    misfit exceeds 2.5 times its usual value, the target is acquired again.

    The angle of each hinge of the model is predicted at its rate, and the prediction counts by its covariance: a hinge that
    no points show stays as predicted. Other angles are tried in each cloud, as turns are.

    Parameters
    ----------
    model : of the target; the angles of its hinges are the first guess
    min_points : fewest points for a pose
    most_points : most points in one alignment; denser clouds are thinned evenly
    patience : fewest clouds between two acquisitions, each of which takes about a hundred times as long as a step
    hypotheses : most hypotheses in parallel
    """

    def __init__(
        self,
        model: SampledMesh,
        *,
        min_points: int = FEWEST_POSE_POINTS,
        most_points: int = 1500,
        patience: int = 10,
        hypotheses: int = 4,
    ) -> None:
        if not (6 <= min_points <= most_points and patience >= 1 and hypotheses >= 1):
            raise ScenarioError("PoseFollower: needs min_points from 6 up to most_points; patience, hypotheses from 1")
        self.model, self.min_points, self.most_points = model, min_points, most_points
        self.patience, self.hypotheses = patience, hypotheses
        self._kept: list[_Hypothesis] = []
        self._waited = patience

    def __call__(
        self,
        time_s: float,
        points_m: np.ndarray,
        axes_from_lidar: Rotation,
        half_field_rad: HalfField = np.inf,
    ) -> Alignment | None:
        """Estimate lidar_from_body and the angles of the hinges.

        Parameters
        ----------
        time_s : instant [s]
        points_m : points (n, 3) in lidar axes [m]
        axes_from_lidar : attitude of the lidar in axes that do not turn
        half_field_rad : half of the field of view [rad], as in `icp.misfit_m`; parts of the model outside it are not
            compared with the points. Infinite for a target that is entirely inside

        Returns
        -------
        pose of the body with its misfit, and hinge angles; None with fewer points than `min_points`, or without a match
        """
        if len(points_m) < self.min_points:
            return None
        points = points_m[:: -(-len(points_m) // self.most_points)]
        middle = axes_from_lidar.apply(points.mean(axis=0))
        self._waited += 1
        usual_m = np.sqrt(min((hypothesis.square_m2 for hypothesis in self._kept), default=0.0))
        outline, now_m = find_outline(points), np.inf
        for hypothesis in self._kept:
            hinges = hypothesis.hinges.predict(time_s)
            posed = self.model.turn_hinges(hinges.angles_rad)
            guess = hypothesis.guess(time_s, middle, axes_from_lidar)
            alignment = align(points, posed, guess, hinge_sigmas_rad=hinges.sigmas_rad)
            is_turned = is_swung = False
            if hypothesis is self._kept[0]:
                if self.model.hinges:
                    other, gain = search_hinges(points, self.model, alignment)
                    is_swung = gain > _BETTER_ANGLES
                    alignment = align_again(points, self.model, other) if is_swung else alignment
                other, gain = search_turns(points, self.model, alignment, half_field_rad)
                apart_rad = (other.pose.rotation.inv() * alignment.pose.rotation).magnitude()
                if apart_rad > _SAME_TURN_RAD:
                    hypothesis.certainty = min(hypothesis.certainty - gain, _MOST_CERTAIN)
                    is_turned = hypothesis.certainty < -LIKELIER
                if is_turned or (gain > 0.0 and apart_rad <= _SAME_TURN_RAD):
                    is_swung = is_swung or is_turned
                    if is_swung:
                        alignment = align_again(points, self.model, other)
                    else:
                        alignment = align(points, posed, other.pose, hinge_sigmas_rad=hinges.sigmas_rad)
                    hypothesis.certainty = max(hypothesis.certainty, LIKELIER)
            if is_swung and self.model.hinges:
                alignment = keep_sides(points, posed, alignment)
            hinges.update(alignment.hinge_angles_rad, alignment.hinge_sigmas_rad, is_predicted=not is_swung)
            hypothesis.hinges = hinges
            misfit = measure_misfit_m(alignment, self.model, points, outline, half_field_rad)
            hypothesis.move(time_s, alignment, misfit, middle, axes_from_lidar, is_turned=is_turned)
            now_m = min(now_m, misfit)
        lost = not self._kept or now_m > _LOST * usual_m
        if lost and self._waited >= self.patience:
            self._waited = 0
            angles_rad = self._kept[0].hinges.predict(time_s).angles_rad if self._kept else {}
            model, self._kept = self.model.turn_hinges(angles_rad), []
            for alignment in acquire(points, model, count=self.hypotheses, half_field_rad=half_field_rad):
                square_m2 = measure_misfit_m(alignment, self.model, points, outline, half_field_rad) ** 2
                in_axes = pose(rotation=axes_from_lidar) * alignment.pose
                hinges = HingeFilter.start(time_s, alignment.hinge_angles_rad, alignment.hinge_sigmas_rad)
                self._kept.append(_Hypothesis(time_s, in_axes, middle, alignment, square_m2, hinges))
        if not self._kept:
            return None
        self._kept.sort(key=lambda hypothesis: hypothesis.square_m2)
        best = self._kept[0]
        self._kept = [
            hypothesis for hypothesis in self._kept if hypothesis is best or self._is_viable(hypothesis, best)
        ]
        return best.found

    def _is_viable(self, hypothesis: _Hypothesis, best: _Hypothesis) -> bool:
        """Return whether a hypothesis still differs from the best one, and is not much worse."""
        apart = (hypothesis.in_axes.rotation.inv() * best.in_axes.rotation).magnitude()
        return bool(
            apart > _SAME_POSE_RAD and (hypothesis.age < _OLD or hypothesis.square_m2 < _WORSE * best.square_m2)
        )
