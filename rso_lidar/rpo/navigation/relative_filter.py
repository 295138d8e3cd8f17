"""The part that describes a relative navigation filter: its sensors, its start and its process noise."""

from __future__ import annotations

import math
from typing import Annotated, Literal, Self

import numpy as np
from pydantic import Field, model_validator

from rso_lidar.errors import ScenarioError
from rso_lidar.part import NotNegative, Part, Positive, Vector
from rso_lidar.rpo.navigation.navigation_sensors import AnyNavigationSensor
from rso_lidar.rpo.navigation.slow_errors import SlowErrors

_MOST_MEASUREMENTS = 20_000  # instants


class RelativeFilter(Part):
    """Navigation by an iterated extended Kalman filter of the relative state, on measurements of sensors.

    The filter starts from an estimate with an error drawn from its covariance. It propagates with the gravity that is flown,
    adds the burns that guidance commands, and knows the errors of thrusters only by their standard deviations. Constant
    errors of thrusters are calibrated: it knows them. On a leg held by thrust, it estimates the error of that thrust, too.
    Biases and wandering centroids of its sensors are further states, as `slow_errors` says.
    """

    type: Literal["filter"] = "filter"
    every_s: Annotated[Positive, Field(ge=1.0)] = Field(
        description="Time from one measurement to the next, the first after that time; at least 1 [s]."
    )
    sensors: Annotated[tuple[AnyNavigationSensor, ...], Field(min_length=1, max_length=8)] = Field(
        description="Sensors: `lidar` and `camera`. All that can measure at an instant do."
    )
    position_sigma_m: Vector = Field(
        description="Standard deviations of the first estimate's position: radial, along-track and cross-track [m]."
    )
    velocity_sigma_m_s: Vector = Field(
        description="Standard deviations of the first estimate's velocity relative to the rotating rtn axes [m/s]."
    )
    acceleration_m_s2_sqrt_hz: NotNegative = Field(
        default=1e-7,
        description=(
            "Process noise: root of the spectral density of white acceleration in each axis [m/s²/√Hz]. It covers what is "
            "not modelled; flights do not draw it."
        ),
    )

    slow_errors: Literal["estimated", "considered", "ignored"] = Field(
        default="estimated",
        description=(
            "What the filter does about `bias` and `centroid` of its sensors, which flights draw in any case: `estimated`, "
            "as states; `considered`, their uncertainty counts, but they are not estimated (Schmidt); `ignored`, it takes "
            "them to be absent, and is overconfident."
        ),
    )

    @model_validator(mode="after")
    def _has_start(self) -> Self:
        for key in ("position_sigma_m", "velocity_sigma_m_s"):
            if min(getattr(self, key)) <= 0.0:
                raise ValueError(f"{key}: the first estimate needs an uncertainty in each axis; give more than 0")
        return self

    @property
    def start_sigma(self) -> np.ndarray:
        """Standard deviations (6,) of the first estimate in rtn axes [m], [m/s]."""
        return np.array([*self.position_sigma_m, *self.velocity_sigma_m_s])

    @property
    def sensor_errors(self) -> SlowErrors:
        """Biases and wandering centroids of the sensors."""
        return SlowErrors([(sensor.bias, sensor.centroid, sensor.measures_range) for sensor in self.sensors])

    def list_instants_s(self, after_s: float, until_s: float) -> np.ndarray:
        """Return the instants (time,) of measurements after one instant, up to another [s].

        Parameters
        ----------
        after_s, until_s : the instants [s]

        Raises
        ------
        ScenarioError
            if they are too many
        """
        count = math.floor(until_s / self.every_s + 1e-9)
        if count > _MOST_MEASUREMENTS:
            raise ScenarioError(
                f"navigation.every_s: {count:,} measurements up to {until_s:g} s are more than {_MOST_MEASUREMENTS:,}; "
                "leave more time between them"
            )
        first = math.floor(max(after_s, 0.0) / self.every_s + 1e-9) + 1
        return self.every_s * np.arange(first, count + 1)

    def find_noise(self, step_s: float) -> np.ndarray:
        """Return the covariance (6, 6) that the process noise adds over a step [m2, m2/s, m2/s2].

        It is that of a double integrator. Over a step short against the orbit, gravity changes it by (n step)^2.

        Parameters
        ----------
        step_s : length of the step [s]
        """
        density = self.acceleration_m_s2_sqrt_hz**2
        block = density * np.array([[step_s**3 / 3.0, step_s**2 / 2.0], [step_s**2 / 2.0, step_s]])
        covariance: np.ndarray = np.kron(block, np.eye(3))
        return covariance
