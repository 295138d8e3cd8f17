"""An environment in which a pan-tilt unit has to keep a tumbling stage in the field of view."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Literal

import numpy as np
from gymnasium.spaces import Box

from rso_lidar import units
from rso_lidar.errors import ScenarioError
from rso_lidar.loop.environments.episodes import draw_pass, load_pass
from rso_lidar.loop.environments.lidar_environment import Draw, LidarEnvironment
from rso_lidar.records import Command, Frame
from rso_lidar.scenario import Scenario

EFFORT = 0.01  # reward that a flash with full actions on both axes costs


class PointAndTrack(LidarEnvironment):
    """Point the lidar at a stage that the follower passes; an action is a rate or an angle of the PTU.

    With actions of ``"rate"``, pan and tilt are demanded at `action` times `max_rate_deg_s`, as a ramp of `substeps`
    commands from flash to flash. With ``"angle"``, -1 to 1 is the travel of an axis, or -180 to 180 deg without limits.

    The reward of a flash is ``max(0, 1 - angle / half_field) - 0.01 mean(action^2)``. `angle` is that between the boresight
    and the target's centre of mass, `half_field` half the field of view. An episode is terminated when no pixel has shown
    the target for longer than `lost_after_s`.

    Parameters
    ----------
    scenario : with a PTU, or the path of its file (None: a passage by a rocket stage at 300 to 500 m)
    draw : as for `LidarEnvironment` (default: `draw_pass`, or None with a scenario)
    action : ``"rate"`` or ``"angle"``
    max_rate_deg_s : rate of the action 1 [deg/s] (None: the greatest of the drive, or 10 deg/s)
    substeps : commands of a ramp
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
        action: Literal["rate", "angle"] = "rate",
        max_rate_deg_s: float | None = None,
        substeps: int = 5,
        target: str | None = None,
        lost_after_s: float = 2.0,
        threads: int = 1,
        render_mode: str | None = None,
    ) -> None:
        if scenario is None:
            scenario, draw = load_pass(), draw or draw_pass
        super().__init__(
            scenario, draw, target=target, lost_after_s=lost_after_s, threads=threads, render_mode=render_mode
        )
        if self.scenario.ptu is None:
            raise ScenarioError("PointAndTrack: the scenario has no PTU; add [ptu]")
        if action not in ("rate", "angle"):
            raise ScenarioError(f"action: {action!r:.40} is unknown; give 'rate' or 'angle'")
        if not isinstance(substeps, int) or substeps < 1:
            raise ScenarioError(f"substeps: {substeps!r:.40} is no number of commands; give a whole number from 1")
        response = self.scenario.ptu.response
        if max_rate_deg_s is None:
            max_rate_deg_s = getattr(response, "max_rate_deg_s", None) or 10.0
        if not 0.0 < max_rate_deg_s < 1e6:
            raise ScenarioError(f"max_rate_deg_s: {max_rate_deg_s!r:.40} is no rate; give deg/s, greater than 0")
        self._is_rate, self._max_rate_rad_s, self._substeps = action == "rate", max_rate_deg_s * units.DEG, substeps
        self._low, self._high = np.array(response.travel_rad).T
        self._is_free = ~np.isfinite(self._high - self._low)
        low, high = np.where(self._is_free, -math.pi, self._low), np.where(self._is_free, math.pi, self._high)
        self._middle, self._half = 0.5 * (high + low), 0.5 * (high - low)
        self._demand = np.zeros(2)
        angles = Box(low.astype(np.float32), high.astype(np.float32), dtype=np.float32)
        self._state_spaces({"pan_tilt_rad": angles, "demand_rad": angles}, 2)

    def to_action(self, command: Command | None) -> np.ndarray:
        """Return the action whose demand at the next flash is that of a command; without an angle the demand is kept.

        Parameters
        ----------
        command : for the time to the next flash
        """
        asked = (None, None) if command is None else (command.pan_rad, command.tilt_rad)
        angles = np.array([kept if angle is None else angle for angle, kept in zip(asked, self._demand, strict=True)])
        if self._is_rate:
            share = (angles - self._demand) / (self._max_rate_rad_s * (self.interval_s or math.inf))
        else:
            share = (self._wrap(angles) - self._middle) / self._half
        return np.clip(share, -1.0, 1.0).astype(np.float32)

    def _wrap(self, angles: np.ndarray) -> np.ndarray:
        """Wrap the angles (2,) of axes without limits to +-pi [rad]."""
        return np.where(self._is_free, np.arctan2(np.sin(angles), np.cos(angles)), angles)

    def _begin(self, frame: Frame) -> None:
        assert frame.truth.pointing is not None
        self._demand = np.array(frame.truth.pointing.demand_rad)

    def _fly(self, share: np.ndarray) -> Frame:
        simulation, first = self.simulation, self._demand
        interval_s = self.interval_s
        if self._is_rate:
            last = first + share * self._max_rate_rad_s * interval_s
        else:
            last = self._middle + share * self._half
            last = np.where(self._is_free, first + self._wrap(last - first), last)
        last = np.clip(last, self._low, self._high)
        if self._is_rate and interval_s > 0.0:
            for number in range(1, self._substeps):
                pan, tilt = (first + (last - first) * number / self._substeps).tolist()
                simulation.step(Command(pan_rad=pan, tilt_rad=tilt), dt_s=interval_s / self._substeps)
        pan, tilt = last.tolist()
        frame = simulation.step(Command(pan_rad=pan, tilt_rad=tilt))
        self._demand = last
        return frame

    def _judge(self, frame: Frame, share: np.ndarray) -> tuple[float, bool]:
        half_field = 0.5 * self.scenario.lidar.receiver.fov_rad
        centred = max(0.0, 1.0 - self._off_boresight_rad(frame) / half_field)
        return centred - EFFORT * float(np.mean(share**2)), False

    def _observe_further(self, frame: Frame) -> dict[str, np.ndarray]:
        measured = frame.observation.pan_tilt_rad
        assert measured is not None
        return {"pan_tilt_rad": self._wrap(measured), "demand_rad": self._wrap(self._demand)}

    def _describe_further(self, frame: Frame) -> dict[str, float]:
        return {"off_boresight_rad": self._off_boresight_rad(frame)}

    def _off_boresight_rad(self, frame: Frame) -> float:
        """Return the angle between the boresight and the target's centre of mass [rad]."""
        x, y, z = frame.truth.poses.place("lidar", self.target)[0].tolist()
        return math.atan2(math.hypot(x, y), z)
