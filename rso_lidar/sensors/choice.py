"""The protocol of sensors, the field that takes any sensor, its schedule of samples, and checked calls of a user's own."""

from __future__ import annotations

import math
from typing import Annotated, Any, Protocol, runtime_checkable

import numpy as np
from pydantic import Field

from rso_lidar.errors import ScenarioError
from rso_lidar.part import Part, Seam, make_answer_error, name_object, read_member, to_real_array
from rso_lidar.records import BodyMotion, SensorSamples, SensorState
from rso_lidar.records.telemetry import ALL_READ
from rso_lidar.sensors.actuator_telemetry import ThrusterTelemetry, WheelTelemetry
from rso_lidar.sensors.gnss import Gnss, RelativeGnss
from rso_lidar.sensors.inertial import Accelerometer, Gyro
from rso_lidar.sensors.sensor_part import SensorPart
from rso_lidar.sensors.star_tracker import StarTracker

_SIMULTANEOUS_S = 0.5e-9  # a simulation's instants are whole nanoseconds


@runtime_checkable
class Sensor(Protocol):
    """Protocol of user-defined sensors: a name, a rate and the method `measure`.

    Sample n holds at n / `rate_hz`, or at `phase_s` + n / `rate_hz` for an object that has this member. It is available
    `latency_s` later, another optional member. Random numbers
    come from `draw_normals(key, first_sample, count, width)`, so that a sample does not depend on how samples are divided
    among calls. What must be remembered from sample to sample is in the state and not in the object, which must not change.
    `examples/seams/own_sensor.py` is an example.
    """

    name: str
    rate_hz: float

    def measure(
        self, motion: BodyMotion, key: np.ndarray, first_sample: int, state: SensorState | None = None
    ) -> tuple[SensorSamples, SensorState]:
        """Measure at successive samples.

        Parameters
        ----------
        motion : true motion of the follower at the instants of the samples.
        key : (2) uint32, key of the sensor's random numbers, from the seed and its name.
        first_sample : number of the first sample.
        state : after an earlier sample; None before all.

        Returns
        -------
        samples, one for each instant of `motion`, and the state after the last of them.
        """


DescribedSensor = Annotated[
    Gyro | Accelerometer | Gnss | RelativeGnss | StarTracker | WheelTelemetry | ThrusterTelemetry,
    Field(discriminator="type"),
]
AnySensor = Annotated[DescribedSensor | Sensor, Seam(DescribedSensor, Sensor)]


def number_available_samples(sensor: Any, after_s: float, until_s: float) -> range:
    """Return the numbers of the samples of any sensor that become available in an interval: after_s < time <= until_s.

    Instants less than half a nanosecond apart are simultaneous, so that rounding of a sum such as 0.1 + 0.2 does not delay
    a sample to the next flash.

    Parameters
    ----------
    sensor : a part, or a user's object.
    after_s, until_s : ends of the interval, since `start_utc` [s].
    """
    rate_hz, phase_s, latency_s = _schedule(sensor)
    first_s = phase_s + latency_s
    ends = []
    for end_s in (after_s, until_s):
        beyond_s = max(end_s + _SIMULTANEOUS_S, math.nextafter(end_s, math.inf))
        n = max(0, math.ceil((beyond_s - first_s) * rate_hz))
        while n > 0 and first_s + (n - 1) / rate_hz >= beyond_s:
            n -= 1
        while first_s + n / rate_hz < beyond_s:
            n += 1
        ends.append(n)
    return range(ends[0], max(ends))


def get_reads(sensor: Any) -> frozenset[str]:
    """Return what a sensor reads of the follower's motion; a user's object may read everything."""
    return sensor.reads if isinstance(sensor, SensorPart) else ALL_READ


def get_look_back(sensor: Any) -> int:
    """Return on the motion at how many earlier samples a sample of a sensor depends; 0 for a user's object."""
    return sensor.look_back if isinstance(sensor, SensorPart) else 0


def time_sensor_samples(sensor: Any, numbers: range) -> np.ndarray:
    """Return the instants (sample) [s] of samples of any sensor: one division each, so that rounding does not add up.

    Parameters
    ----------
    sensor : a part, or a user's object.
    numbers : of the samples.
    """
    rate_hz, phase_s, _ = _schedule(sensor)
    times: np.ndarray = phase_s + np.arange(numbers.start, numbers.stop, dtype=np.float64) / rate_hz
    return times


def _schedule(sensor: Any) -> tuple[float, float, float]:
    """Return rate [Hz], phase [s] and latency [s] of any sensor."""
    if isinstance(sensor, SensorPart):
        return sensor.rate_hz, sensor.phase_s, sensor.latency_s
    cure = "give a positive number"
    rate_hz = read_member(sensor, "rate_hz", None, (int, float), cure)
    phase_s, latency_s = (
        read_member(sensor, name, 0.0, (int, float), "give a number from 0") for name in ("phase_s", "latency_s")
    )
    if not (0.0 < rate_hz < np.inf and 0.0 <= phase_s < np.inf and 0.0 <= latency_s < np.inf):
        raise ScenarioError(
            f"{name_object(sensor)}: rate_hz is {rate_hz:g}, phase_s {phase_s:g} and latency_s {latency_s:g}; "
            "give a positive rate, and numbers from 0"
        )
    return float(rate_hz), float(phase_s), float(latency_s)


def measure_samples(
    sensor: Any, motion: BodyMotion, key: np.ndarray, first_sample: int, state: SensorState | None
) -> tuple[SensorSamples, SensorState]:
    """Call a sensor, and check the answer of a user's own.

    Parameters
    ----------
    sensor : a part, or a user's object.
    motion, key, first_sample, state : as `Sensor.measure` takes them.

    Returns
    -------
    samples and state.

    Raises
    ------
    ScenarioError
        If the answer of a user's object is not what the protocol says.
    """
    answer = sensor.measure(motion, key, first_sample, state)
    if isinstance(sensor, Part):
        return answer  # type: ignore[no-any-return]
    is_pair = isinstance(answer, tuple) and len(answer) == len(_ANSWER)
    if not is_pair or not all(map(isinstance, answer, _ANSWER)):
        raise make_answer_error(sensor, "measure", answer, "return (SensorSamples, SensorState)")
    samples, after = answer
    times = to_real_array(samples.time_s)
    if times is None or not np.array_equal(times, motion.time_s):
        raise make_answer_error(sensor, "measure", samples, "return one sample for each instant", member="time_s")
    if after.next_sample != first_sample + len(motion.time_s):
        cure = f"return the number of the sample that follows, {first_sample + len(motion.time_s)}"
        raise make_answer_error(sensor, "measure", after.next_sample, cure, member="next_sample")
    return samples, after


_ANSWER = (SensorSamples, SensorState)
