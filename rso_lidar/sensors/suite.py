"""The sensors of a run: which samples become available from one instant to the next, and what they measure."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np

from rso_lidar.errors import ScenarioError, add_place
from rso_lidar.records import BodyMotion, SensorSamples, SensorState
from rso_lidar.sensors.choice import (
    get_look_back,
    get_reads,
    measure_samples,
    read_schedule,
)
from rso_lidar.sensors.random_errors import make_key

FindMotion = Callable[[np.ndarray, frozenset[str], Callable[[], np.ndarray]], BodyMotion]
_AHEAD_S = 10.0  # after the present, in which the instants of coming samples are listed ahead; assumed
_MOST_SAMPLES = 5_000_000  # of a sensor in one call: some 2 GiB with the motion
_MOST_AHEAD = 512  # samples of a sensor whose instants are listed ahead


class SensorSuite:
    """Sensors of a run, in order of time. A sample depends on seed, sensor and number only, and on the true motion.

    Parameters
    ----------
    sensors : parts, or users' objects
    seed : of the run
    """

    def __init__(self, sensors: Sequence[Any], seed: int) -> None:
        self._sensors = {str(sensor.name): sensor for sensor in sensors}
        self._keys = {name: make_key(seed, name) for name in self._sensors}
        self._schedules = {name: read_schedule(sensor) for name, sensor in self._sensors.items()}
        self._reads = {name: get_reads(sensor) for name, sensor in self._sensors.items()}
        self._look_backs = {name: get_look_back(sensor) for name, sensor in self._sensors.items()}
        self._states: dict[str, SensorState | None] = dict.fromkeys(self._sensors)
        self._empty: dict[str, SensorSamples] = {}

    def measure(self, after_s: float, until_s: float, find_motion: FindMotion) -> dict[str, SensorSamples]:
        """Measure the samples that become available in an interval, after_s < time <= until_s.

        Parameters
        ----------
        after_s, until_s : ends of the interval [s]; intervals follow one another
        find_motion : true motion of the follower: at instants (time) [s], ascending; what is read of it; and a function
            that lists the instants of later samples, for what can be computed ahead

        Returns
        -------
        samples by name of the sensor; sensors without a sample in the interval are left out
        """
        schedules = self._schedules
        due = {schedule: schedule.number_available(after_s, until_s) for schedule in set(schedules.values())}
        numbers = {name: due[schedule] for name, schedule in schedules.items() if due[schedule]}
        if not numbers:
            return {}
        flown = {name: self._look_back(name, of) for name, of in numbers.items()}
        for name, of in flown.items():
            if len(of) > _MOST_SAMPLES:
                raise ScenarioError(
                    f"sensor '{name}': {len(of):,} samples from {max(after_s, 0.0):g} s to {until_s:g} s are more than the "
                    f"{_MOST_SAMPLES:,} that fit; lower its rate_hz, or raise time.frame_rate_hz"
                )
        lists = {key: key[0].time_samples(key[1]) for key in {(schedules[name], of) for name, of in flown.items()}}
        instants = _join_instants([*lists.values()])
        reads = frozenset[str]().union(*(self._reads[name] for name in numbers))
        motion = find_motion(instants, reads, partial(self._list_ahead, until_s))
        measured = {}
        for name, of in flown.items():
            own = (
                motion
                if len(of) == len(instants)
                else motion.some(np.searchsorted(instants, lists[schedules[name], of]))
            )
            samples, self._states[name] = self._measure(name, own, of.start, self._states[name])
            measured[name] = (
                samples if of == numbers[name] else _slice(samples, slice(numbers[name].start - of.start, None))
            )
        return measured

    def _look_back(self, name: str, numbers: range) -> range:
        """Add the earlier samples on which those of a sensor depend, where the state before them is not known."""
        state = self._states[name]
        known = 0 if state is None else state.next_sample
        return range(max(known, numbers.start - self._look_backs[name]), numbers.stop)

    def _measure(
        self, name: str, motion: BodyMotion, first: int, state: SensorState | None
    ) -> tuple[SensorSamples, SensorState]:
        """Measure successive samples of one sensor."""
        with add_place(f"sensor '{name}'"):
            return measure_samples(self._sensors[name], motion, self._keys[name], first, state)

    def complete(self, measured: Mapping[str, SensorSamples], find_motion: FindMotion) -> dict[str, SensorSamples]:
        """Add samples of length 0 for sensors without any, so that all sensors are there, in order.

        Parameters
        ----------
        measured : samples by name of the sensor
        find_motion : as for `measure`

        Returns
        -------
        samples of all sensors by name
        """
        missing = [name for name in self._sensors if name not in measured and name not in self._empty]
        if missing:
            reads = frozenset[str]().union(*(self._reads[name] for name in missing))
            motion = find_motion(np.zeros(1), reads, partial(np.empty, 0))
            for name in missing:
                samples, _ = self._measure(name, motion, 0, None)
                self._empty[name] = _slice(samples, slice(0))
        return {name: measured.get(name) or self._empty[name] for name in self._sensors}

    def _list_ahead(self, after_s: float) -> np.ndarray:
        """List the instants [s] of the samples that become available in some time after an instant, ascending."""
        schedules = set(self._schedules.values())
        numbers = {
            schedule: schedule.number_available(after_s, after_s + _AHEAD_S)[:_MOST_AHEAD] for schedule in schedules
        }
        return _join_instants([schedule.time_samples(some) for schedule, some in numbers.items()])

    def save(self) -> dict[str, SensorState | None]:
        """Return the present states, from which `restore` goes on."""
        return dict(self._states)

    def restore(self, states: Mapping[str, SensorState | None]) -> None:
        """Go on from saved states.

        Parameters
        ----------
        states : from `save`, by name of the sensor

        Raises
        ------
        ScenarioError
            If they are those of other sensors
        """
        if states.keys() != self._states.keys():
            raise ScenarioError(
                f"restore: the state has the sensors {sorted(states)}, the scenario {sorted(self._states)}; give a state of "
                "this scenario"
            )
        self._states = dict(states)


def _slice(samples: SensorSamples, some: slice) -> SensorSamples:
    """Return some of the samples of a sensor."""
    values = {field.name: getattr(samples, field.name) for field in dataclasses.fields(samples)}
    arrays = {field: value[some] for field, value in values.items() if isinstance(value, np.ndarray)}
    return dataclasses.replace(samples, **arrays)


def _join_instants(times: Sequence[np.ndarray]) -> np.ndarray:
    """Return all instants of several ascending lists, ascending and without repetition."""
    return times[0] if len(times) == 1 else np.unique(np.concatenate(times))
