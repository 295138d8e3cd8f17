"""GNSS receivers, absolute and relative: position and velocity with white and slowly varying errors."""

from __future__ import annotations

from typing import ClassVar, Literal

import numpy as np
from pydantic import Field

from rso_lidar import units
from rso_lidar.errors import ScenarioError
from rso_lidar.orbit import rtn_matrix
from rso_lidar.part import Name, NotNegative, Positive, Vector
from rso_lidar.pose import cross, dot, length, matrix_from_quaternion, rotate_vectors
from rso_lidar.records import BodyMotion, GnssSamples, RelativeGnssSamples, SensorState
from rso_lidar.sensors.random_errors import ErrorProcess
from rso_lidar.sensors.sensor_part import ErrorTerms, Impairment, SensorPart, gauss_markov

_POSITION, _VELOCITY = (0, 1, 2), (3, 4, 5)
# Height to which the terrestrial service volume of GPS reaches (Bauer and others, "The GPS Space Service Volume", ION 2006).
_SERVICE_HEIGHT_M = 3_000_000.0


class GnssReceiver(SensorPart):
    """Base of GNSS receivers, whose errors are independent in three axes: white noise and a Gauss-Markov process each."""

    _ERRORS: ClassVar[ErrorTerms] = (
        ("white position error", "position_noise_m", "m"),
        ("slow position error", "slow_position_m", "m"),
        ("white velocity error", "velocity_noise_m_s", "m/s"),
        ("slow velocity error", "slow_velocity_m_s", "m/s"),
    )
    position_noise_m: NotNegative = Field(
        default=0.0, description="White error of the position, 1 sigma of each axis [m]."
    )
    slow_position_m: NotNegative = Field(
        default=0.0,
        description="Slowly varying error of the position, 1 sigma of each axis [m]: a Gauss-Markov process.",
    )
    velocity_noise_m_s: NotNegative = Field(
        default=0.0, description="White error of the velocity, 1 sigma of each axis [m/s]."
    )
    slow_velocity_m_s: NotNegative = Field(
        default=0.0,
        description="Slowly varying error of the velocity, 1 sigma of each axis [m/s]: a Gauss-Markov process.",
    )
    correlation_s: Positive = Field(
        default=300.0,
        description=(
            "Correlation time of the slowly varying errors [s]. Default: assumed; ephemeris and ionosphere vary over "
            "minutes in low orbit."
        ),
    )

    def _list_errors(self) -> tuple[np.ndarray, list[ErrorProcess]]:
        step_s = 1.0 / self.rate_hz
        white = np.repeat([self.position_noise_m, self.velocity_noise_m_s], 3)
        slow = ((_POSITION, self.slow_position_m), (_VELOCITY, self.slow_velocity_m_s))
        return white, [gauss_markov(channels, sigma, self.correlation_s, step_s) for channels, sigma in slow]

    def find_impairments(self, motion: BodyMotion) -> list[Impairment]:
        """Find where the follower is above the volume in which GNSS is designed to serve."""
        if motion.earth_direction is None:  # a local world
            return []
        above = length(motion.position_m) - units.EARTH_RADIUS_M > _SERVICE_HEIGHT_M
        height = f"above the terrestrial service volume ({_SERVICE_HEIGHT_M / units.KM:g} km)"
        why = "fewer than four satellites may be in view, and that is not simulated"
        return [Impairment(above, height, why, "state errors and outages of this height")]


