"""Where the follower of a scenario points: axes of body and lidar, field of view, beam, and travel of the PTU."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np

from rso_lidar import motion
from rso_lidar.errors import ScenarioError, suppress_warnings
from rso_lidar.orbit import Epochs, PairQuantity, PairSamples, angle_rad
from rso_lidar.pose import ROOT, rotate_vectors
from rso_lidar.scenario import Scenario

_SAMPLES = 512  # of the follower's angular velocity over the span
_SLACK = 1.5  # over the greatest rate that these samples show


class FollowerPointing:
    """Conditions on the direction of a target in the axes of a scenario's follower, its PTU and its lidar.

    The PTU stands on its demand, within its travel; its drive is not simulated. The rates of the follower's axes are bounded
    by samples over the span, and the boresight turns no faster than they and the line of sight together.

    Parameters
    ----------
    scenario : with a follower
    duration_s : of the search, from the scenario's start on [s]
    """

    def __init__(self, scenario: Scenario, duration_s: float) -> None:
        self._scenario = scenario
        time_s = np.linspace(0.0, max(duration_s, 1.0), _SAMPLES)
        with suppress_warnings(), scenario.locate_errors():
            poses = motion.truth(scenario.bodies, self._epochs(time_s), **scenario.world.motion_arguments).poses
        turning = np.atleast_2d(poses.link(ROOT, "follower").angular_velocity_rad_s)
        self._turning_rad_s = _SLACK * float(np.max(np.linalg.norm(turning, axis=-1)))

    def _epochs(self, time_s: np.ndarray) -> Epochs:
        return Epochs(self._scenario.time.start_utc, time_s)

    def _find_directions(self, pair: PairSamples, of_lidar: bool) -> np.ndarray:
        """Return unit vectors (time, 3) from observer to target in the axes of the lidar, or of the follower."""
        scenario = self._scenario
        with suppress_warnings(), scenario.locate_errors():
            at = self._epochs(np.maximum(pair.epochs.since(scenario.time.start_utc), 0.0))
            truth = motion.truth(scenario.bodies, at, **scenario.world.motion_arguments)
            poses = truth.poses
            if of_lidar:
                ptu = scenario.pan_tilt
                angles = np.zeros((len(at), 2))
                if ptu is not None:
                    angles = motion.compute_demand(ptu, scenario.bodies, truth)
                    low, high = np.array(ptu.response.travel_rad).T
                    angles = np.clip(angles, low, high)
                poses = motion.add_lidar(poses, ptu, angles, np.zeros_like(angles), scenario.lidar.mount)
        matrix = np.broadcast_to(poses.link(ROOT, "lidar" if of_lidar else "follower").matrix, (len(at), 3, 3))
        unit = pair.line_m / np.maximum(pair.range_m, 1e-9)[:, None]
        return rotate_vectors(np.swapaxes(matrix, -1, -2), unit)

    def _make(self, value: Callable[[PairSamples], np.ndarray]) -> PairQuantity:
        return PairQuantity(value, lambda bounds: 2.0 * (bounds.turning_rad_s + self._turning_rad_s))

    def field(self, tangents: Sequence[float], *, is_round: bool = False) -> PairQuantity:
        """Return the angle [rad] by which the target is outside a cone or pyramid about the boresight, negative inside.

        Parameters
        ----------
        tangents : of half its width, right and down
        is_round : whether it is a cone, of the first tangent
        """

        def value(pair: PairSamples) -> np.ndarray:
            toward = self._find_directions(pair, of_lidar=True)
            if is_round:
                return pair.keep_apart(angle_rad(toward, np.array([0.0, 0.0, 1.0])) - math.atan(tangents[0]))
            x, y, z = np.abs(toward[:, 0]), np.abs(toward[:, 1]), toward[:, 2]
            beyond = [
                np.arcsin(np.clip((across - tangent * z) / math.hypot(1.0, tangent), -1.0, 1.0))
                for across, tangent in zip((x, y), tangents, strict=True)
            ]  # angle from each plane that bounds the pyramid
            return pair.keep_apart(np.maximum(*beyond))

        return self._make(value)

    def axis_angle_rad(self, axis: Sequence[float]) -> PairQuantity:
        """Return the angle between the line of sight and an axis of the follower's body [rad].

        Parameters
        ----------
        axis : in body axes, of any length
        """
        return self._make(
            lambda pair: pair.keep_apart(angle_rad(self._find_directions(pair, of_lidar=False), np.asarray(axis)))
        )

    def boresight_angle_rad(self) -> PairQuantity:
        """Return the angle between the line of sight and the lidar's boresight [rad]."""
        ahead = np.array([0.0, 0.0, 1.0])
        return self._make(lambda pair: pair.keep_apart(angle_rad(self._find_directions(pair, of_lidar=True), ahead)))

    def travel(self) -> PairQuantity:
        """Return the angle [rad] by which the target is outside the travel of the PTU, negative within: the field of regard.

        Raises
        ------
        ScenarioError
            For a scenario without a PTU.
        """
        ptu = self._scenario.pan_tilt
        if ptu is None:
            raise ScenarioError(
                f"regard: {self._scenario.name} has no PTU; use field, or angle(AXIS) < 60deg for a cone"
            )
        follower_from_mount = ptu.mount.link.matrix
        (pan_low, pan_high), (tilt_low, tilt_high) = ptu.response.travel_rad

        def value(pair: PairSamples) -> np.ndarray:
            x, y, z = (self._find_directions(pair, of_lidar=False) @ follower_from_mount).T
            pan, level = np.arctan2(y, x), np.hypot(x, y)
            tilt = np.arctan2(z, level)
            turned = [np.maximum(pan_low - pan - turn, pan + turn - pan_high) for turn in (-math.tau, 0.0, math.tau)]
            beyond_pan = np.min(turned, axis=0)
            # near the pan axis a small step turns pan far: its excess counts as an arc
            beyond = np.maximum(beyond_pan * level, np.maximum(tilt_low - tilt, tilt - tilt_high))
            return pair.keep_apart(np.maximum(beyond, -math.pi))

        return PairQuantity(value, lambda bounds: 8.0 * (bounds.turning_rad_s + self._turning_rad_s))
