"""An environment in which a follower with thrusters has to come to a point behind a stage and hold it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from gymnasium.spaces import Box

from rso_lidar.errors import ScenarioError
from rso_lidar.loop.environments.episodes import draw_approach, load_approach
from rso_lidar.loop.environments.lidar_environment import Draw, LidarEnvironment
from rso_lidar.records import Command, Frame
from rso_lidar.scenario import Scenario

REACH_M = 20.0  # distance from the goal at which the reward is 1/e
FUEL_SCALE_M_S = 1.0  # sum of the velocity changes on three axes that costs a reward of 1
COLLISION = 10.0  # reward that a collision costs


class Approach(LidarEnvironment):
    """Come to a point in a stage's rtn axes and hold it; an action is an acceleration.

    An action is the share of `max_acceleration_m_s2` in each of the inputs of the follower's `state_space` motion, held from
    flash to flash. In the default scenario they are the accelerations along the stage's rtn axes.

    The reward of a flash is ``exp(-distance / 20 m) - sum|acceleration| interval / (1 m/s)``. `distance` is that of the
    follower from `goal_m`. A distance from the target's centre of mass below `keep_out_m` costs 10 and terminates the
    episode, as does one beyond `farthest_m`, which costs nothing, or a target that no pixel has shown for longer than
    `lost_after_s`.

    Parameters
    ----------
    scenario : with a `state_space` motion of the follower, or the path of its file (None: 120 m behind a rocket stage)
    draw : as for `LidarEnvironment` (default: `draw_approach`, or None with a scenario)
    goal_m : in the target's rtn axes [m]
    max_acceleration_m_s2 : of the action 1 [m/s2]
    keep_out_m, farthest_m : distances that end an episode [m]
    target, lost_after_s, threads, render_mode : as for `LidarEnvironment`

    Raises
    ------
    ScenarioError
        If the scenario or a setting is not possible.
    """

    def __init__(
        self,
        scenario: Scenario | str | Path | None = None,
        draw: Draw | None = None,
        *,
        goal_m: Sequence[float] = (0.0, -80.0, 0.0),
        max_acceleration_m_s2: float = 0.02,
        keep_out_m: float = 20.0,
        farthest_m: float = 300.0,
        target: str | None = None,
        lost_after_s: float = 10.0,
        threads: int = 1,
        render_mode: str | None = None,
    ) -> None:
        if scenario is None:
            scenario, draw = load_approach(), draw or draw_approach
        super().__init__(
            scenario, draw, target=target, lost_after_s=lost_after_s, threads=threads, render_mode=render_mode
        )
        inputs = getattr(self.scenario.follower.motion, "inputs", ())
        if not inputs:
            raise ScenarioError(
                "Approach: the follower's motion has no inputs; give it a 'state_space' motion with `inputs`"
            )
        if self.scenario.is_local:
            raise ScenarioError("Approach: a local world has no rtn axes, in which goal_m is; use an inertial world")
        goal = np.asarray(goal_m, dtype=float)
        if goal.shape != (3,) or not np.isfinite(goal).all():
            raise ScenarioError(f"goal_m: {goal_m!r:.60} is no position; give three numbers [m]")
        if not 0.0 < max_acceleration_m_s2 < math.inf:
            raise ScenarioError(
                f"max_acceleration_m_s2: {max_acceleration_m_s2!r:.40} is no acceleration; give m/s2, greater than 0"
            )
        if not 0.0 <= keep_out_m < farthest_m:
            raise ScenarioError(
                f"keep_out_m: {keep_out_m!r:.40} and farthest_m: {farthest_m!r:.40} leave no room; give the smaller first"
            )
        self._goal_m, self._most_m_s2 = goal, max_acceleration_m_s2
        self._keep_out_m, self._farthest_m = keep_out_m, farthest_m
        self._acceleration, self._interval_s = np.zeros(len(inputs)), 0.0
        most = np.float32(max_acceleration_m_s2)
        self._state_spaces({"acceleration_m_s2": Box(-most, most, (len(inputs),), np.float32)}, len(inputs))

    def to_action(self, command: Command | None) -> np.ndarray:
        """Return the action with the inputs of a command for the follower; without inputs those of the last are kept.

        Parameters
        ----------
        command : for the time to the next flash
        """
        inputs = command.inputs if command is not None else None
        asked = self._acceleration if not inputs else np.asarray(inputs["follower"], dtype=float)
        return np.clip(asked / self._most_m_s2, -1.0, 1.0).astype(np.float32)

    def _begin(self, frame: Frame) -> None:
        self._acceleration = np.zeros_like(self._acceleration)

    def _fly(self, share: np.ndarray) -> Frame:
        acceleration, self._interval_s = share * self._most_m_s2, self.interval_s
        frame = self.simulation.step(Command(inputs={"follower": acceleration.tolist()}))
        self._acceleration = acceleration
        return frame

    def _judge(self, frame: Frame, share: np.ndarray) -> tuple[float, bool]:
        place = self._place_m(frame)
        distance_m, fuel_m_s = (
            math.dist(place, self._goal_m),
            float(np.abs(self._acceleration).sum()) * self._interval_s,
        )
        reward = math.exp(-distance_m / REACH_M) - fuel_m_s / FUEL_SCALE_M_S
        centre_m = math.hypot(*place)
        if centre_m < self._keep_out_m:
            return reward - COLLISION, True
        return reward, centre_m > self._farthest_m

    def _observe_further(self, frame: Frame) -> dict[str, np.ndarray]:
        return {"acceleration_m_s2": self._acceleration}

    def _describe_further(self, frame: Frame) -> dict[str, float]:
        return {"distance_m": math.dist(self._place_m(frame), self._goal_m)}

    def _place_m(self, frame: Frame) -> list[float]:
        """Return the follower's position in the target's rtn axes [m]."""
        place: list[float] = frame.truth.poses.place(f"{self.target}.rtn", "follower")[0].tolist()
        return place
