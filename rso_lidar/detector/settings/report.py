"""Settings of the report: how many bits a camera gives to range and intensity, and what it says without a return."""

from __future__ import annotations

from typing import Annotated, Self

import numpy as np
from pydantic import Field, model_validator

from rso_lidar import units
from rso_lidar.errors import RecordError
from rso_lidar.part import Flag, NotNegative, Part, Positive, Whole
from rso_lidar.records import Reading

FLAGS = ("crosstalk", "saturated", "superimposed")  # from the lowest bit on
_MOST_RETURNS = 2


class ReportWords(Part):
    """Integer words in which a camera reports each pixel, made from the measured frame, which stays as it is.

    Range word: (range − `range_offset_m`) / `range_quantum_m`, rounded. Intensity word: counts over
    `intensity_quantum_counts`, rounded, and at most the highest word. A pixel without a return has `no_return_word` for a
    range and 0 for an intensity. So has one whose range the bits cannot hold. With `max_returns` over 1 the two nearest
    returns of a pixel are reported, else one.

    A word holds the intensity in its lowest bits, then the range, then the flags. It has 8, 16, 32 or 64 bits, the least
    that suffice. The defaults are those that public import scripts state for a flash ladar of 128 x 128 pixels: 20 bits of
    range in steps of 1/64 foot, full scale 4,994 m, above 12 bits of intensity.
    """

    range_quantum_m: Positive = Field(
        default=0.3048 / 64.0,
        description="Step of the range words [m]. Default: 1/64 foot, stated by public import scripts of one camera.",
    )
    range_offset_m: NotNegative = Field(default=0.0, description="Range of word 0 [m]. Default: a choice.")
    range_bits: Annotated[Whole, Field(ge=4, le=32)] = Field(
        default=20, description="Bits of the range. Default: stated by public import scripts of one camera."
    )
    intensity_bits: Annotated[Whole, Field(ge=1, le=16)] = Field(
        default=12, description="Bits of the intensity. Default: stated by public import scripts of one camera."
    )
    intensity_quantum_counts: Positive = Field(
        default=1.0, description="Step of the intensity words, in counts of the reading [counts]. Default: a choice."
    )
    no_return_word: Annotated[Whole, Field(ge=0)] = Field(
        default=0, description="Range word of a pixel without a return. Default: a choice."
    )
    flags: Flag = Field(
        default=False,
        description=(
            "Whether the flags crosstalk, saturated and superimposed are reported, and what is true beside them; of "
            "`gsfl` alone. Default: a choice."
        ),
    )

    @model_validator(mode="after")
    def _fits(self) -> Self:
        if self.no_return_word >= 2**self.range_bits:
            raise ValueError(
                f"no_return_word ({self.no_return_word}) needs more than range_bits ({self.range_bits}); "
                f"take one below {2**self.range_bits}"
            )
        return self

    @property
    def word_bits(self) -> int:
        """Bits of a word: 8, 16, 32 or 64."""
        used = self.range_bits + self.intensity_bits + len(FLAGS) * self.flags
        return next(bits for bits in (8, 16, 32, 64) if bits >= used)

    @property
    def range_to_m(self) -> float:
        """Range of the highest word [m]."""
        return self.range_offset_m + float(2**self.range_bits - 1) * self.range_quantum_m

    @property
    def intensity_to_counts(self) -> float:
        """Counts of the highest intensity word."""
        return float(2**self.intensity_bits - 1) * self.intensity_quantum_counts

    def describe(self) -> str:
        """Return the words in a line of text."""
        flags = f", flags {', '.join(FLAGS)}" if self.flags else ""
        return (
            f"  report    words of {self.word_bits} bits: range in {self.range_bits} bits, steps of "
            f"{self.range_quantum_m / units.MM:.4g} mm, {self.range_offset_m:g} to {self.range_to_m:,.1f} m; intensity in "
            f"{self.intensity_bits} bits, steps of {self.intensity_quantum_counts:g} "
            f"count{'s' * (self.intensity_quantum_counts != 1.0)}{flags}"
        )

    def encode(self, reading: Reading) -> np.ndarray:
        """Return the words of a frame.

        Parameters
        ----------
        reading : what the detector measured

        Returns
        -------
        numpy.ndarray
            (return, row, col) little-endian unsigned words of `word_bits`, the nearest return first.

        Raises
        ------
        RecordError
            If `flags` are wanted of a reading that has none.
        """
        range_m, counts = reading.range_m[None], reading.intensity_counts[None]
        if reading.return_range_m is not None and reading.return_intensity_counts is not None:
            listed = reading.return_range_m, reading.return_intensity_counts
            range_m, counts = (np.moveaxis(values[..., :_MOST_RETURNS], -1, 0) for values in listed)
        with np.errstate(invalid="ignore"):
            step = np.rint((range_m.astype(float) - self.range_offset_m) / self.range_quantum_m)
            is_held = (step >= 0.0) & (step < 2**self.range_bits)
        word = np.where(is_held, step, self.no_return_word).astype(np.uint64) << np.uint64(self.intensity_bits)
        steps = np.minimum(np.rint(counts / self.intensity_quantum_counts), 2**self.intensity_bits - 1)
        word |= np.where(is_held, steps, 0.0).astype(np.uint64)
        if self.flags:
            for k, name in enumerate(FLAGS):
                raised = getattr(reading, name)
                if raised is None:
                    raise RecordError(
                        f"report.flags: the reading has no flag '{name}'; simulate it with [lidar.detector.report] flags = "
                        "true, or leave flags out"
                    )
                bit = np.uint64(self.intensity_bits + self.range_bits + k)
                word |= (is_held & raised.astype(bool)).astype(np.uint64) << bit
        return word.astype(np.dtype(f"<u{self.word_bits // 8}"))


def refuse_flags(report: ReportWords | None) -> None:
    """Raise a `ValueError` for flags of a detector that has no pulses to tell them from."""
    if report is not None and report.flags:
        raise ValueError("report.flags are those of a gsfl, whose pulses are simulated; leave flags out")
