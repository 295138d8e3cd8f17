"""What is stored of a pulse: a few analog cells about the latch, and the converter behind them."""

from typing import Annotated, Self

import numpy as np
from pydantic import Field, model_validator

from rso_lidar import units
from rso_lidar.arithmetic import compiled, packed
from rso_lidar.part import Flag, NotNegative, Part, Positive, Whole


class Readout(Part):
    """`samples` analog cells of `sample_ns`, of which `pretrigger_samples` lie before the latch, and a converter.

    One count is `electrons_per_count`; the baseline stands at `baseline_counts`, so that noise below it is not lost; the
    converter clips at 2^`adc_bits` − 1. `quantised` = false leaves the counts unrounded. The seed gives 20 samples; clock,
    depth and scale of the converter are assumed.
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
        """Return the time between samples [s]."""
        return self.sample_ns * units.NS

    @property
    def full_scale_counts(self) -> int:
        """Return the greatest count that the converter gives."""
        return int(2**self.adc_bits) - 1

    @property
    def window_m(self) -> float:
        """Return the depth [m] that the stored samples span."""
        return self.samples * self.sample_s * units.RANGE_PER_DELAY_M_S

    def store(
        self,
        amplitude: np.ndarray,
        row: np.ndarray,
        first: np.ndarray,
        per_sample: int,
        n: int,
        offset_counts: np.ndarray,
    ) -> np.ndarray:
        """Return `n` samples (trace, sample) [counts], converted: every `per_sample`th step of each `row` from `first` on.

        `amplitude` (row, step) is in electrons; `offset_counts` (trace) is what a pixel adds of its own.
        """
        if not compiled():
            step = first[:, None] + per_sample * np.arange(n)
            return self.convert(np.take_along_axis(amplitude[row], step, axis=1), offset_counts[:, None])
        from rso_lidar.detector.readout_loops import store

        counts = np.empty((len(row), n), np.float32)
        stored = store(
            packed(amplitude, np.float32),
            packed(row, np.int64),
            packed(first, np.int64),
            int(per_sample),
            np.float32(1.0 / self.electrons_per_count),
            (offset_counts + self.baseline_counts).astype(np.float32),
            np.float32(self.full_scale_counts),
            bool(self.quantised),
            counts,
        )
        assert stored == len(row), "samples: some lie outside their rows"
        return counts

    def convert(self, amplitude: np.ndarray, offset_counts: np.ndarray | float = 0.0) -> np.ndarray:
        """Return the converter's output [counts], baseline included, of amplitudes [electrons]; float32.

        `offset_counts` is what a pixel adds of its own.
        """
        counts = amplitude * np.float32(1.0 / self.electrons_per_count)
        counts = counts + np.asarray(offset_counts + self.baseline_counts, np.float32)
        if self.quantised:
            np.rint(counts, out=counts)
        np.clip(counts, 0.0, float(self.full_scale_counts), out=counts)
        result: np.ndarray = counts.astype(np.float32, copy=False)
        return result
