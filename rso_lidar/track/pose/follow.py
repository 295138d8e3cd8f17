"""Pose tracking from cloud to cloud: acquired without a guess once, then predicted and aligned for each cloud."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from rso_lidar.errors import ScenarioError
from rso_lidar.pose import pose
from rso_lidar.track.pose.icp import UNKNOWN_ANGLE_RAD, Alignment, HalfField, align, find_outline
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
# An array that follows the Sun turns once in an orbit: in the 90 minutes of a low one, by 0.067 deg/s.
_RATE_RAD_S = 2.0 * np.pi / 5400.0
# Root of the spectral density of white angular acceleration: over a quarter of that orbit, 1 sigma of the change of the rate
# equals the rate. Assumed.
_ACCELERATION_RAD_S2_SQRT_HZ = _RATE_RAD_S / np.sqrt(5400.0 / 4.0)


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
        middle_m : mean of the points (xyz), in axes that do not turn [m]
        axes_from_lidar : attitude of the lidar in these axes
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


@dataclass(eq=False)
class HingeFilter:
    """Angle [rad] and rate [rad/s] of each hinge by name, with their covariances (2, 2), at an instant [s].

    The rate of a hinge is at first zero, with the standard deviation of an array that follows the Sun from a low orbit. A
    hinge that no point shows is predicted at its rate, with a growing covariance.
    """

    time_s: float
    states: dict[str, np.ndarray]
    covariances: dict[str, np.ndarray]

    @classmethod
    def start(cls, time_s: float, angles_rad: Mapping[str, float], sigmas_rad: Mapping[str, float]) -> HingeFilter:
        """Start at measured angles of the hinges by name, with their standard deviations, and at rest."""
        return cls(
            time_s,
            {name: np.array([angle_rad, 0.0]) for name, angle_rad in angles_rad.items()},
            {name: np.diag([sigmas_rad[name] ** 2, _RATE_RAD_S**2]) for name in angles_rad},
        )

    def predict(self, time_s: float) -> HingeFilter:
        """Return the prediction for an instant [s]; nothing moves back in time."""
        step_s = max(time_s - self.time_s, 0.0)
        move = np.array([[1.0, step_s], [0.0, 1.0]])
        # White acceleration in continuous time, integrated over the step (Bar-Shalom, Li and Kirubarajan, 2001, sec. 6.2.2).
        noise = np.array([[step_s**3 / 3.0, step_s**2 / 2.0], [step_s**2 / 2.0, step_s]])
        noise *= _ACCELERATION_RAD_S2_SQRT_HZ**2
        return HingeFilter(
            time_s,
            {name: move @ state for name, state in self.states.items()},
            {name: move @ covariance @ move.T + noise for name, covariance in self.covariances.items()},
        )

    def update(self, angles_rad: Mapping[str, float], sigmas_rad: Mapping[str, float], *, is_predicted: bool) -> None:
        """Update with angles that were estimated from a cloud.

        Parameters
        ----------
        angles_rad, sigmas_rad : of the hinges by name, with their standard deviations, which include the prediction's
        is_predicted : whether the prediction was the guess of these angles; if not, the filter starts again
        """
        if not is_predicted:
            again = HingeFilter.start(self.time_s, angles_rad, sigmas_rad)
            self.states, self.covariances = again.states, again.covariances
            return
        for name, angle_rad in angles_rad.items():
            state, covariance = self.states[name], self.covariances[name]
            gain = covariance[:, 0] / covariance[0, 0]
            self.states[name] = state + gain * (angle_rad - state[0])
            # The posterior variance replaces the predicted one; what depends on the angle follows it.
            self.covariances[name] = covariance + np.outer(gain, gain) * (sigmas_rad[name] ** 2 - covariance[0, 0])

    @property
    def angles_rad(self) -> dict[str, float]:
        """Angles by name [rad]."""
        return {name: float(state[0]) for name, state in self.states.items()}

    @property
    def sigmas_rad(self) -> dict[str, float]:
        """Standard deviations of the angles by name [rad], at most that of an unknown angle."""
        return {
            name: float(min(np.sqrt(covariance[0, 0]), UNKNOWN_ANGLE_RAD))
            for name, covariance in self.covariances.items()
        }
