"""The protocol of sensors, the field that takes any sensor, its schedule of samples, and checked calls of a user's own."""

from __future__ import annotations

import dataclasses
import math
from typing import Annotated, Any, NamedTuple, Protocol, runtime_checkable

import numpy as np
from pydantic import Field

from rso_lidar.errors import ScenarioError
from rso_lidar.part import Seam, kind_of, make_answer_error, name_object, read_member, to_real_array
from rso_lidar.records import BodyMotion, MotionQuantity, SensorSamples, SensorState
from rso_lidar.sensors.actuator_telemetry import ThrusterTelemetry, WheelTelemetry
from rso_lidar.sensors.gnss import Gnss, RelativeGnss
from rso_lidar.sensors.inertial import Accelerometer, Gyro
from rso_lidar.sensors.sensor_part import Impairment, SensorPart
from rso_lidar.sensors.star_tracker import StarTracker

_NUMBERS = (int, float, np.integer, np.floating)
_ROUNDING_S = 1e-6  # of sums of times, in runs of years
BEFORE_ALL_S = -1.0  # before the first sample of any sensor
_SIMULTANEOUS_S = 0.5e-9  # a simulation's instants are whole nanoseconds


@runtime_checkable
class Sensor(Protocol):
    """Protocol of user-defined sensors: a name, a rate and the method `measure`.

    Sample n holds at n / `rate_hz`, or at `phase_s` + n / `rate_hz` for an object that has this member. It is available
    `latency_s` later, another optional member. Random numbers come from `draw_normals(key, first_sample, count, width)`, so
    that a sample does not depend on how samples are divided among calls. What must be remembered from sample to sample is in
    the state and not in the object, which must not change.
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
        motion : true motion of the follower at the instants of the samples
        key : (2) uint32, key of the sensor's random numbers, from the seed and its name
        first_sample : number of the first sample
        state : after an earlier sample; None before all

        Returns
        -------
        samples, one for each instant of `motion`, and the state after the last of them
        """


DescribedSensor = Annotated[
    Gyro | Accelerometer | Gnss | RelativeGnss | StarTracker | WheelTelemetry | ThrusterTelemetry,
    Field(discriminator="type"),
]
AnySensor = Annotated[DescribedSensor | Sensor, Seam(DescribedSensor, Sensor)]


class SampleSchedule(NamedTuple):
    """When samples of a sensor hold: sample n at `phase_s` + n / `rate_hz`, available `latency_s` later."""

    rate_hz: float
    phase_s: float
    latency_s: float

    def number_available(self, after_s: float, until_s: float) -> range:
        """Return the numbers of the samples that become available in an interval: after_s < time <= until_s.

        Instants less than half a nanosecond apart are simultaneous, so that rounding of a sum such as 0.1 + 0.2 does not
        delay a sample to the next flash.
        """
        first_s = self.phase_s + self.latency_s
        ends = []
        for end_s in (after_s, until_s):
            beyond_s = max(end_s + _SIMULTANEOUS_S, math.nextafter(end_s, math.inf))
            n = max(0, math.ceil((beyond_s - first_s) * self.rate_hz))
            while n > 0 and first_s + (n - 1) / self.rate_hz >= beyond_s:
                n -= 1
            while first_s + n / self.rate_hz < beyond_s:
                n += 1
            ends.append(n)
        return range(ends[0], max(ends))

    def time_samples(self, numbers: range) -> np.ndarray:
        """Return the instants (sample) [s] of samples by number: one division each, so that rounding does not add up."""
        times: np.ndarray = self.phase_s + np.arange(numbers.start, numbers.stop, dtype=np.float64) / self.rate_hz
        return times


def get_reads(sensor: Any) -> frozenset[str]:
    """Return what a sensor reads of the follower's motion; a user's object may read everything."""
    return sensor.reads if isinstance(sensor, SensorPart) else frozenset(MotionQuantity)


def get_look_back(sensor: Any) -> int:
    """Return the number of earlier samples on whose true motion a sample depends; 0 for a user's object."""
    return sensor.look_back if isinstance(sensor, SensorPart) else 0


def describe_sensor(sensor: Any, frame_rate_hz: float) -> str:
    """Describe a sensor in one line.

    Parameters
    ----------
    sensor : a part, or a user's object
    frame_rate_hz : rate of the flashes [Hz]

    Returns
    -------
    kind, quantity, schedule, errors in the units of their keys, and outages
    """
    rate_hz, phase_s, latency_s = read_schedule(sensor)
    per_frame = rate_hz / frame_rate_hz
    often = f"{per_frame:.3g} per frame" if per_frame >= 1.0 else f"one every {1.0 / per_frame:.3g} frames"
    schedule = [f"{rate_hz:g} Hz ({often})"]
    schedule += [f"from {phase_s:g} s"] * (phase_s > 0.0) + [f"latency {latency_s:g} s"] * (latency_s > 0.0)
    if not isinstance(sensor, SensorPart):
        return f"{sensor.name}: {type(sensor).__name__}, a Python object; {', '.join(schedule)}"
    kind = f"{kind_of(sensor)}{f' ({sensor.preset})' if sensor.preset else ''}, {sensor.quantity}"
    return "; ".join(
        filter(
            None, [f"{sensor.name}: {kind}", ", ".join(schedule), sensor.describe_errors(), sensor.describe_outages()]
        )
    )


