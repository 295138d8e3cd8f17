"""Environments of one kind side by side in one process, whose flashes are divided among threads."""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import gymnasium
import numpy as np
from gymnasium.vector import AutoresetMode, SyncVectorEnv
from gymnasium.vector.utils import concatenate, create_empty_array, iterate

from rso_lidar.errors import ScenarioError
from rso_lidar.loop.environments.lidar_environment import LidarEnvironment


class LidarVectorEnvironment(SyncVectorEnv):
    """A vector environment in one process, which shares one scenario and its meshes, and divides a step among threads.

    The numbers are those of `SyncVectorEnv` and of each environment alone, bit for bit. An environment whose episode is over
    begins the next one at the next step (`AutoresetMode.NEXT_STEP`). Unlike processes, threads share compiled loops, meshes
    and memory; they take turns in what is Python code.

    Parameters
    ----------
    make : function that makes one environment, such as ``PointAndTrack``
    num_envs : number of environments

    Other Parameters
    ----------------
    threads : number of threads among which the environments are divided (None: one per core)
    **settings : further arguments of each environment; a `scenario` that is given as a file is read once

    Raises
    ------
    ScenarioError
        If a number is not a whole number from 1, or a setting is not possible.
    """

    def __init__(
        self, make: Callable[..., LidarEnvironment], num_envs: int = 1, *, threads: int | None = None, **settings: Any
    ) -> None:
        for name, count in (("num_envs", num_envs), ("threads", threads)):
            if count is not None and (not isinstance(count, int) or isinstance(count, bool) or count < 1):
                raise ScenarioError(f"{name}: {count!r:.40} is no number of {name}; give a whole number from 1")
        first = make(**settings)
        others: dict[str, Any] = settings | {"scenario": first.scenario, "draw": first.draw}
        makers = [lambda: first, *[lambda: make(**others)] * (num_envs - 1)]
        super().__init__(makers, autoreset_mode=AutoresetMode.NEXT_STEP)
        self._pool = ThreadPoolExecutor(threads or os.cpu_count() or 1)

    def step(self, actions: Any) -> tuple[Any, np.ndarray, np.ndarray, np.ndarray, dict[str, Any]]:
        """Fly all environments to their next flashes, each under its action.

        Parameters
        ----------
        actions : (environment, action), entries in [-1, 1]

        Returns
        -------
        observations, rewards, terminations, truncations, infos
            One row for each environment.

        Raises
        ------
        ScenarioError
            If an action is not a row of numbers.
        """
        results = list(self._pool.map(self._step_one, range(self.num_envs), iterate(self.action_space, actions)))
        infos: dict[str, Any] = {}
        observations = []
        for number, (observation, reward, terminated, truncated, info) in enumerate(results):
            observations.append(observation)
            self._rewards[number], self._terminations[number] = reward, terminated
            self._truncations[number] = truncated
            infos = self._add_info(infos, info, number)
        self._autoreset_envs = np.logical_or(self._terminations, self._truncations)
        empty: Any = create_empty_array(self.single_observation_space, n=self.num_envs, fn=np.zeros)
        batch = concatenate(self.single_observation_space, observations, empty)
        return batch, self._rewards.copy(), self._terminations.copy(), self._truncations.copy(), infos

    def _step_one(self, number: int, action: np.ndarray) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        """Step one environment, or begin its next episode."""
        env: gymnasium.Env[Any, Any] = self.envs[number]
        if self._autoreset_envs[number]:
            observation, info = env.reset()
            return observation, 0.0, False, False, info
        observation, reward, terminated, truncated, info = env.step(action)
        return observation, float(reward), terminated, truncated, info

    def close_extras(self, **kwargs: Any) -> None:
        """End the threads and close the environments.

        Parameters
        ----------
        **kwargs : as for `SyncVectorEnv.close_extras`
        """
        self._pool.shutdown()
        super().close_extras(**kwargs)
