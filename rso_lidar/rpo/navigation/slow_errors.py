"""Errors of sensors that are not white: biases of range and boresight, and a visible centroid that wanders on the target.

Each is a constant, or a first-order Gauss-Markov process (Gelb, Applied Optimal Estimation, 1974, sec. 3.8). Their axes are
along the line of sight away from the sensor, across it in the orbital plane, and across it out of that plane.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Self

import numpy as np
from pydantic import Field, model_validator

from rso_lidar import units
from rso_lidar.part import NotNegative, Part, Positive

_STEEP = 0.999  # cosine to the orbit normal above which the radial axis takes its place
_ALONG, _IN_PLANE, _OUT_OF_PLANE = 0, 1, 2


class SensorBias(Part):
    """Bias of a sensor's range, and of its boresight about two axes across the line of sight."""

    range_sigma_m: NotNegative = Field(default=0.0, description="Standard deviation of the bias of ranges [m].")
    bearing_sigma_deg: Annotated[NotNegative, Field(le=10.0)] = Field(
        default=0.0,
        description=(
            "Standard deviation of the bias of directions in the orbital plane, and out of it [deg]. Within 2.6 degrees of "
            "the orbit normal the radial axis takes its place, and both biases turn there."
        ),
    )
    correlation_time_s: Positive | None = Field(
        default=None,
        description="Time in which its autocorrelation falls to 1/e [s]. If omitted, the bias is constant.",
    )

    @model_validator(mode="after")
    def _has_size(self) -> Self:
        if not (self.range_sigma_m or self.bearing_sigma_deg):
            raise ValueError(
                "range_sigma_m and bearing_sigma_deg are both 0: there is no bias; give one, or leave it out"
            )
        return self


class CentroidWander(Part):
    """Distance of the measured point from the target's origin, which varies as the target turns and hides parts of itself.

    `rl.study.measure_centroid_wander` measures it in a recording.
    """

    along_sigma_m: NotNegative = Field(
        default=0.0, description="Standard deviation along the line of sight [m]. A camera does not measure it."
    )
    across_sigma_m: NotNegative = Field(
        default=0.0, description="Standard deviation across it in the orbital plane, and out of it [m]."
    )
    correlation_time_s: Positive | None = Field(
        default=None,
        description="Time in which its autocorrelation falls to 1/e [s]. If omitted, the distance is constant.",
    )

    @model_validator(mode="after")
    def _has_size(self) -> Self:
        if not (self.along_sigma_m or self.across_sigma_m):
            raise ValueError(
                "along_sigma_m and across_sigma_m are both 0: there is no wander; give one, or leave it out"
            )
        return self


@dataclass(frozen=True)
class SlowError:
    """One slow error of a sensor.

    Parameters
    ----------
    sensor : index of the sensor
    source : "bias" or "centroid"
    axis : 0 along the line of sight, 1 across it in the orbital plane, 2 out of it
    sigma : standard deviation [m], or [rad] for an angle
    is_angle : whether it is an angle
    correlation_time_s : infinite for a constant [s]
    """

    sensor: int
    source: str
    axis: int
    sigma: float
    is_angle: bool
    correlation_time_s: float

    @property
    def name(self) -> str:
        """Its name with its unit, such as `bias_range_m` or `centroid_in_plane_m`."""
        first = "range" if self.source == "bias" else "along"
        return f"{self.source}_{(first, 'in_plane', 'out_of_plane')[self.axis]}_{'rad' if self.is_angle else 'm'}"


class SlowErrors:
    """The slow errors of the sensors of a filter, in order.

    Parameters
    ----------
    sensors : bias and centroid of each sensor, and whether it measures range
    """

    def __init__(self, sensors: Sequence[tuple[SensorBias | None, CentroidWander | None, bool]]) -> None:
        listed: list[SlowError] = []
        for k, (bias, centroid, measures_range) in enumerate(sensors):
            if bias is not None:
                lasts_s = bias.correlation_time_s or np.inf
                angle = bias.bearing_sigma_deg * units.DEG
                listed.append(SlowError(k, "bias", _ALONG, bias.range_sigma_m * measures_range, False, lasts_s))
                listed += [SlowError(k, "bias", axis, angle, True, lasts_s) for axis in (_IN_PLANE, _OUT_OF_PLANE)]
            if centroid is not None:
                lasts_s, across_m = centroid.correlation_time_s or np.inf, centroid.across_sigma_m
                along_m = centroid.along_sigma_m * measures_range
                listed.append(SlowError(k, "centroid", _ALONG, along_m, False, lasts_s))
                listed += [
                    SlowError(k, "centroid", axis, across_m, False, lasts_s) for axis in (_IN_PLANE, _OUT_OF_PLANE)
                ]
        self.errors = tuple(error for error in listed if error.sigma > 0.0)
        self.sigma = np.array([error.sigma for error in self.errors])
        self._rate_per_s = np.array([1.0 / error.correlation_time_s for error in self.errors])

    def __len__(self) -> int:
        return len(self.errors)

    def find_places(self, sensor: int) -> np.ndarray:
        """Return the indices (error,) of the errors of a sensor.

        Parameters
        ----------
        sensor : its index
        """
        return np.flatnonzero([error.sensor == sensor for error in self.errors])

    def find_step(self, step_s: float | None) -> tuple[np.ndarray, np.ndarray]:
        """Return the factors (error,) by which a step multiplies errors, and the standard deviations of what it adds.

        Their variance stays the same (Gelb 1974, sec. 3.8).

        Parameters
        ----------
        step_s : length of the step [s]; None at the first instant, before which nothing is known of them
        """
        if step_s is None:
            return np.zeros(len(self)), self.sigma
        decay = np.exp(-step_s * self._rate_per_s)
        return decay, self.sigma * np.sqrt(-np.expm1(-2.0 * step_s * self._rate_per_s))

    def find_shifts(self, places: np.ndarray, place_m: np.ndarray, axes: np.ndarray) -> np.ndarray:
        """Return by what errors displace the measured point: (3, error, run), for one unit of each, inertial axes.

        The point lies opposite to the craft: its displacement away from the craft lengthens the measured range.

        Parameters
        ----------
        places : indices of the errors
        place_m : (3, run) positions of the craft relative to the target [m], inertial axes
        axes : (3, 3) rtn axes of the target, as columns
        """
        range_m = np.sqrt(np.sum(place_m**2, axis=0))
        along = -place_m / np.maximum(range_m, 1e-9)
        normal, radial = axes[:, 2:], axes[:, :1]
        pole = np.where(np.abs(np.sum(along * normal, axis=0)) > _STEEP, radial, normal)
        in_plane = np.cross(pole, along, axis=0)
        in_plane = in_plane / np.sqrt(np.sum(in_plane**2, axis=0))
        triad = along, in_plane, np.cross(along, in_plane, axis=0)
        chosen = [self.errors[k] for k in places]
        return np.stack([triad[error.axis] * (range_m if error.is_angle else 1.0) for error in chosen], axis=1)