def find_impairments(sensor: Any, motion: BodyMotion) -> list[Impairment]:
    """Find what keeps a sensor from its stated performance along a motion.

    Parameters
    ----------
    sensor : a part, or a user's object
    motion : true motion of the follower

    Returns
    -------
    one for each kind of impairment, with the instants at which it is there; none for a user's object
    """
    return sensor.find_impairments(motion) if isinstance(sensor, SensorPart) else []


def read_schedule(sensor: Any) -> SampleSchedule:
    """Read the schedule of any sensor.

    Parameters
    ----------
    sensor : a part, or a user's object

    Returns
    -------
    SampleSchedule

    Raises
    ------
    ScenarioError
        If a user's object states something else than a positive rate, and numbers from 0
    """
    if isinstance(sensor, SensorPart):
        return SampleSchedule(sensor.rate_hz, sensor.phase_s, sensor.latency_s)
    rate_hz = read_member(sensor, "rate_hz", None, _NUMBERS, "give a positive number")
    phase_s, latency_s = (
        read_member(sensor, name, 0.0, _NUMBERS, "give a number from 0") for name in ("phase_s", "latency_s")
    )
    if isinstance(rate_hz, bool) or not (
        0.0 < rate_hz < np.inf and 0.0 <= phase_s < np.inf and 0.0 <= latency_s < np.inf
    ):
        raise ScenarioError(
            f"{name_object(sensor)}: rate_hz is {rate_hz}, phase_s {phase_s} and latency_s {latency_s}; "
            "give a positive rate, and numbers from 0"
        )
    return SampleSchedule(float(rate_hz), float(phase_s), float(latency_s))


def measure_samples(
    sensor: Any, motion: BodyMotion, key: np.ndarray, first_sample: int, state: SensorState | None
) -> tuple[SensorSamples, SensorState]:
    """Call a sensor, and check the answer of a user's own.

    Parameters
    ----------
    sensor : a part, or a user's object
    motion, key, first_sample, state : as `Sensor.measure` takes them

    Returns
    -------
    samples and state

    Raises
    ------
    ScenarioError
        If the answer of a user's object is not what the protocol says
    """
    try:
        answer = sensor.measure(motion, key, first_sample, state)
    except ScenarioError:
        raise
    except (Exception, SystemExit, GeneratorExit) as error:
        if isinstance(sensor, SensorPart):
            raise
        text = " ".join(str(error).split())
        raise ScenarioError(
            f"{name_object(sensor)}: measure() failed at sample {first_sample} with {type(error).__name__}"
            f"{f': {text}' if text else ''}; correct the sensor"
        ) from error
    if isinstance(sensor, SensorPart):
        return answer  # type: ignore[no-any-return]
    is_pair = isinstance(answer, tuple) and len(answer) == len(_ANSWER)
    if not is_pair or not all(map(isinstance, answer, _ANSWER)):
        raise make_answer_error(sensor, "measure", answer, "return (SensorSamples, SensorState)")
    samples, after = answer
    times = to_real_array(samples.time_s)
    if times is None or not np.array_equal(times, motion.time_s):
        raise make_answer_error(sensor, "measure", samples, "return one sample for each instant", member="time_s")
    if missing := _list_missing(samples):
        raise make_answer_error(sensor, "measure", None, "return an array", member=missing[0])
    due_s = motion.time_s + read_schedule(sensor).latency_s
    if not np.allclose(samples.available_s, due_s, rtol=0.0, atol=_ROUNDING_S):  # NaN, too
        cure = "return time_s plus the sensor's latency_s"
        raise make_answer_error(sensor, "measure", samples.available_s, cure, member="available_s")
    if not isinstance(after.next_sample, int | np.integer) or after.next_sample != first_sample + len(motion.time_s):
        cure = f"return the number of the sample that follows, {first_sample + len(motion.time_s)}"
        raise make_answer_error(sensor, "measure", after.next_sample, cure, member="next_sample")
    return samples, after


_ANSWER = (SensorSamples, SensorState)


def _list_missing(samples: SensorSamples) -> list[str]:
    """List the arrays of samples that are None and may not be."""
    required = [field.name for field in dataclasses.fields(samples) if field.default is dataclasses.MISSING]
    return [name for name in required if getattr(samples, name) is None]
