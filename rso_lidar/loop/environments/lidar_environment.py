"""What the environments share: episodes of a scenario, images of the lidar as observations, and the loss of the target."""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Callable
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
from gymnasium.spaces import Box, Dict, MultiBinary

from rso_lidar.errors import ScenarioError, did_you_mean
from rso_lidar.part import to_real_array
from rso_lidar.picture import colour_maps, palette
from rso_lidar.records import Command, Frame
from rso_lidar.scenario import Scenario
from rso_lidar.simulation import Simulation

Draw = Callable[[Scenario, np.random.Generator], Scenario]
Images = dict[str, np.ndarray]

_MOST_COUNTS = 65535  # of the u2 of a reading, for a detector that does not state its full scale
_MOST_RANGE_M = 1e6  # for a detector that sees to any range
_RENDERED_PIXELS = 256  # least side of a rendered image


class LidarEnvironment(gymnasium.Env[Images, np.ndarray]):
    """Base of the environments: a step goes from one flash to the next, under one action.

    An observation is what the spacecraft could know of a flash: `range_m` and `intensity_counts`, 0 where nothing came
    back, and the mask `valid`. Rewards and terminations use the truth, observations do not. An episode is truncated at
    the last flash of its scenario. Actions outside -1 to 1 are clipped.

    Parameters
    ----------
    scenario : what is flown, or the path of its TOML file
    draw : function ``(scenario, rng) -> scenario`` that draws the beginning of an episode (None: all begin alike)
    target : name of the target to be observed (None: the first)
    lost_after_s : time without a pixel on the target after which an episode ends [s]
    threads : number of threads of a flash. The result is bit for bit the same
    render_mode : ``"rgb_array"`` for images of the range, or None

    Raises
    ------
    ScenarioError
        If the scenario or a setting is not possible.
    """

    metadata: dict[str, Any] = {"render_modes": ["rgb_array"], "render_fps": 10}  # noqa: RUF012, as in the base class
    observation_space: gymnasium.Space[Any]
    action_space: gymnasium.Space[Any]
    simulation: Simulation  # of the present episode
    target: str  # name of the target that is observed

    def __init__(
        self,
        scenario: Scenario | str | Path,
        draw: Draw | None,
        *,
        target: str | None,
        lost_after_s: float,
        threads: int,
        render_mode: str | None,
    ) -> None:
        if render_mode not in (None, *self.metadata["render_modes"]):
            raise ScenarioError(f"render_mode: {render_mode!r:.40} is unknown; give 'rgb_array', or leave it out")
        if not lost_after_s > 0.0:
            raise ScenarioError(f"lost_after_s: {lost_after_s!r:.40} is not a time; give seconds, greater than 0")
        self.scenario = scenario if isinstance(scenario, Scenario) else Scenario.load(scenario)
        names = [candidate.name for candidate in self.scenario.target]
        self.target = names[0] if target is None else target
        if self.target not in names:
            raise ScenarioError(
                f"target: no target is named '{target}'{did_you_mean(str(target), names)} (known: {', '.join(names)})"
            )
        if self.scenario.time.n_frames < 2:
            raise ScenarioError("scenario: has one flash, and a step goes from one to the next; raise time.duration_s")
        self.render_mode, self.draw, self._threads, self._lost_after_s = render_mode, draw, threads, lost_after_s
        receiver, detector = self.scenario.lidar.receiver, self.scenario.lidar.detector
        shape = (receiver.n_rows, receiver.n_cols)
        range_m = min(float(detector.traits.sees_to_m), _MOST_RANGE_M)
        counts = float(getattr(detector, "full_scale_counts", _MOST_COUNTS))
        self._images: dict[str, Any] = {
            "range_m": Box(0.0, range_m, shape, np.float32),
            "intensity_counts": Box(0.0, counts, shape, np.float32),
            "valid": MultiBinary(shape),
        }
        self._frame: Frame | None = None
        self._seen_s = 0.0

    def _state_spaces(self, further: dict[str, Box], n_actions: int) -> None:
        """State the spaces: images and further quantities are observed, and an action has so many entries."""
        self.observation_space = Dict(self._images | further)
        self.action_space = Box(-1.0, 1.0, (n_actions,), np.float32)
        self._n_actions = n_actions

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Images, dict[str, Any]]:
        """Begin an episode, and make its first flash.

        Parameters
        ----------
        seed : of this episode and of those after it (None: go on with the generator that there is)
        options : none is known

        Returns
        -------
        observation, info
            Of the first flash.

        Raises
        ------
        ScenarioError
            If options are given, or the scenario that was drawn cannot be flown.
        """
        super().reset(seed=seed)
        if not (options is None or options == {}):
            raise ScenarioError(f"options: {options!r:.40} is given, and no options are known; leave it out")
        scenario = self.scenario if self.draw is None else self.draw(self.scenario, self.np_random)
        self.simulation = Simulation(scenario.with_seed(int(self.np_random.integers(2**31))), threads=self._threads)
        frame = self._frame = self.simulation.step()
        self._seen_s = frame.time_s
        self._begin(frame)
        return self._observe(frame), self._describe(frame)

    def step(self, action: np.ndarray) -> tuple[Images, float, bool, bool, dict[str, Any]]:
        """Fly to the next flash under an action.

        Parameters
        ----------
        action : entries in [-1, 1]

        Returns
        -------
        observation, reward, terminated, truncated, info
            Of that flash.

        Raises
        ------
        ScenarioError
            If the action is not a row of numbers, or the episode is over.
        """
        if self._frame is None:
            raise ScenarioError(f"{type(self).__name__}: step() before reset(); call reset() first")
        share = to_real_array(action)
        if share is None or share.shape != (self._n_actions,) or not np.isfinite(share).all():
            raise ScenarioError(f"action: {action!r:.60} is not an action; give {self._n_actions} numbers")
        share = np.clip(share, -1.0, 1.0)
        frame = self._frame = self._fly(share)
        if self.target_pixels(frame):
            self._seen_s = frame.time_s
        reward, is_failed = self._judge(frame, share)
        is_lost = frame.time_s - self._seen_s > self._lost_after_s
        return self._observe(frame), reward, is_failed or is_lost, self.simulation.is_over, self._describe(frame)

    def render(self) -> np.ndarray | None:
        """Return an image of the range (row, col, rgb), as bytes: near is dark, and nothing is white.

        Returns
        -------
        the image; None without `render_mode`.

        Raises
        ------
        ScenarioError
            Before the first episode.
        """
        if self.render_mode is None:
            return None
        if self._frame is None:
            raise ScenarioError(f"{type(self).__name__}: render() before reset(); call reset() first")
        range_m = self._frame.range_m
        near, far = (np.nanmin(range_m), np.nanmax(range_m)) if self._frame.valid.any() else (0.0, 1.0)
        image = colour_maps.apply_ramp((range_m - near) / max(far - near, 1.0), colour_maps.RANGE_RAMP, palette.PAPER)
        times = math.ceil(_RENDERED_PIXELS / max(range_m.shape))
        return image.repeat(times, axis=0).repeat(times, axis=1)

    def target_pixels(self, frame: Frame) -> int:
        """Return the number of pixels in which the target truly is.

        Parameters
        ----------
        frame : of this environment
        """
        number = [target.name for target in self.scenario.target].index(self.target)
        return int((frame.labels.target == number).sum())

    @property
    def interval_s(self) -> float:
        """Time to the next flash [s]; 0 after the last."""
        ahead_s = self.simulation.next_flash_s
        return 0.0 if ahead_s is None else ahead_s - self.simulation.time_s

    def _observe(self, frame: Frame) -> Images:
        """Return the observation of a flash, in new arrays."""
        valid, range_m = frame.valid, np.nan_to_num(frame.range_m, nan=0.0).astype(np.float32)
        most_m, most = (float(self._images[name].high.flat[0]) for name in ("range_m", "intensity_counts"))
        images = {
            "range_m": np.clip(range_m, 0.0, most_m),
            "intensity_counts": np.clip(frame.intensity_counts.astype(np.float32), 0.0, most),
            "valid": valid.astype(np.int8),
        }
        further = self._observe_further(frame)
        spaces: Any = self.observation_space
        return images | {
            name: np.clip(np.asarray(value, dtype=np.float32), spaces[name].low, spaces[name].high)
            for name, value in further.items()
        }

    def _describe(self, frame: Frame) -> dict[str, Any]:
        """Return the info of a flash: time, pixels on the target, and what the environment adds."""
        return {
            "time_s": frame.time_s,
            "target_pixels": self.target_pixels(frame),
            **self._describe_further(frame),
        }

    @abstractmethod
    def to_action(self, command: Command | None) -> np.ndarray:
        """Return the action that does what a command of a controller asks, as far as an action can.

        Parameters
        ----------
        command : for the time to the next flash
        """

    @abstractmethod
    def _begin(self, frame: Frame) -> None:
        """Begin an episode at its first flash."""

    @abstractmethod
    def _fly(self, share: np.ndarray) -> Frame:
        """Fly to the next flash under an action in [-1, 1]."""

    @abstractmethod
    def _judge(self, frame: Frame, share: np.ndarray) -> tuple[float, bool]:
        """Return the reward of a flash and of the action before it, and whether the episode has failed."""

    @abstractmethod
    def _observe_further(self, frame: Frame) -> dict[str, np.ndarray]:
        """Return what is observed beside the images."""

    @abstractmethod
    def _describe_further(self, frame: Frame) -> dict[str, float]:
        """Return true quantities of a flash."""
