"""Settings of a pixel's readout: a few analog cells about the latch, and the converter behind them."""

import math
from typing import Annotated, Self

from pydantic import Field, model_validator

from rso_lidar import units
from rso_lidar.part import Flag, NotNegative, Number, Part, Positive, Whole

MOST_INTENSITY_COUNTS = 65_535  # of a reading's 16 bits


class LowGain(Part):
    """A second channel behind the amplifier, of lower gain, sampled at the same instants as the first.

    A sample comes from this channel where the first one clips, multiplied by `ratio`: samples are on one linear scale. It
    has its own converter and its own noise. A pulse is saturated where both channels clip. All figures are assumed; the
    two gains of calorimeter readouts are 10 to 100 apart.
    """

    ratio: Annotated[Number, Field(ge=2.0, le=4096.0)] = Field(
        default=64.0, description="Gain of the first channel over the gain of this one. Default: assumed."
    )
    adc_bits: Annotated[Whole, Field(ge=4, le=16)] = Field(
        default=12,
        description="Resolution of this channel's converter [bits]. Default: assumed, that of the first channel.",
    )
    noise_counts: Annotated[Number, Field(ge=0.0, le=100.0)] = Field(
        default=0.5,
        description=(
            "Rms noise of a sample that this channel adds [counts], of its own converter, white from sample to sample. "
            "Default: assumed."
        ),
    )


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
    low_gain: LowGain | None = Field(
        default=None,
        description="Second channel of lower gain for samples that clip in the first. If omitted, there is one channel.",
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
        low = self.low_gain
        if low is not None and self.baseline_counts > 0.5 * (2**low.adc_bits - 1):
            raise ValueError(
                f"baseline_counts ({self.baseline_counts:g}) takes more than half of the {2**low.adc_bits - 1} counts of "
                "low_gain; lower it, or raise low_gain.adc_bits"
            )
        if low is not None and self.clip_counts <= self.full_scale_counts - self.baseline_counts:
            raise ValueError(
                f"low_gain clips at {self.clip_counts:g} counts of the first channel, which itself reaches "
                f"{self.full_scale_counts - self.baseline_counts:g}; raise low_gain.ratio or low_gain.adc_bits"
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
    def clip_counts(self) -> float:
        """Amplitude above the baseline at which samples clip, in both channels if there are two [counts]."""
        if self.low_gain is None:
            return self.full_scale_counts - self.baseline_counts
        return (float(2**self.low_gain.adc_bits) - 1.0 - self.baseline_counts) * self.low_gain.ratio

    @property
    def counts_per_intensity(self) -> int:
        """Counts of the first channel in one of `intensity_counts`: the least power of two for which 16 bits suffice."""
        return int(2 ** max(0, math.ceil(math.log2(self.clip_counts / MOST_INTENSITY_COUNTS))))

    @property
    def window_m(self) -> float:
        """Depth [m] that the stored samples span."""
        return self.samples * self.sample_s * units.RANGE_PER_DELAY_M_S
