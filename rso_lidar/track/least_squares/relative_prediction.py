"""Predicted positions of a target relative to the follower, from the follower's orbit and the relative state."""

from __future__ import annotations

from typing import Literal, get_args

import numpy as np

from rso_lidar.errors import ScenarioError
from rso_lidar.orbit import Epochs
from rso_lidar.rpo import (
    ReferenceOrbit,
    clohessy_wiltshire,
    mean_motion_of_state,
    propagate_yamanaka_ankersen,
    rtn_matrix,
)
from rso_lidar.track.least_squares.estimated_orbit import STEPS, EstimatedOrbit, propagate_state

RelativeModel = Literal["nonlinear", "yamanaka_ankersen", "hill"]
RELATIVE_MODELS: tuple[RelativeModel, ...] = get_args(RelativeModel)
_MOST_PASSES, _CLOSE_M = 20, 1e-7  # each pass divides the error by the ratio of orbit radius and distance


class RelativePrediction:
    """Positions of a target relative to the follower at some instants, as functions of the relative state.

    The relative state (6) is that of the follower in the rotating rtn axes of the target, as in the motion `nonlinear`. The
    target's own state follows from it and from the follower's orbit.

    Parameters
    ----------
    own : orbit of the follower; its epoch is that of the relative state
    time_s : (time) instants since `start_utc` [s]
    motion : "nonlinear" integrates both orbits with the forces of `own`; "yamanaka_ankersen" and "hill" are linear
    """

    def __init__(self, own: EstimatedOrbit, time_s: np.ndarray, motion: RelativeModel) -> None:
        if motion not in RELATIVE_MODELS:
            raise ScenarioError(f"relative orbit: motion '{motion}' is none of {', '.join(RELATIVE_MODELS)}")
        self._own, self._motion, self._time_s = own, motion, time_s
        self._since_s, self._epochs = time_s - own.epoch_s, Epochs(own.start_utc, time_s)
        self._flown = own.states(self._epochs)

    def find_target(self, relative: np.ndarray, own: np.ndarray | None = None) -> ReferenceOrbit:
        """Return the orbit of the target.

        Parameters
        ----------
        relative : (6) relative state [m], [m/s]
        own : (6) state of the follower (None: the estimated one)
        """
        at = self._own
        goal = at.vector if own is None else own
        target = goal
        for _ in range(_MOST_PASSES):
            place = (tuple(target[:3].tolist()), tuple(target[3:].tolist()))
            orbit = ReferenceOrbit(at.start_utc, *place, at.forces, begin_s=at.epoch_s)
            follower = orbit.place(relative[:3], relative[3:], at.epoch_s)
            off = goal - np.concatenate([follower.position_m, follower.velocity_m_s])
            target = target + off
            if np.abs(off[:3]).max() < _CLOSE_M:
                return orbit
        raise ScenarioError(
            "relative orbit: no target fits a state so far from the follower; give frames of a target at less than a tenth "
            "of the orbit's radius"
        )

    def predict(self, relative: np.ndarray) -> np.ndarray:
        """Return the positions (time, 3) [m] of the target minus the follower in GCRS axes."""
        target = self.find_target(relative)
        there = target.states(self._epochs)
        if self._motion == "nonlinear":
            apart: np.ndarray = there.position_m - self._flown.position_m
            return apart
        flown = self._propagate(relative[:, None], target)[..., 0]
        axes = rtn_matrix(there.position_m, there.velocity_m_s)[0]
        return np.asarray(-np.einsum("nij,nj->ni", axes, flown))

    def differentiate(self, relative: np.ndarray) -> np.ndarray:
        """Return the derivatives (time, 3, 6) of the positions with respect to the relative state, to first order.

        They are those of linear motion. The ratio of the distance to the orbit's radius, and J2, change them by a thousandth
        near the target.
        """
        target = self.find_target(relative)
        there = target.states(self._epochs)
        axes = rtn_matrix(there.position_m, there.velocity_m_s)[0]
        return np.asarray(-axes @ self._propagate(np.eye(6), target))

    def differentiate_own(self, relative: np.ndarray) -> np.ndarray:
        """Return the derivatives (time, 3, 6) of the positions with respect to the follower's state, for two-body motion."""
        bare = EstimatedOrbit(
            self._own.start_utc,
            self._own.epoch_s,
            self._own.position_m,
            self._own.velocity_m_s,
            self._own.covariance,
            None,
        )
        plain = RelativePrediction(bare, self._time_s, "nonlinear")
        columns = []
        for k, step in enumerate(STEPS):
            shift = np.zeros(6)
            shift[k] = step
            ahead, behind = (plain._predict_about(relative, bare.vector + sign * shift) for sign in (1.0, -1.0))
            columns.append((ahead - behind) / (2.0 * step))
        return np.stack(columns, axis=-1)

    def _predict_about(self, relative: np.ndarray, own: np.ndarray) -> np.ndarray:
        """Return the positions (time, 3) for another state (6) of the follower."""
        there = self.find_target(relative, own).states(self._epochs)
        flown = propagate_state(own, self._time_s, self._own.epoch_s, self._own.start_utc, self._own.forces)
        apart: np.ndarray = there.position_m - flown.position_m
        return apart

    def _propagate(self, columns: np.ndarray, target: ReferenceOrbit) -> np.ndarray:
        """Return positions (time, 3, column) in the target's rtn axes of relative states (6, column), by linear motion."""
        at = np.array(target.position_m), np.array(target.velocity_m_s)
        flown = []
        for start in columns.T:
            if self._motion == "hill":
                n = mean_motion_of_state(*at)
                flown.append(clohessy_wiltshire(start[:3], start[3:], self._since_s, n)[0])
            else:
                flown.append(propagate_yamanaka_ankersen(start[:3], start[3:], self._since_s, *at)[0])
        return np.stack(flown, axis=-1)
