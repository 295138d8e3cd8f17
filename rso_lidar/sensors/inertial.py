"""Triads of gyros and accelerometers: axes, scale, misalignment, random errors, limit and resolution."""

from __future__ import annotations

import math
from abc import abstractmethod
from functools import cached_property
from typing import Annotated, ClassVar, Literal

import numpy as np
from pydantic import AfterValidator, Field

from rso_lidar import units
from rso_lidar.errors import ScenarioError
from rso_lidar.kernels import kernel, packed
from rso_lidar.motion import Mount
from rso_lidar.part import NotNegative, Positive
from rso_lidar.records import AccelerometerSamples, BodyMotion, GyroSamples, MotionQuantity, SensorState
from rso_lidar.sensors.random_errors import ErrorProcess
from rso_lidar.sensors.sensor_part import ErrorTerms, SensorPart, check_correlation, flicker

_XYZ = (0, 1, 2)
_GEOMETRY: ErrorTerms = (("scale factor", "scale_factor_ppm", "ppm"), ("misalignment", "misalignment_mrad", "mrad"))
_N_DISTORTION = 9  # scale factors of three axes, and six angles between axes
_G = units.STANDARD_GRAVITY_M_S2

CorrelationTimes = Annotated[tuple[Positive, Positive], AfterValidator(check_correlation)]


class InertialTriad(SensorPart):
    """Base of gyros and accelerometers: three axes, x, y, z of the mount.

    measured = round(limit((1 + distortion) R x + bias + noise)), where R turns body axes to sensor axes.
    """

    mount: Mount = Field(default=Mount(), description="Pose body_from_sensor of the triad on the follower.")
    bias_correlation_s: CorrelationTimes = Field(
        default=(10.0, 10_000.0),
        description=(
            "Shortest and longest correlation time of the processes that make up the bias instability, one for each "
            "decade [s]. Equal times give a single Gauss-Markov process. Default: assumed."
        ),
    )
    scale_factor_ppm: NotNegative = Field(
        default=0.0, description="Error of the scale factor, 1 sigma of each axis, constant in a run [ppm]."
    )
    misalignment_mrad: NotNegative = Field(
        default=0.0, description="Angle of an axis towards each other axis, 1 sigma, constant in a run [mrad]."
    )

    @property
    @abstractmethod
    def _coefficients(self) -> tuple[float, float, float, float, float | None, float]:
        """White noise per √Hz, floor, random walk per √s, turn-on bias, limit and resolution, in SI."""

    def _list_errors(self) -> tuple[np.ndarray, list[ErrorProcess]]:
        white, floor, walk, turn_on, _, _ = self._coefficients
        step_s = 1.0 / self.rate_hz
        processes = flicker(_XYZ, floor, self.bias_correlation_s, step_s)
        processes.append(ErrorProcess(_XYZ, 1.0, walk * math.sqrt(step_s), 0.0))
        processes.append(ErrorProcess(_XYZ, 1.0, 0.0, turn_on))
        processes.append(ErrorProcess((-1,) * 3, 1.0, 0.0, self.scale_factor_ppm * units.PPM))
        processes.append(ErrorProcess((-1,) * 6, 1.0, 0.0, self.misalignment_mrad * units.MRAD))
        return np.full(3, white * math.sqrt(self.rate_hz)), processes

    @cached_property
    def _sensor_from_body(self) -> np.ndarray:
        return packed(self.mount.rotation.as_matrix().T)

    def _sample(
        self, truth: np.ndarray, time_s: np.ndarray, key: np.ndarray, first_sample: int, state: SensorState | None
    ) -> tuple[np.ndarray, np.ndarray, SensorState]:
        """Return measured values (sample, xyz), whether they are valid (sample), and the state.

        Parameters
        ----------
        truth : (sample, xyz) true values in body axes
        time_s, key, first_sample, state : as `draw` takes them
        """
        errors, valid, state = self.draw(key, first_sample, time_s, state)
        limit, resolution = self._limits
        driven = self.error_model.n_driven
        distortion = state.values[driven : driven + _N_DISTORTION]
        measure_triad(packed(truth), self._sensor_from_body, distortion, limit, resolution, errors, valid)
        return errors, valid, state

    @cached_property
    def _limits(self) -> tuple[float, float]:
        """Limit, infinite where there is none, and resolution, in SI."""
        *_, limit, resolution = self._coefficients
        return (math.inf if limit is None else limit), resolution


