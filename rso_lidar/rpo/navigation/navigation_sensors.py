"""Sensors of relative navigation: a lidar that measures range and direction, and a camera that measures direction.

They are described by their errors and their limits: no frame is rendered. `rl.study.find_navigation_lidar`
makes the lidar from the link budget of a scenario's instrument.
"""

from __future__ import annotations

from typing import Annotated, Literal, Self

import numpy as np
from pydantic import Field, model_validator

from rso_lidar import units
from rso_lidar.orbit import Epochs, angle_rad, sun_position_m, sunlit_fraction
from rso_lidar.part import Flag, NotNegative, Part, Positive
from rso_lidar.rpo.navigation.slow_errors import CentroidWander, SensorBias

_LIT = 0.5  # fraction of the Sun's disc above which a target counts as lit
_MOST_ROWS = 1000


class RangeNoise(Part):
    """Standard deviation of a range against range, interpolated in logarithms and constant beyond both ends."""

    range_m: Annotated[tuple[Positive, ...], Field(min_length=2, max_length=_MOST_ROWS)] = Field(
        description="Ascending ranges [m]."
    )
    sigma_m: Annotated[tuple[Positive, ...], Field(min_length=2, max_length=_MOST_ROWS)] = Field(
        description="Standard deviation of a range at each of these [m]."
    )

    @model_validator(mode="after")
    def _is_table(self) -> Self:
        if len(self.range_m) != len(self.sigma_m):
            raise ValueError(
                f"sigma_m: has {len(self.sigma_m)} values for {len(self.range_m)} ranges; give one for each range_m"
            )
        if any(b <= a for a, b in zip(self.range_m, self.range_m[1:], strict=False)):
            raise ValueError("range_m: the ranges do not ascend; sort them, each once")
        return self

    def find_sigma_m(self, range_m: np.ndarray) -> np.ndarray:
        """Return the standard deviation at ranges [m].

        Parameters
        ----------
        range_m : ranges (run,) [m]
        """
        sigma_m: np.ndarray = np.exp(np.interp(np.log(range_m), np.log(self.range_m), np.log(self.sigma_m)))
        return sigma_m


class _NavigationSensor(Part):
    """What all sensors of relative navigation have: the error of a direction, and the limits within which they measure."""

    bearing_sigma_deg: Annotated[Positive, Field(ge=1e-6, le=10.0)] = Field(
        description="Standard deviation of a measured direction about each of two axes across it [deg]."
    )
    origin_sigma_m: NotNegative = Field(
        default=0.0,
        description=(
            "Standard deviation of each component of the measured point from the target's origin, white in time [m]."
        ),
    )
    bias: SensorBias | None = Field(default=None, description="Bias of ranges and directions; none if omitted.")
    centroid: CentroidWander | None = Field(
        default=None,
        description="Distance of the measured point from the target's origin that varies slowly; none if omitted.",
    )
    least_range_m: NotNegative = Field(default=0.0, description="Least range at which it measures [m].")
    most_range_m: Positive | None = Field(
        default=None, description="Greatest range at which it measures [m]. If omitted, no limit."
    )
    fov_deg: Annotated[Positive, Field(le=180.0)] | None = Field(
        default=None,
        description=(
            "Full angle of the field of view, whose centre is where the filter expects the target [deg]. If omitted, it "
            "sees in all directions."
        ),
    )
    sun_exclusion_deg: Annotated[NotNegative, Field(le=180.0)] = Field(
        default=0.0, description="It does not measure with the Sun nearer than this to the line of sight [deg]."
    )

    @model_validator(mode="after")
    def _has_ranges(self) -> Self:
        if self.most_range_m is not None and self.most_range_m <= self.least_range_m:
            raise ValueError(
                f"most_range_m: {self.most_range_m:g} m is not beyond least_range_m, {self.least_range_m:g} m; it would "
                "never measure; give a greater one"
            )
        return self

    @model_validator(mode="after")
    def _measures_what_errs(self) -> Self:
        for table, key, sigma in (
            ("bias", "range_sigma_m", self.bias.range_sigma_m if self.bias else 0.0),
            ("centroid", "along_sigma_m", self.centroid.along_sigma_m if self.centroid else 0.0),
        ):
            if sigma and not self.measures_range:
                raise ValueError(f"{table}.{key}: a camera measures no range; leave it out")
        return self

    @property
    def measures_range(self) -> bool:
        """Whether it measures range besides direction."""
        return False

    def find_range_sigma_m(self, range_m: np.ndarray) -> np.ndarray:
        """Return the standard deviation of a range [m]; infinite without ranges.

        Parameters
        ----------
        range_m : ranges (run,) [m]
        """
        return np.full_like(range_m, np.inf)

    def find_bearing_sigma_rad(self, range_m: np.ndarray) -> np.ndarray:
        """Return the standard deviation of each of the two angles of a direction [rad].

        Parameters
        ----------
        range_m : ranges (run,) [m]
        """
        sigma_rad: np.ndarray = np.hypot(self.bearing_sigma_deg * units.DEG, self.origin_sigma_m / range_m)
        return sigma_rad

    def can_measure(self, range_m: np.ndarray, off_axis_rad: np.ndarray) -> np.ndarray:
        """Return whether the target is within the limits of range and field, whatever the light is.

        Parameters
        ----------
        range_m : true ranges (run,) [m]
        off_axis_rad : angle between the expected and the true direction (run,) [rad]
        """
        within: np.ndarray = range_m >= self.least_range_m
        if self.most_range_m is not None:
            within &= range_m <= self.most_range_m
        if self.fov_deg is not None:
            within &= off_axis_rad <= 0.5 * self.fov_deg * units.DEG
        return within