class Gnss(GnssReceiver):
    """A GNSS receiver: position and velocity of its antenna in inertial axes.

    In a world with an Earth, the errors along the local vertical are `vertical_ratio` times those of the other two axes.
    The receiver's own axes turn with the Earth; the conversion to inertial axes adds no error here.
    """

    type: Literal["gnss"] = "gnss"
    antenna_m: Vector = Field(default=(0.0, 0.0, 0.0), description="Position of the antenna in body axes [m].")
    vertical_ratio: Positive = Field(
        default=1.0, description="Errors along the local vertical, as a ratio to those of the other axes."
    )

    @property
    def quantity(self) -> str:
        """Words for what the sensor measures."""
        return "position and velocity of its antenna"

    def measure(
        self, motion: BodyMotion, key: np.ndarray, first_sample: int, state: SensorState | None = None
    ) -> tuple[GnssSamples, SensorState]:
        """Measure position and velocity of the antenna."""
        errors, valid, state = self.draw(key, first_sample, motion.time_s, state)
        position, velocity = errors[:, :3], errors[:, 3:]
        if self.vertical_ratio != 1.0:
            for error in (position, velocity):
                error += (self.vertical_ratio - 1.0) * _project(error, motion.position_m)
        position += motion.position_m
        velocity += motion.velocity_m_s
        if any(self.antenna_m):
            inertial_from_body = matrix_from_quaternion(motion.quaternion_xyzw)
            arm = np.asarray(self.antenna_m, dtype=float)
            position += rotate_vectors(inertial_from_body, arm)
            velocity += rotate_vectors(inertial_from_body, cross(motion.angular_velocity_rad_s, arm))
        errors[~valid] = np.nan
        return GnssSamples(motion.time_s, motion.time_s + self.latency_s, valid, position, velocity), state


class RelativeGnss(GnssReceiver):
    """Relative GNSS: position and velocity of the follower relative to a target that carries a receiver.

    Both are between the origins of the bodies. With `axes` "rtn" they are in the rotating rtn axes of the target, and the
    velocity is relative to them, as in the motion `hill`. Those axes turn with the plane of the target's orbit held fixed.
    """

    type: Literal["relative_gnss"] = "relative_gnss"
    target: Name = Field(description="Name of the target.")
    axes: Literal["inertial", "rtn"] = Field(
        default="rtn", description="Axes of the solution: `inertial`, or the rtn axes of the target."
    )

    @property
    def quantity(self) -> str:
        """Words for what the sensor measures."""
        return f"position and velocity relative to {self.target}, {self.axes} axes"

    def find_axes(self, position_m: np.ndarray, velocity_m_s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Find the axes of the solution for inertial states of the target.

        Parameters
        ----------
        position_m, velocity_m_s : of the target (…, xyz) in inertial axes [m], [m/s]

        Returns
        -------
        inertial_from_axes (…, 3, 3), and the angular velocity (…, 3) of the axes, in them [rad/s]
        """
        if self.axes == "rtn":
            return rtn_matrix(position_m, velocity_m_s)
        return np.broadcast_to(np.eye(3), (*position_m.shape, 3)), np.zeros_like(position_m)

    def measure(
        self, motion: BodyMotion, key: np.ndarray, first_sample: int, state: SensorState | None = None
    ) -> tuple[RelativeGnssSamples, SensorState]:
        """Measure position and velocity relative to the target."""
        relative = motion.targets.get(self.target)
        if relative is None:
            known = ", ".join(motion.targets) or "none"
            raise ScenarioError(f"sensor '{self.name}': no target '{self.target}' (known: {known}); correct the name")
        position, velocity = -relative.position_m, -relative.velocity_m_s
        axes, turning = self.find_axes(motion.position_m - position, motion.velocity_m_s - velocity)
        inverse = np.swapaxes(axes, -1, -2)
        position = rotate_vectors(inverse, position)
        velocity = rotate_vectors(inverse, velocity) - cross(turning, position)
        errors, valid, state = self.draw(key, first_sample, motion.time_s, state)
        errors[:, :3] += position
        errors[:, 3:] += velocity
        errors[~valid] = np.nan
        return (
            RelativeGnssSamples(motion.time_s, motion.time_s + self.latency_s, valid, errors[:, :3], errors[:, 3:]),
            state,
        )


def _project(vectors: np.ndarray, along: np.ndarray) -> np.ndarray:
    """Return the parts of vectors (time, xyz) along others; zero where those have no length."""
    square = dot(along, along)
    share = np.divide(dot(vectors, along), square, out=np.zeros_like(square), where=square > 0.0)
    projected: np.ndarray = share[:, None] * along
    return projected
