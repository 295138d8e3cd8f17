"""Cameras as a scenario describes them: lens, bands, sensor, exposure and mount."""

from __future__ import annotations

import math
from functools import cached_property
from typing import Any, Literal, Self

from pydantic import Field, field_validator, model_validator

from rso_lidar import units
from rso_lidar.imaging.image_sensor import ImageSensor
from rso_lidar.motion import Mount
from rso_lidar.optics import Laser, Receiver
from rso_lidar.part import Count, Flag, Fraction, Name, NotNegative, Number, Part, Positive, Whole

# Bands by name. The quantum efficiencies are assumed: those of a front-side illuminated CMOS sensor.
_GREY = {"name": "grey", "wavelength_nm": 575.0, "width_nm": 350.0, "quantum_efficiency": 0.45}
_NIR = {"name": "nir", "wavelength_nm": 850.0, "width_nm": 50.0, "quantum_efficiency": 0.20}
_RGB = (
    {"name": "red", "wavelength_nm": 625.0, "width_nm": 100.0, "quantum_efficiency": 0.40},
    {"name": "green", "wavelength_nm": 535.0, "width_nm": 100.0, "quantum_efficiency": 0.45},
    {"name": "blue", "wavelength_nm": 460.0, "width_nm": 80.0, "quantum_efficiency": 0.40},
)
BANDS: dict[str, tuple[dict[str, Any], ...]] = {"grey": (_GREY,), "nir": (_NIR,), "rgb": _RGB}
_LEAST_FIELD = 1.001  # over the field: the even light that stands for the Sun's reaches the last pixel


class Band(Part):
    """A band of wavelengths, in which filter and sensor are even."""

    name: Name = Field(description="Name of the band.")
    wavelength_nm: Positive = Field(description="Middle of the band [nm].", ge=300, le=2500)
    width_nm: Positive = Field(description="Width of the band [nm].", le=2000)
    quantum_efficiency: Positive = Field(
        default=0.5, le=1, description="Photoelectrons of a photon that reaches the sensor. Default: assumed."
    )

    @property
    def wavelength_m(self) -> float:
        """Middle of the band [m]."""
        return self.wavelength_nm * units.NM

    def contains(self, wavelength_nm: float) -> bool:
        """Return whether light is within the band.

        Parameters
        ----------
        wavelength_nm : of the light [nm]
        """
        return abs(wavelength_nm - self.wavelength_nm) <= 0.5 * self.width_nm


class CameraLens(Receiver):
    """Lens and focal plane of a camera, with the keys of the lidar's receiver.

    `glare` scatters light of Sun, Earth and Moon over the image; their own images do
    not need it.
    """

    n_rows: Count = Field(default=512, description="Number of pixel rows. Default: a choice.")
    n_cols: Count = Field(default=512, description="Number of pixel columns. Default: a choice.")
    pixel_pitch_um: Positive = Field(default=5.5, description="Pitch of the square pixels [µm]. Default: assumed.")
    transmission: Positive = Field(default=0.9, le=1, description="Transmission of the lens. Default: assumed.")
    rays_per_pixel: Count = Field(
        default=4,
        description="Number of rays of a pixel on an edge of a part, of light or of shadow, a square number k × k. Up to 9, "
        "other pixels have one ray. Targets smaller than some pixels get more. Default: a choice of sampling.",
    )
    filter_width_nm: Positive = Field(
        default=1.0, exclude=True, description="Leave it out: a camera has the width of its bands [nm]."
    )

    @model_validator(mode="after")
    def _no_filter(self) -> Self:
        if "filter_width_nm" in self.model_fields_set:
            raise ValueError("filter_width_nm: a camera has the width of its bands; leave it out, and give bands")
        return self

    @cached_property
    def even_light(self) -> Laser:
        """Light that fills the field, for the rays that sample the pixels: none of it is ever counted."""
        tangent = _LEAST_FIELD * float(self.field_edge.max())
        return Laser(divergence_deg=2.0 * math.atan(tangent) / units.DEG)


