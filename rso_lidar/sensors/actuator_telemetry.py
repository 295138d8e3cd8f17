"""Telemetry of reaction wheels and thrusters, where the follower's user-defined dynamics have them."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping, Sequence
from typing import Annotated, ClassVar, Literal, Self

import numpy as np
from pydantic import Field, model_validator

from rso_lidar import units
from rso_lidar.errors import ScenarioError
from rso_lidar.part import NotNegative, Positive, Whole
from rso_lidar.records import BodyMotion, SensorState, ThrusterSamples, WheelSamples
from rso_lidar.sensors.random_errors import ErrorProcess
from rso_lidar.sensors.sensor_part import ErrorTerms, SensorPart

Entries = tuple[Annotated[Whole, Field(ge=0, le=10_000)], ...]


class ActuatorTelemetry(SensorPart):
    """Base of the telemetry of actuators, which reads entries of the follower's user-defined dynamics."""

    dynamics: Literal["motion", "attitude"] = Field(
        description="Which of the follower's dynamics of type `state_space` has the actuators: its motion or its attitude."
    )

    def _read(self, motion: BodyMotion, vector: Literal["state", "input"], entries: Sequence[int]) -> np.ndarray:
        """Return entries (time, entry), by their places, of the state or the input of the dynamics."""
        if not entries:
            return np.empty((len(motion.time_s), 0))
        values = motion.dynamics.get(f"{self.dynamics}.{vector}")
        self._check_entries(vector, entries, None if values is None else values.shape[1])
        assert values is not None
        return np.asarray(values[:, list(entries)])

    def check_dynamics(self, sizes: Mapping[str, int]) -> None:
        """Check that the follower has the dynamics and the entries that the sensor reads.

        Parameters
        ----------
        sizes : numbers of entries of ``motion.state``, ``motion.input``, ``attitude.state`` and ``attitude.input``; without
            those of dynamics that the follower does not have

        Raises
        ------
        ScenarioError
            If there are no such dynamics or entries
        """
        for vector, entries in self._reads_entries:
            if entries:
                self._check_entries(vector, entries, sizes.get(f"{self.dynamics}.{vector}"))

    @property
    @abstractmethod
    def _reads_entries(self) -> tuple[tuple[Literal["state", "input"], Entries], ...]:
        """Entries that the sensor reads, of the state and of the input."""

    def _check_entries(self, vector: str, entries: Sequence[int], size: int | None) -> None:
        """Raise `ScenarioError` if a state or an input does not have the entries that are read.

        Parameters
        ----------
        entries : their places, from 0
        size : number of entries that there are; None without such dynamics
        """
        if size is None:
            raise ScenarioError(
                f"sensor '{self.name}': the follower's {self.dynamics} is not of type state_space; give it dynamics with "
                "actuators, or leave the sensor out"
            )
        if max(entries) >= size:
            raise ScenarioError(
                f"sensor '{self.name}': the {vector} of the follower's {self.dynamics} has {size} entries, "
                f"counted from 0, but entry {max(entries)} is asked for; correct the number"
            )


