"""A pose followed from cloud to cloud: found without a guess once, then each time from where it should have come to."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from rso_lidar.errors import ScenarioError
from rso_lidar.pose import pose
from rso_lidar.track.icp import Alignment, SampledMesh, acquire, align, find_outline, misfit_m

if TYPE_CHECKING:
    from scipy.spatial.transform import RigidTransform, Rotation

FEWEST_POINTS = 50  # of which a pose is found, if not asked otherwise
_LOST = 2.5  # times the usual misfit
_NEW = 0.1  # share of the newest cloud in a hypothesis's mean square
_WORSE = 1.25  # mean square over the best's, from which a hypothesis is given up once it is old enough
_OLD = 20  # clouds


@dataclass(eq=False)
class _Hypothesis:
    """One pose that it may be: the last one in axes that do not turn, its rate, and how well it has fitted [m²]."""

    time_s: float
    in_axes: RigidTransform
    middle_m: np.ndarray
    found: Alignment
    square_m2: float
    rate_rad_s: np.ndarray = field(default_factory=lambda: np.zeros(3))
    age: int = 1

    def guess(self, time_s: float, middle_m: np.ndarray, axes_from_lidar: Rotation) -> RigidTransform:
        """Return lidar_from_body where it should have come to, the middle of the points being at `middle_m`."""
        from scipy.spatial.transform import Rotation

        turn = Rotation.from_rotvec(self.rate_rad_s * (time_s - self.time_s))
        arm = turn.apply(self.in_axes.translation - self.middle_m)
        return pose(rotation=axes_from_lidar.inv()) * pose(middle_m + arm, turn * self.in_axes.rotation)

    def move(
        self, time_s: float, found: Alignment, misfit: float, middle_m: np.ndarray, axes_from_lidar: Rotation
    ) -> None:
        """Take in the pose found at `time_s`, and its misfit [m]."""
        in_axes = pose(rotation=axes_from_lidar) * found.pose
        if time_s > self.time_s:
            self.rate_rad_s = (in_axes.rotation * self.in_axes.rotation.inv()).as_rotvec() / (time_s - self.time_s)
        share = max(_NEW, 1.0 / (self.age + 1))
        self.square_m2 += share * (misfit**2 - self.square_m2)
        self.time_s, self.in_axes, self.middle_m, self.found = time_s, in_axes, middle_m, found
        self.age += 1


class PoseFollower:
    """Return, called with a cloud, the pose of a rigid target in it by ICP; None where it has too few points.

    The guess is the pose before, turned on at the rate between the last two poses and moved with the middle of the points,
    both in axes that do not turn. At first several poses that fit are followed side by side, and the one that has fitted
    best is told, until the others have fallen behind. When the best fits 2.5 times worse than usual, all begins anew.

    Parameters
    ----------
    model : the target's.
    min_points : fewest points for a pose.
    most_points : points at most that a pose is found from, evenly thinned.
    patience : clouds between two searches from all sides, which take some hundred times as long as a step.
    hypotheses : poses at most that are followed side by side.
    """

    def __init__(
        self,
        model: SampledMesh,
        *,
        min_points: int = FEWEST_POINTS,
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

    def __call__(self, time_s: float, points_m: np.ndarray, axes_from_lidar: Rotation) -> Alignment | None:
        """Return lidar_from_body at `time_s` [s], from points (n, 3) [m] and the lidar's turn in axes that do not turn."""
        if len(points_m) < self.min_points:
            return None
        points = points_m[:: -(-len(points_m) // self.most_points)]
        middle = axes_from_lidar.apply(points.mean(axis=0))
        self._waited += 1
        usual_m = np.sqrt(min((one.square_m2 for one in self._kept), default=0.0))
        outline, now_m = find_outline(points), np.inf
        for one in self._kept:
            found = align(points, self.model, one.guess(time_s, middle, axes_from_lidar))
            misfit = misfit_m(found.pose, self.model, points, outline)
            one.move(time_s, found, misfit, middle, axes_from_lidar)
            now_m = min(now_m, misfit)
        lost = not self._kept or now_m > _LOST * usual_m
        if lost and self._waited >= self.patience:
            self._waited = 0
            self._kept = []
            for found in acquire(points, self.model, count=self.hypotheses):
                square_m2 = misfit_m(found.pose, self.model, points, outline) ** 2
                in_axes = pose(rotation=axes_from_lidar) * found.pose
                self._kept.append(_Hypothesis(time_s, in_axes, middle, found, square_m2))
        if not self._kept:
            return None
        self._kept.sort(key=lambda one: one.square_m2)
        best = self._kept[0]
        self._kept = [one for one in self._kept if one is best or self._lives(one, best)]
        return best.found

    def _lives(self, one: _Hypothesis, best: _Hypothesis) -> bool:
        """Return whether a hypothesis is still another one, and not far worse than the best."""
        apart = (one.in_axes.rotation.inv() * best.in_axes.rotation).magnitude()
        return bool(apart > 0.1 and (one.age < _OLD or one.square_m2 < _WORSE * best.square_m2))