class AutoExposure(Part):
    """Exposure that fits the scene: the light of Sun and Earth fills the wells of the brightest pixels as far as wanted.

    It knows the scene of the same frame, without noise and without the laser's light, so that no frame depends on another.
    """

    fill_fraction: Fraction = Field(
        default=0.8, gt=0, description="Share of the full well that the brightest pixels reach. Default: a choice."
    )
    brighter_pixels: Count = Field(
        default=16, description="How many pixels may be brighter, such as glints [pixels]. Default: a choice."
    )
    min_ms: Positive = Field(default=0.05, description="Shortest exposure [ms]. Default: a choice.")
    max_ms: Positive = Field(default=100.0, description="Longest exposure [ms]. Default: a choice.")

    @model_validator(mode="after")
    def _in_order(self) -> Self:
        if self.min_ms > self.max_ms:
            raise ValueError(f"min_ms: {self.min_ms:g} is above max_ms ({self.max_ms:g}); exchange them")
        return self


class Camera(Part):
    """A camera on the follower or on the pan-tilt unit, which takes an image with every laser flash.

    It sees targets in the light of the Sun, of the Earth where `world.earth_albedo` is given, and of the laser, if its
    wavelength is in a band and the pulse returns within the exposure. It sees the Sun, the lit Earth, the Moon and stars
    as background. Its axes are named like the camera: x right, y down, z along the boresight.
    """

    name: Name = Field(description="Name of the camera and of its axes.")
    carrier: Literal["follower", "ptu"] = Field(
        default="follower", description="What carries the camera. Default: a choice."
    )
    mount: Mount = Field(
        default=Mount(), description="Pose carrier_from_camera. Without rotation the boresight is the carrier's +x."
    )
    lens: CameraLens = Field(description="Lens and focal plane.")
    bands: tuple[Band, ...] = Field(
        default=(Band(**_GREY),),
        min_length=1,
        max_length=8,
        description='Bands, each with an image of its own; or by name, `"grey"`, `"nir"` or `"rgb"`. Default: grey.',
    )
    sensor: ImageSensor = Field(default=ImageSensor(), description="Sensor.")
    exposure_ms: Positive = Field(default=1.0, le=60_000, description="Exposure of each row [ms]. Default: a choice.")
    auto_exposure: AutoExposure | None = Field(
        default=None, description="Exposure that fits the scene, in place of `exposure_ms`. If omitted, it is constant."
    )
    start_ms: Number = Field(
        default=0.0,
        ge=-60_000,
        le=60_000,
        description="Start of the first row's exposure after the flash [ms]. Default: a choice, the flash.",
    )
    row_delay_us: NotNegative = Field(
        default=0.0,
        le=1e6,
        description="Time from one row's exposure to that of the next, of a rolling shutter [µs]. Default: 0, global.",
    )
    sky: tuple[Literal["sun", "earth", "moon", "stars"], ...] = Field(
        default=("sun", "earth", "moon", "stars"), description="What is seen behind the targets. Default: all."
    )
    has_penumbra: Flag = Field(
        default=True, description="Whether shadows are as soft as the Sun's disc makes them. Default: a choice."
    )
    pattern_seed: Whole = Field(
        default=0,
        ge=0,
        lt=2**63,
        description="Random seed of what is fixed in this camera: sensitivity and dark current of each pixel. It is "
        "independent of the scenario's seed. Default: a choice.",
    )

    @field_validator("bands", mode="before")
    @classmethod
    def _by_name(cls, given: Any) -> Any:
        if not isinstance(given, str):
            return given
        if given not in BANDS:
            raise ValueError(f"bands: no '{given}' (known: {', '.join(BANDS)}); or give wavelength_nm and width_nm")
        return BANDS[given]

    @model_validator(mode="after")
    def _check_bands(self) -> Self:
        names = [band.name for band in self.bands]
        if twice := [name for name in names if names.count(name) > 1]:
            raise ValueError(f"bands: two have the name '{twice[0]}'; rename one")
        return self

    @property
    def shape(self) -> tuple[int, int, int]:
        """Rows, columns and bands of an image."""
        return *self.lens.shape, len(self.bands)

    def describe(self) -> str:
        """Describe the camera in a line."""
        lens = self.lens
        bands = ", ".join(f"{band.name} {band.wavelength_nm:g} nm" for band in self.bands)
        exposure = "auto exposure" if self.auto_exposure is not None else f"{self.exposure_ms:g} ms"
        return (
            f"{self.name}, on the {self.carrier}: {lens.n_rows} x {lens.n_cols} pixels, {lens.fov_rad / units.DEG:.3g}° "
            f"across, {lens.ifov_rad / units.MRAD:.3g} mrad a pixel, {bands}, {exposure}"
        )

    @property
    def rows_s(self) -> float:
        """Time from the start of the first row's exposure to that of the last [s]."""
        return (self.lens.n_rows - 1) * self.row_delay_us * units.US
