"""The image sensor: expected electrons to counts, by the linear model of EMVA 1288."""

from __future__ import annotations

from functools import lru_cache
from typing import Annotated, Self

import numpy as np
from pydantic import Field, model_validator

from rso_lidar.part import Count, Fraction, NotNegative, Part, Positive, Whole

_CERTAIN = 1e6  # electrons above two full wells that always fill a pixel; numpy draws none above 9e18


class ImageSensor(Part):
    """Pixels and electronics of an image sensor: the linear model of EMVA 1288, release 4.0.

    A pixel collects photoelectrons and dark electrons, both with shot noise, up to its full well. Read noise is added, and
    the sum is converted to counts above the black level, rounded and clipped. Sensitivity and dark current differ from pixel
    to pixel, the same in all frames of a camera.
    """

    full_well_electrons: Positive = Field(
        default=10_000.0,
        description="Charge at which a pixel is full [electrons]. Default: assumed, of a global-shutter pixel of 5.5 µm.",
    )
    read_noise_electrons: NotNegative = Field(
        default=8.0, description="Noise in the dark at a very short exposure, 1 sigma [electrons]. Default: assumed."
    )
    dark_electrons_per_s: NotNegative = Field(
        default=50.0, description="Dark current of a pixel [1/s]. Default: assumed, near 25 °C."
    )
    electrons_per_count: Positive | None = Field(
        default=None,
        description="Electrons of one count, the inverse of the gain. If omitted, a full well is the greatest count.",
    )
    bits: Annotated[Count, Field(le=16)] = Field(default=12, description="Bits of the converter. Default: assumed.")
    black_level_counts: Whole = Field(
        default=64, ge=0, description="Output of a dark pixel [counts]. Default: assumed."
    )
    response_nonuniformity_fraction: Fraction = Field(
        default=0.01, description="Sensitivity from pixel to pixel, 1 sigma over the mean (PRNU). Default: assumed."
    )
    dark_nonuniformity_fraction: Fraction = Field(
        default=0.2, description="Dark current from pixel to pixel, 1 sigma over the mean. Default: assumed."
    )

    @model_validator(mode="after")
    def _has_room(self) -> Self:
        if self.black_level_counts >= self.greatest_count:
            raise ValueError(
                f"black_level_counts: {self.black_level_counts} leaves no counts of the {self.greatest_count} that "
                f"{self.bits} bits hold; lower it"
            )
        return self

    @property
    def greatest_count(self) -> int:
        """Greatest output of the converter [counts]."""
        return int(2**self.bits - 1)

    @property
    def gain_electrons(self) -> float:
        """Electrons of one count."""
        return self.electrons_per_count or self.full_well_electrons / (self.greatest_count - self.black_level_counts)

    def expose(
        self, electrons: np.ndarray, exposure_s: float, pattern_seed: tuple[int, ...], rng: np.random.Generator
    ) -> np.ndarray:
        """Draw what the sensor reports of light: with its fixed pattern, dark current and noise.

        Parameters
        ----------
        electrons : (row, col, band), expected electrons of the light in a pixel of mean sensitivity
        exposure_s : time for which each row was exposed [s]
        pattern_seed : random seed of what differs from pixel to pixel
        rng : of this frame

        Returns
        -------
        Counts (row, col, band), u2.
        """
        response, dark = draw_pattern(self, electrons.shape, pattern_seed)
        return self.read(electrons * response + self.dark_electrons_per_s * exposure_s * dark, rng)

    def read(self, electrons: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        """Draw what the sensor reports.

        Parameters
        ----------
        electrons : expected electrons of each pixel, dark ones included
        rng : of this frame

        Returns
        -------
        Counts of each pixel, u2.
        """
        full = self.full_well_electrons
        collected = np.minimum(rng.poisson(np.minimum(electrons, 2.0 * full + _CERTAIN)), full)
        if self.read_noise_electrons > 0.0:
            collected = collected + self.read_noise_electrons * rng.standard_normal(electrons.shape)
        counts = np.rint(collected / self.gain_electrons + self.black_level_counts)
        clipped: np.ndarray = np.clip(counts, 0, self.greatest_count).astype(np.uint16)
        return clipped


@lru_cache(maxsize=8)
def draw_pattern(sensor: ImageSensor, shape: tuple[int, ...], seed: tuple[int, ...]) -> tuple[np.ndarray, np.ndarray]:
    """Draw the sensitivity and the dark current of each pixel over their means.

    Parameters
    ----------
    sensor : with its nonuniformity
    shape : of the pixels (row, col, band)
    seed : random seed of this camera, the same for all frames

    Returns
    -------
    Both factors (row, col, band), at least 0, read-only.
    """
    rng = np.random.default_rng(seed)
    response = np.maximum(1.0 + sensor.response_nonuniformity_fraction * rng.standard_normal(shape), 0.0)
    dark = np.maximum(1.0 + sensor.dark_nonuniformity_fraction * rng.standard_normal(shape), 0.0)
    response.flags.writeable = dark.flags.writeable = False
    return response, dark