class WheelTelemetry(ActuatorTelemetry):
    """Telemetry of reaction wheels: speeds from tachometers, and torques as the wheels report them."""

    _ERRORS: ClassVar[ErrorTerms] = (
        ("speed noise", "speed_noise_rpm", "rpm"),
        ("resolution", "speed_resolution_rpm", "rpm"),
        ("torque noise", "torque_noise_n_m", "N m"),
    )
    type: Literal["wheels"] = "wheels"
    speed_entries: Entries = Field(
        default=(), description="Entries of the state x that are the wheels' speeds in rad/s, counted from 0."
    )
    torque_entries: Entries = Field(
        default=(), description="Entries of the input u that are the wheels' torques in N m, counted from 0."
    )
    speed_noise_rpm: NotNegative = Field(default=0.0, description="Error of a speed, 1 sigma [rpm].")
    speed_resolution_rpm: NotNegative = Field(
        default=0.0, description="Step to which speeds are rounded [rpm]; 0 disables rounding."
    )
    torque_noise_n_m: NotNegative = Field(default=0.0, description="Error of a torque, 1 sigma [N m].")

    @model_validator(mode="after")
    def _reads_something(self) -> Self:
        if not self.speed_entries and not self.torque_entries:
            raise ValueError("has no wheels; give speed_entries, torque_entries or both")
        return self

    @property
    def quantity(self) -> str:
        """Words for what the sensor measures."""
        parts = [f"speeds x{list(self.speed_entries)}"] * bool(self.speed_entries)
        parts += [f"torques u{list(self.torque_entries)}"] * bool(self.torque_entries)
        return f"{' and '.join(parts)} of the follower's {self.dynamics}"

    @property
    def _reads_entries(self) -> tuple[tuple[Literal["state", "input"], Entries], ...]:
        return ("state", self.speed_entries), ("input", self.torque_entries)

    def _list_errors(self) -> tuple[np.ndarray, list[ErrorProcess]]:
        sigmas = [self.speed_noise_rpm * units.RPM] * len(self.speed_entries)
        return np.array(sigmas + [self.torque_noise_n_m] * len(self.torque_entries)), []

    def measure(
        self, motion: BodyMotion, key: np.ndarray, first_sample: int, state: SensorState | None = None
    ) -> tuple[WheelSamples, SensorState]:
        """Measure speeds and torques of the wheels."""
        errors, valid, state = self.draw(key, first_sample, motion.time_s, state)
        n = len(self.speed_entries)
        speed = errors[:, :n] + self._read(motion, "state", self.speed_entries)
        torque = errors[:, n:] + self._read(motion, "input", self.torque_entries)
        if self.speed_resolution_rpm:
            step = self.speed_resolution_rpm * units.RPM
            speed = step * np.rint(speed / step)
        speed[~valid] = torque[~valid] = np.nan
        return WheelSamples(motion.time_s, motion.time_s + self.latency_s, valid, speed, torque), state


class ThrusterTelemetry(ActuatorTelemetry):
    """Telemetry of thrusters: the force of each, as it is reported.

    The force is the entry of the input u times `newtons_per_input`: 1 where u is a force, the mass in kg where u is an
    acceleration.
    """

    _ERRORS: ClassVar[ErrorTerms] = (
        ("force noise", "force_noise_n", "N"),
        ("resolution", "force_resolution_n", "N"),
        ("scale factor", "scale_factor_ppm", "ppm"),
    )
    type: Literal["thrusters"] = "thrusters"
    force_entries: Annotated[Entries, Field(min_length=1)] = Field(
        description="Entries of the input u, one for each thruster or axis, counted from 0."
    )
    newtons_per_input: Positive = Field(default=1.0, description="Force in newtons for an input of 1.")
    force_noise_n: NotNegative = Field(default=0.0, description="Error of a force, 1 sigma [N].")
    force_resolution_n: NotNegative = Field(
        default=0.0, description="Step to which forces are rounded [N]; 0 disables rounding."
    )
    scale_factor_ppm: NotNegative = Field(
        default=0.0, description="Error of the scale factor of each thruster, 1 sigma, constant in a run [ppm]."
    )

    @property
    def quantity(self) -> str:
        """Words for what the sensor measures."""
        return f"forces u{list(self.force_entries)} of the follower's {self.dynamics}"

    @property
    def _reads_entries(self) -> tuple[tuple[Literal["state", "input"], Entries], ...]:
        return (("input", self.force_entries),)

    def _list_errors(self) -> tuple[np.ndarray, list[ErrorProcess]]:
        n = len(self.force_entries)
        return np.full(n, self.force_noise_n), [ErrorProcess((-1,) * n, 1.0, 0.0, self.scale_factor_ppm * units.PPM)]

    def measure(
        self, motion: BodyMotion, key: np.ndarray, first_sample: int, state: SensorState | None = None
    ) -> tuple[ThrusterSamples, SensorState]:
        """Measure the force of each thruster."""
        errors, valid, state = self.draw(key, first_sample, motion.time_s, state)
        true_n = self.newtons_per_input * self._read(motion, "input", self.force_entries)
        force = true_n * (1.0 + state.values[: true_n.shape[1]]) + errors
        if self.force_resolution_n:
            force = self.force_resolution_n * np.rint(force / self.force_resolution_n)
        force[~valid] = np.nan
        return ThrusterSamples(motion.time_s, motion.time_s + self.latency_s, valid, force), state
