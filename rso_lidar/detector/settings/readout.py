"""Settings of a pixel's readout: a few analog cells about the latch, and the converter behind them."""

from typing import Annotated, Self

from pydantic import Field, model_validator

from rso_lidar import units
from rso_lidar.part import Flag, NotNegative, Part, Positive, Whole


class Readout(Part):
    """Storage of a pulse: `samples` cells of `sample_ns`, `pretrigger_samples` of them before the latch, and a converter.

    One count is `electrons_per_count`. The baseline is at `baseline_counts`, so that noise below it is not lost. The
    converter clips at 2^`adc_bits` − 1. `quantised` = false leaves the counts unrounded. Fuller et al. (sec. 3.3) give 20
    samples; clock, depth and scale of the converter are assumed.
    """

    sample_ns: Positive = Field(
        default=2.38, description="Interval between samples [ns]. Default: assumed, a clock of 420 MHz; low confidence."
    )
    samples: Annotated[Whole, Field(ge=8, le=256)] = Field(
        default=20,
        description=(
            "Number of samples stored around a trigger. Default: Fuller et al., sec. 3.3 (20 analog samples about the "
            "return)."
        ),
    )
    pretrigger_samples: Annotated[Whole, Field(ge=1)] = Field(
        default=8,
        description="Number of whole samples stored before the one in which the trigger falls. Default: assumed.",
    )
    adc_bits: Annotated[Whole, Field(ge=4, le=16)] = Field(
        default=12,
        description=(
            "Resolution of the converter [bits]; full scale is 2^bits − 1 counts. Default: assumed; low confidence."
        ),
    )
    electrons_per_count: Positive = Field(
        default=200.0,
        description=(
            "Scale of the converter [electrons/count]. Default: assumed, one count is a fifth of the amplifier's noise."
        ),
    )
    baseline_counts: NotNegative = Field(
        default=64.0,
        description=(
            "Level without signal [counts]; it keeps negative noise within the converter's scale. Default: assumed."
        ),
    )
    quantised: Flag = Field(
        default=True, description="Whether samples are rounded to whole counts. Default: a converter is digital."
    )

    @model_validator(mode="after")
    def _room_after_the_latch(self) -> Self:
        if self.pretrigger_samples > self.samples - 4:
            raise ValueError(
                f"pretrigger_samples ({self.pretrigger_samples}) leaves fewer than 4 of {self.samples} samples for the "
                "pulse; take fewer"
            )
        if self.baseline_counts > 0.5 * self.full_scale_counts:
            raise ValueError(
                f"baseline_counts ({self.baseline_counts:g}) takes more than half of the {self.full_scale_counts} counts; "
                "lower it"
            )
        return self

    @property
    def sample_s(self) -> float:
        """Time between samples [s]."""
        return self.sample_ns * units.NS

    @property
    def full_scale_counts(self) -> int:
        """Greatest count that the converter gives."""
        return int(2**self.adc_bits) - 1

    @property
    def window_m(self) -> float:
        """Depth [m] that the stored samples span."""
        return self.samples * self.sample_s * units.RANGE_PER_DELAY_M_S
