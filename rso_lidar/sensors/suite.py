"""The sensors of a run: which samples become available from one instant to the next, and what they measure."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from rso_lidar.errors import ScenarioError, add_place
from rso_lidar.records import BodyMotion, SensorSamples, SensorState
from rso_lidar.sensors.choice import measure_samples, number_available_samples, time_sensor_samples
from rso_lidar.sensors.random_errors import make_key


class SensorSuite:
    """Sensors of a run, in order of time. A sample depends on seed, sensor and number only, and on the true motion.

    Parameters
    ----------
    sensors : parts, or users' objects.
    seed : of the run.
    """

    def __init__(self, sensors: Sequence[Any], seed: int) -> None:
        self._sensors = {str(sensor.name): sensor for sensor in sensors}
        self._keys = {name: make_key(seed, name) for name in self._sensors}
        self._states: dict[str, SensorState | None] = dict.fromkeys(self._sensors)

    def measure(
        self, after_s: float, until_s: float, find_motion: Callable[[np.ndarray], BodyMotion]
    ) -> dict[str, SensorSamples]:
        """Measure the samples that become available in an interval, after_s < time <= until_s.

        Parameters
        ----------
        after_s, until_s : ends of the interval [s]; intervals follow one another.
        find_motion : true motion of the follower at instants (time) [s], ascending.

        Returns
        -------
        samples by name of the sensor; a sensor without a sample in the interval has samples of length 0.
        """
        numbers = {name: number_available_samples(sensor, after_s, until_s) for name, sensor in self._sensors.items()}
        times = {name: time_sensor_samples(self._sensors[name], of) for name, of in numbers.items()}
        if not times:
            return {}
        instants = np.unique(np.concatenate(list(times.values())))
        motion = find_motion(instants)
        measured = {}
        for name, sensor in self._sensors.items():
            own = motion if len(times[name]) == len(instants) else motion.some(np.searchsorted(instants, times[name]))
            with add_place(f"sensor '{name}'"):
                samples, state = measure_samples(sensor, own, self._keys[name], numbers[name].start, self._states[name])
            measured[name] = samples
            if len(own.time_s):
                self._states[name] = state
        return measured

    def save(self) -> dict[str, SensorState | None]:
        """Return the present states, from which `restore` goes on."""
        return dict(self._states)

    def restore(self, states: Mapping[str, SensorState | None]) -> None:
        """Go on from saved states.

        Parameters
        ----------
        states : from `save`, by name of the sensor.

        Raises
        ------
        ScenarioError
            If they are those of other sensors.
        """
        if states.keys() != self._states.keys():
            raise ScenarioError(
                f"restore: the state has the sensors {sorted(states)}, the scenario {sorted(self._states)}; give a state of "
                "this scenario"
            )
        self._states = dict(states)
