"""What the navigation filter hands on, the processes of sensors among its error states, and small rotations."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np

from rso_lidar.errors import ScenarioError

_Sensor = TypeVar("_Sensor")


@dataclass(frozen=True, eq=False)
class NavigationEstimate:
    """Estimated states at an instant, in inertial axes, with their covariance.

    Parameters
    ----------
    time_s : instant since start_utc [s].
    position_m, velocity_m_s : of the follower (xyz) [m], [m/s].
    relative_position_m, relative_velocity_m_s : of the target relative to the follower (xyz) [m], [m/s].
    inertial_from_body : attitude of the follower, a matrix (3, 3).
    covariance : (15, 15) of the errors of these, in this order; the error of the attitude is a small rotation in body axes
        [rad].
    """

    time_s: float
    position_m: np.ndarray
    velocity_m_s: np.ndarray
    relative_position_m: np.ndarray
    relative_velocity_m_s: np.ndarray
    inertial_from_body: np.ndarray
    covariance: np.ndarray


@dataclass(frozen=True, eq=False)
class NavigationUpdate:
    """One measurement in the filter: its instant [s], what measured, the innovation, and its NIS."""

    time_s: float
    source: str
    innovation: np.ndarray
    nis: float


@dataclass(frozen=True, eq=False)
class SensorProcesses:
    """The processes of one sensor among the error states."""

    places: np.ndarray  # indices of the states
    channels: np.ndarray  # to which each is added
    start: np.ndarray  # variance at the start
    decay: np.ndarray  # over one second
    variance: np.ndarray  # stationary, where the decay is below 1
    growth: np.ndarray  # of the variance in one second, where it is not

    @staticmethod
    def of(part: Any, first: int) -> SensorProcesses:
        """Return the processes of a sensor, of which `measure` adds the values to its channels.

        Parameters
        ----------
        part : the sensor.
        first : index of its first state.
        """
        model = part.error_model
        kept = np.flatnonzero(model.channel >= 0)
        decay, drive, start = model.process[kept].T
        steady = decay < 1.0
        return SensorProcesses(
            first + np.arange(len(kept)),
            model.channel[kept],
            start**2,
            decay**part.rate_hz,
            np.where(steady, start**2, 0.0),
            np.where(steady, 0.0, drive**2 * part.rate_hz),
        )

    def spread(self, count: int, size: int) -> np.ndarray:
        """Return the matrix (channel, state) that adds the processes to the channels of their sensor."""
        matrix = np.zeros((count, size))
        matrix[self.channels, self.places] = 1.0
        return matrix


def require(part: _Sensor | None, name: str) -> _Sensor:
    """Return a sensor, or raise an error if the filter was made without it."""
    if part is None:
        raise ScenarioError(f"navigation: the filter has no {name}; give the part when the filter is made")
    return part


def skew(vector: np.ndarray) -> np.ndarray:
    """Return the matrix (3, 3) of the vector product with a vector from the left."""
    x, y, z = vector.tolist()
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def turn_matrix(vector: np.ndarray) -> np.ndarray:
    """Return the rotation (3, 3) of a rotation vector [rad] (Rodrigues)."""
    angle = float(np.sqrt(vector @ vector))
    cross = skew(vector)
    sine = np.sinc(angle / np.pi)
    half = np.sinc(0.5 * angle / np.pi)
    return np.asarray(np.eye(3) + sine * cross + 0.5 * half**2 * (cross @ cross))


def rotation_vector(matrix: np.ndarray) -> np.ndarray:
    """Return the rotation vector (3) [rad] of a rotation (3, 3)."""
    from scipy.spatial.transform import Rotation

    return np.asarray(Rotation.from_matrix(matrix).as_rotvec())
