"""Telemetry: what the follower really does when its sensors sample it, and the samples of each kind of sensor."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from rso_lidar.records.schema import Record, array, specs
from rso_lidar.records.truth import BodyState


class MotionQuantity(StrEnum):
    """What a sensor may read of a `BodyMotion` beside angular velocity and specific force.

    `PLACE` is position, velocity and targets. `SKY` is the directions, and the angular radius of the Earth.
    """

    ATTITUDE = "attitude"
    PLACE = "place"
    SKY = "sky"
    DYNAMICS = "dynamics"
    ANGULAR_ACCELERATION = "angular_acceleration"


@dataclass(frozen=True, eq=False, repr=False)
class BodyMotion(Record):
    """True motion of the follower at the epochs of samples: the input of sensors, and never part of an observation.

    Directions are unit vectors from the follower in inertial axes. In a local world they and the angular radius of the
    Earth are None; only the direction to a Sun that the world states is given. Position, velocity and attitude are NaN
    where no sensor reads them. `targets` holds, by name, the state of each target relative to the follower's origin
    (target minus follower) in inertial axes (time, xyz). `dynamics` holds arrays (time, entry) of the follower's
    user-defined dynamics, where it has them. The state x and the input u of its motion are ``motion.state`` and
    ``motion.input``; those of its attitude are ``attitude.state`` and ``attitude.input``.
    """

    time_s: np.ndarray = array("time", "f8", "s", "instants since start_utc")
    position_m: np.ndarray = array("time xyz", "f8", "m", "position of the body's origin in inertial axes")
    velocity_m_s: np.ndarray = array("time xyz", "f8", "m s-1", "velocity of the body's origin in inertial axes")
    quaternion_xyzw: np.ndarray = array("time quaternion", "f8", "1", "rotation inertial_from_body")
    angular_velocity_rad_s: np.ndarray = array(
        "time xyz", "f8", "rad s-1", "angular velocity of the body relative to inertial axes, in body axes"
    )
    specific_force_m_s2: np.ndarray = array(
        "time xyz", "f8", "m s-2", "acceleration of the body's origin without gravitation, in body axes"
    )
    angular_acceleration_rad_s2: np.ndarray | None = array(
        "time xyz", "f8", "rad s-2", "rate of change of the angular velocity, in body axes", optional=True
    )
    sun_direction: np.ndarray | None = array("time xyz", "f8", "1", "direction to the Sun", optional=True)
    moon_direction: np.ndarray | None = array("time xyz", "f8", "1", "direction to the Moon", optional=True)
    earth_direction: np.ndarray | None = array(
        "time xyz", "f8", "1", "direction to the centre of the Earth", optional=True
    )
    earth_angle_rad: np.ndarray | None = array(
        "time", "f8", "rad", "angular radius of the Earth's disk seen from the body", optional=True
    )
    targets: Mapping[str, BodyState] = dataclasses.field(default_factory=dict)
    dynamics: Mapping[str, np.ndarray] = dataclasses.field(default_factory=dict)

    def some(self, epochs: np.ndarray) -> BodyMotion:
        """Return the motion at some of the epochs.

        Parameters
        ----------
        epochs : their indices
        """
        values = {field.name: getattr(self, field.name) for field in dataclasses.fields(self)}
        arrays = {name: value[epochs] for name, value in values.items() if isinstance(value, np.ndarray)}
        targets = {name: state[epochs] for name, state in self.targets.items()}
        dynamics = {name: value[epochs] for name, value in self.dynamics.items()}
        return dataclasses.replace(self, **arrays, targets=targets, dynamics=dynamics)


@dataclass(frozen=True, eq=False, repr=False)
class SensorState(Record):
    """State of a sensor's random processes between two calls: with it, any division of samples gives the same bits.

    `next_sample` is the number of the sample that follows.
    """

    next_sample: int
    values: np.ndarray = array("entry", "f8", "1", "entries of the sensor's own choice, each in its own unit")


@dataclass(frozen=True, eq=False, repr=False)
class SensorSamples(Record):
    """Base of the samples of a sensor: when they hold, when they arrive, and whether they may be used.

    A sample that is not valid has NaN where nothing was measured. Where the sensor is saturated, it has the limit.
    """

    time_s: np.ndarray = array("sample", "f8", "s", "instant at which the sample holds, since start_utc")
    available_s: np.ndarray = array("sample", "f8", "s", "instant at which flight software receives the sample")
    valid: np.ndarray = array("sample", "?", "1", "false in an outage, when blinded and at the limit of the range")


@dataclass(frozen=True, eq=False, repr=False)
class GyroSamples(SensorSamples):
    """Samples of a triad of gyros."""

    angular_velocity_rad_s: np.ndarray = array(
        "sample xyz", "f8", "rad s-1", "measured angular velocity relative to inertial axes, in sensor axes"
    )


@dataclass(frozen=True, eq=False, repr=False)
class AccelerometerSamples(SensorSamples):
    """Samples of a triad of accelerometers."""

    specific_force_m_s2: np.ndarray = array(
        "sample xyz", "f8", "m s-2", "measured acceleration of the sensor without gravitation, in sensor axes"
    )


@dataclass(frozen=True, eq=False, repr=False)
class GnssSamples(SensorSamples):
    """Solutions of a GNSS receiver: position and velocity of its antenna."""

    position_m: np.ndarray = array("sample xyz", "f8", "m", "measured position of the antenna in inertial axes")
    velocity_m_s: np.ndarray = array("sample xyz", "f8", "m s-1", "measured velocity of the antenna in inertial axes")


@dataclass(frozen=True, eq=False, repr=False)
class RelativeGnssSamples(SensorSamples):
    """Solutions of relative GNSS: the follower relative to a target, in the axes that the sensor states."""

    relative_position_m: np.ndarray = array(
        "sample xyz", "f8", "m", "measured position of the follower relative to the target"
    )
    relative_velocity_m_s: np.ndarray = array(
        "sample xyz", "f8", "m s-1", "measured velocity of the follower relative to the target"
    )


@dataclass(frozen=True, eq=False, repr=False)
class StarTrackerSamples(SensorSamples):
    """Attitudes of a star tracker, converted to body axes with its mount."""

    quaternion_xyzw: np.ndarray = array(
        "sample quaternion", "f8", "1", "measured rotation inertial_from_body, with w from 0"
    )


@dataclass(frozen=True, eq=False, repr=False)
class WheelSamples(SensorSamples):
    """Telemetry of reaction wheels; quantities without telemetry have no entries."""

    speed_rad_s: np.ndarray = array("sample wheel_speed", "f8", "rad s-1", "measured speed of each wheel")
    torque_n_m: np.ndarray = array("sample wheel_torque", "f8", "N m", "reported torque of each wheel")


@dataclass(frozen=True, eq=False, repr=False)
class ThrusterSamples(SensorSamples):
    """Telemetry of thrusters."""

    force_n: np.ndarray = array("sample thruster", "f8", "N", "reported force of each thruster")


def join_samples(measured: Sequence[Mapping[str, SensorSamples]]) -> dict[str, SensorSamples]:
    """Join samples of successive intervals.

    Parameters
    ----------
    measured : samples of each interval, by name of the sensor

    Returns
    -------
    samples by name of the sensor
    """
    series: dict[str, list[SensorSamples]] = {}
    for some in measured:
        for name, samples in some.items():
            series.setdefault(name, []).append(samples)
    return {name: pieces[0] if len(pieces) == 1 else _concatenate(pieces) for name, pieces in series.items()}


def _concatenate(series: Sequence[SensorSamples]) -> SensorSamples:
    fields = [field for field in specs(type(series[0])) if getattr(series[0], field) is not None]
    arrays = {field: np.concatenate([getattr(samples, field) for samples in series]) for field in fields}
    return dataclasses.replace(series[0], **arrays)