class NavigationLidar(_NavigationSensor):
    """A lidar as a sensor of navigation: range and direction of the target."""

    type: Literal["lidar"] = "lidar"
    range_sigma_m: Annotated[Positive, Field(ge=1e-4)] = Field(
        default=0.05, description="Standard deviation of a range, at any range; at least 0.0001 [m]."
    )
    range_noise: RangeNoise | None = Field(
        default=None,
        description=(
            "Noise of a range that grows with range, added in squares. `rl.study.find_navigation_lidar` makes it from the "
            "instrument. If omitted, none."
        ),
    )

    @property
    def measures_range(self) -> bool:
        """Whether it measures range besides direction."""
        return True

    def find_range_sigma_m(self, range_m: np.ndarray) -> np.ndarray:
        """Return the standard deviation of a range [m]."""
        square = self.range_sigma_m**2 + self.origin_sigma_m**2
        grown = self.range_noise.find_sigma_m(range_m) ** 2 if self.range_noise is not None else 0.0
        sigma_m: np.ndarray = np.sqrt(square + grown + np.zeros_like(range_m))
        return sigma_m


class NavigationCamera(_NavigationSensor):
    """A camera as a sensor of navigation: direction of a sunlit target."""

    type: Literal["camera"] = "camera"
    needs_sunlight: Flag = Field(
        default=True,
        description="Whether it measures only while the Sun shines on the target; false for thermal infrared.",
    )


AnyNavigationSensor = Annotated[NavigationLidar | NavigationCamera, Field(discriminator="type")]


def find_clear_views(
    sensors: tuple[NavigationLidar | NavigationCamera, ...], epochs: Epochs, target_m: np.ndarray, craft_m: np.ndarray
) -> np.ndarray:
    """Find when the Sun lets sensors measure.

    Parameters
    ----------
    sensors : of navigation
    epochs : instants (time,)
    target_m, craft_m : positions (time, 3) [m], inertial axes

    Returns
    -------
    numpy.ndarray
        (time, sensor) bool, whether the Sun is outside the sensor's exclusion angle and lights the target where that is
        needed
    """
    sun_m = sun_position_m(epochs)
    lit = sunlit_fraction(target_m, sun_m) >= _LIT
    apart = angle_rad(target_m - craft_m, sun_m - craft_m)
    clear = np.empty((len(epochs), len(sensors)), dtype=bool)
    for k, sensor in enumerate(sensors):
        clear[:, k] = apart >= sensor.sun_exclusion_deg * units.DEG
        if isinstance(sensor, NavigationCamera) and sensor.needs_sunlight:
            clear[:, k] &= lit
    return clear