class Gyro(InertialTriad):
    """A triad of rate gyros, with the error terms of IEEE Std 952.

    It measures the angular velocity of the body relative to inertial axes, in sensor axes. The bias instability is the flat
    of the Allan deviation, as most datasheets state it. If yours states the coefficient B of IEEE Std 952, multiply it by
    0.664. A rate random walk has no bound: after t it has grown to its coefficient times √t.
    """

    _ERRORS: ClassVar[ErrorTerms] = (
        ("angle random walk", "angle_random_walk_deg_sqrt_h", "°/√h"),
        ("bias instability", "bias_instability_deg_h", "°/h"),
        ("rate random walk", "rate_random_walk_deg_h_sqrt_h", "°/h/√h"),
        ("turn-on bias", "turn_on_bias_deg_h", "°/h"),
        *_GEOMETRY,
        ("limit", "max_rate_deg_s", "°/s"),
        ("resolution", "resolution_deg_h", "°/h"),
    )
    type: Literal["gyro"] = "gyro"
    angle_random_walk_deg_sqrt_h: NotNegative = Field(
        default=0.0, description="Angle random walk, from white noise of the rate [deg/√h]."
    )
    bias_instability_deg_h: NotNegative = Field(
        default=0.0, description="Bias instability: the flat of the Allan deviation [deg/h]."
    )
    rate_random_walk_deg_h_sqrt_h: NotNegative = Field(default=0.0, description="Rate random walk [deg/h/√h].")
    turn_on_bias_deg_h: NotNegative = Field(
        default=0.0, description="Bias of each axis, 1 sigma, drawn once for a run [deg/h]."
    )
    max_rate_deg_s: Positive | None = Field(
        default=None, description="Largest rate that is measured [deg/s]. If omitted, there is no limit."
    )
    resolution_deg_h: NotNegative = Field(
        default=0.0, description="Step to which the rate is rounded [deg/h]; 0 disables rounding."
    )

    @property
    def _coefficients(self) -> tuple[float, float, float, float, float | None, float]:
        return (
            self.angle_random_walk_deg_sqrt_h * units.DEG_SQRT_H,
            self.bias_instability_deg_h * units.DEG_H,
            self.rate_random_walk_deg_h_sqrt_h * units.DEG_H * units.PER_SQRT_H,
            self.turn_on_bias_deg_h * units.DEG_H,
            None if self.max_rate_deg_s is None else self.max_rate_deg_s * units.DEG,
            self.resolution_deg_h * units.DEG_H,
        )

    @property
    def quantity(self) -> str:
        """Words for what the sensor measures."""
        return "angular velocity"

    @property
    def reads(self) -> frozenset[str]:
        """Nothing beside the angular velocity."""
        return frozenset()

    def measure(
        self, motion: BodyMotion, key: np.ndarray, first_sample: int, state: SensorState | None = None
    ) -> tuple[GyroSamples, SensorState]:
        """Measure the angular velocity."""
        rate, valid, state = self._sample(motion.angular_velocity_rad_s, motion.time_s, key, first_sample, state)
        return GyroSamples(motion.time_s, motion.time_s + self.latency_s, valid, rate), state


class Accelerometer(InertialTriad):
    """A triad of accelerometers, with the error terms of IEEE Std 1293.

    It measures specific force in sensor axes: acceleration without gravitation, at the place of its mount. Gravity's change
    over the distance from the body's origin is neglected. The bias instability is the flat of the Allan deviation, as for
    `gyro`. An acceleration random walk has no bound.
    """

    _ERRORS: ClassVar[ErrorTerms] = (
        ("velocity random walk", "velocity_random_walk_m_s_sqrt_h", "m/s/√h"),
        ("bias instability", "bias_instability_ug", "µg"),
        ("acceleration random walk", "acceleration_random_walk_ug_sqrt_h", "µg/√h"),
        ("turn-on bias", "turn_on_bias_ug", "µg"),
        *_GEOMETRY,
        ("limit", "max_acceleration_g", "g"),
        ("resolution", "resolution_ug", "µg"),
    )
    type: Literal["accelerometer"] = "accelerometer"
    velocity_random_walk_m_s_sqrt_h: NotNegative = Field(
        default=0.0, description="Velocity random walk, from white noise of the acceleration [m/s/√h]."
    )
    bias_instability_ug: NotNegative = Field(
        default=0.0, description="Bias instability: the flat of the Allan deviation [µg]."
    )
    acceleration_random_walk_ug_sqrt_h: NotNegative = Field(
        default=0.0, description="Acceleration random walk [µg/√h]."
    )
    turn_on_bias_ug: NotNegative = Field(
        default=0.0, description="Bias of each axis, 1 sigma, drawn once for a run [µg]."
    )
    max_acceleration_g: Positive | None = Field(
        default=None, description="Largest acceleration that is measured [g]. If omitted, there is no limit."
    )
    resolution_ug: NotNegative = Field(
        default=0.0, description="Step to which the acceleration is rounded [µg]; 0 disables rounding."
    )

    @property
    def _coefficients(self) -> tuple[float, float, float, float, float | None, float]:
        return (
            self.velocity_random_walk_m_s_sqrt_h * units.M_S_SQRT_H,
            self.bias_instability_ug * units.UG,
            self.acceleration_random_walk_ug_sqrt_h * units.UG * units.PER_SQRT_H,
            self.turn_on_bias_ug * units.UG,
            None if self.max_acceleration_g is None else self.max_acceleration_g * _G,
            self.resolution_ug * units.UG,
        )

    @property
    def quantity(self) -> str:
        """Words for what the sensor measures."""
        return "specific force"

    @property
    def reads(self) -> frozenset[str]:
        """The angular acceleration, where the mount is away from the body's origin."""
        return frozenset({MotionQuantity.ANGULAR_ACCELERATION} if any(self.mount.position_m) else ())

    def measure(
        self, motion: BodyMotion, key: np.ndarray, first_sample: int, state: SensorState | None = None
    ) -> tuple[AccelerometerSamples, SensorState]:
        """Measure the specific force at the place of the mount."""
        force = motion.specific_force_m_s2
        if not np.isfinite(force).all():
            raise ScenarioError(
                f"sensor '{self.name}': the follower's motion does not state its thrust; map specific_force_m_s2 among the "
                "outputs of its FMU, or leave the sensor out"
            )
        if any(self.mount.position_m):
            if motion.angular_acceleration_rad_s2 is None:
                raise ScenarioError(
                    f"sensor '{self.name}': a mount away from the origin needs the angular acceleration of the body; "
                    "give angular_acceleration_rad_s2 in BodyMotion"
                )
            force = np.array(force)
            rate, change = packed(motion.angular_velocity_rad_s), packed(motion.angular_acceleration_rad_s2)
            add_lever_arm(packed(np.asarray(self.mount.position_m, dtype=float)), rate, change, force)
        force, valid, state = self._sample(force, motion.time_s, key, first_sample, state)
        return AccelerometerSamples(motion.time_s, motion.time_s + self.latency_s, valid, force), state


@kernel
def measure_triad(
    truth: np.ndarray,
    sensor_from_body: np.ndarray,
    distortion: np.ndarray,
    limit: float,
    resolution: float,
    values: np.ndarray,
    valid: np.ndarray,
) -> None:
    """Turn true vectors to sensor axes, and apply distortion, errors, limit and resolution.

    Parameters
    ----------
    truth : (sample, xyz) in body axes
    sensor_from_body : (3, 3) rotation
    distortion : (9) errors of the scale factors of x, y and z; then the angles of x towards y and z, of y towards x and z,
        of z towards x and y [rad]
    limit, resolution : largest value; step of the values, 0 for none
    values : (sample, xyz) random errors, replaced by the measured values; NaN where `valid` is false before
    valid : (sample) bool; it becomes false where an axis is at its limit
    """
    turned = np.empty(3)
    for k in range(len(truth)):
        if not valid[k]:
            for row in range(3):
                values[k, row] = np.nan
            continue
        for row in range(3):
            turned[row] = (
                sensor_from_body[row, 0] * truth[k, 0]
                + sensor_from_body[row, 1] * truth[k, 1]
                + sensor_from_body[row, 2] * truth[k, 2]
            )
        for row in range(3):
            a, b = (1, 2) if row == 0 else (0, 2) if row == 1 else (0, 1)
            value = turned[row] * (1.0 + distortion[row]) + values[k, row]
            value += distortion[3 + 2 * row] * turned[a] + distortion[4 + 2 * row] * turned[b]
            if abs(value) > limit:
                valid[k] = False
                value = math.copysign(limit, value)
            elif resolution > 0.0:
                value = resolution * np.rint(value / resolution)
            values[k, row] = value


@kernel
def add_lever_arm(arm_m: np.ndarray, rate: np.ndarray, change: np.ndarray, force: np.ndarray) -> None:
    """Add the acceleration of a point of the body relative to its origin: a x r + w x (w x r).

    Parameters
    ----------
    arm_m : (3) place r of the point in body axes [m]
    rate, change : (sample, xyz) angular velocity w [rad/s] and angular acceleration a [rad/s2] in body axes
    force : (sample, xyz) specific force of the origin [m/s2], changed in place to that of the point
    """
    x, y, z = arm_m
    for k in range(len(force)):
        wx, wy, wz = rate[k]
        ax, ay, az = change[k]
        vx, vy, vz = wy * z - wz * y, wz * x - wx * z, wx * y - wy * x
        force[k, 0] += ay * z - az * y + wy * vz - wz * vy
        force[k, 1] += az * x - ax * z + wz * vx - wx * vz
        force[k, 2] += ax * y - ay * x + wx * vy - wy * vx
