"""Array of avalanche photodiodes in Geiger mode: its settings, by default those of a published camera at 1064 nm."""

from __future__ import annotations

import math
from functools import cached_property
from typing import Annotated, Literal, Self

import numpy as np
from pydantic import Field, model_validator

from rso_lidar import units
from rso_lidar.detector.geiger.counting import false_peak_probability, find_least_counts, threshold_primaries
from rso_lidar.detector.settings.report import ReportWords, refuse_flags
from rso_lidar.detector.settings.traits import DetectorTraits
from rso_lidar.errors import ScenarioError
from rso_lidar.part import Count, NotNegative, Number, Part, Positive

_MOST_BINS = 2**17  # of a histogram


class GeigerArray(Part):
    """An array of avalanche photodiodes in Geiger mode (SPADs): it counts single photons over many pulses.

    In each of `pulses` pulses a pixel is armed while the gate is open. The first avalanche, of a photon or of a dark
    carrier, is timed to a bin of `bin_ns`. The pixel is then dead for `hold_off_ns`. A frame's times form a histogram, and
    the window of `peak_ns` with most counts is the peak. Its centroid gives the range, and its counts are the intensity. A
    peak below the least counts is not reported.

    A plan or a command moves the gate, which stays as long as it is. The defaults are those of InGaAsP cameras of 32 × 32
    pixels at 1064 nm (Itzler et al. 2010a, 2010b and 2014), where published.
    """

    type: Literal["geiger"] = "geiger"
    detection_efficiency: Annotated[Number, Field(gt=0, le=1)] = Field(
        default=0.4,
        description=(
            "Probability that a photon on the pixel starts an avalanche. Default: Itzler et al. 2010a, up to 40 % with "
            "the losses of optics and microlenses; 2010b, more than 40 % at 250 K; high confidence."
        ),
    )
    dark_count_rate_hz: NotNegative = Field(
        default=20_000.0,
        description=(
            "Avalanches a second of an armed pixel in the dark [Hz]. Default: Itzler et al. 2010a and 2010b, the upper "
            "limit stated for that efficiency; high confidence."
        ),
    )
    hold_off_ns: Positive = Field(
        default=3400.0,
        description=(
            "Dead time after an avalanche [ns]; longer than the gate, it leaves one count in a pulse. Default: rest of "
            "a period at 186 kHz after a gate of 2 µs (Itzler et al. 2010a), where a pixel times one avalanche in "
            "a period; medium confidence."
        ),
    )
    afterpulse_probability: Annotated[Number, Field(ge=0, lt=1)] = Field(
        default=0.0,
        description=(
            "Probability that a carrier trapped in an avalanche starts another one after the hold-off. Default: none, "
            "because the gate is closed by then; assumed."
        ),
    )
    afterpulse_time_ns: Positive = Field(
        default=1500.0,
        description=(
            "Mean time from the end of the hold-off to an afterpulse [ns]. Default: within the 1.1 to 2.4 µs of one gated "
            "InGaAs detector (Shaw et al. 2021); low confidence for an array."
        ),
    )
    jitter_ns: NotNegative = Field(
        default=0.2,
        description=(
            "Jitter of each time, 1 sigma [ns], bins not included. Default: assumed, half a nanosecond of full width, "
            "twice the 0.24 ns of one gated InGaAs detector (Shaw et al. 2021); low confidence."
        ),
    )
    bin_ns: Positive = Field(
        default=0.25, description="Bin of the clock [ns]. Default: Itzler et al. 2014; high confidence."
    )
    gate_from_m: NotNegative = Field(default=0.0, description="Range at which the gate opens [m]. Default: assumed.")
    gate_to_m: Positive = Field(
        default=300.0,
        description=(
            "Range at which the gate closes [m]. Default: 2 µs after it opens (Itzler et al. 2010a); high confidence."
        ),
    )
    pulses: Annotated[Count, Field(le=10_000)] = Field(
        default=100,
        description="Pulses whose times form the histogram of a frame. Default: assumed, 0.54 ms at 186 kHz.",
    )
    peak_ns: Positive = Field(
        default=2.0,
        description=(
            "Time over which counts belong to one peak [ns], rounded to bins. It should span pulse and jitter. "
            "Default: assumed."
        ),
    )
    false_alarm_probability: Annotated[Number, Field(ge=1e-12, lt=0.5)] = Field(
        default=1e-3,
        description=(
            "False alarm probability of one pixel in one frame. The least counts of a peak follow from it, from dark "
            "counts and sunlight. Default: assumed."
        ),
    )
    least_counts: Annotated[Count, Field(le=65_535)] | None = Field(
        default=None,
        description="Least counts of a peak [counts]. Default: those that follow from `false_alarm_probability`.",
    )
    report: ReportWords | None = Field(
        default=None,
        description="Integer words in which the camera reports its pixels. If omitted, the frame has numbers alone.",
    )

    @model_validator(mode="after")
    def _sensible(self) -> Self:
        refuse_flags(self.report)
        if self.gate_to_m <= self.gate_from_m:
            raise ValueError(f"gate_to_m ({self.gate_to_m:g}) must be beyond gate_from_m ({self.gate_from_m:g})")
        if not 2 <= self.n_bins <= _MOST_BINS:
            raise ValueError(
                f"a gate of {self.gate_s / units.NS:.4g} ns has {self.n_bins:,} bins of bin_ns = {self.bin_ns:g}, not 2 "
                f"to {_MOST_BINS:,}; change bin_ns or the gate"
            )
        if self.peak_s > self.gate_s:
            raise ValueError(f"peak_ns ({self.peak_ns:g}) is longer than the gate; shorten it")
        if self.hold_off_ns < self.bin_ns:
            raise ValueError(f"hold_off_ns ({self.hold_off_ns:g}) must not be shorter than bin_ns ({self.bin_ns:g})")
        if self.dark_least_counts > self.most_counts:
            raise ValueError(
                f"a peak needs {self.dark_least_counts} counts, but {self.pulses} pulse(s) give {self.most_counts} at most; "
                "raise pulses or false_alarm_probability, or lower least_counts"
            )
        return self

    @property
    def opens_s(self) -> float:
        """Time from emission to the opening of the gate [s]."""
        return self.gate_from_m / units.RANGE_PER_DELAY_M_S

    @property
    def gate_s(self) -> float:
        """Length of the gate [s]."""
        return (self.gate_to_m - self.gate_from_m) / units.RANGE_PER_DELAY_M_S

    @property
    def bin_s(self) -> float:
        """Bin of the clock [s]."""
        return self.bin_ns * units.NS

    @property
    def n_bins(self) -> int:
        """Number of bins that the gate fills, the last one perhaps in part."""
        return math.ceil(self.gate_s / self.bin_s * (1.0 - 1e-12))

    @property
    def hold_off_s(self) -> float:
        """Dead time after an avalanche [s]."""
        return self.hold_off_ns * units.NS

    @property
    def peak_bins(self) -> int:
        """Number of bins in a peak."""
        return max(1, round(self.peak_ns / self.bin_ns))

    @property
    def peak_s(self) -> float:
        """Length of a peak [s]."""
        return self.peak_bins * self.bin_s

    @property
    def most_counts(self) -> int:
        """Most counts that a peak can have, of avalanches a hold-off apart."""
        return self.pulses * (1 + math.floor(self.peak_s / self.hold_off_s))

    @cached_property
    def dark_least_counts(self) -> int:
        """Least counts of a peak in the dark."""
        return int(self.find_least_counts(np.zeros(1))[0])

    @cached_property
    def traits(self) -> DetectorTraits:
        """Facts that a scenario reads about this detector."""
        primaries = threshold_primaries(self.pulses, self.dark_least_counts)
        light = max(primaries - self.dark_count_rate_hz * self.peak_s, 1e-3 * primaries)  # dark counts do the rest
        return DetectorTraits(
            sees_to_m=self.gate_to_m,
            threshold_photons=light / self.detection_efficiency,
            sees_from_m=self.gate_from_m,
            returns="strongest",
            saturation_photons=math.log(2.0 * self.pulses) / self.detection_efficiency,
            settings={"gate_delay_s": self.opens_s, "gate_width_s": self.gate_s},
            is_gated=True,
            window_keys="gate_from_m and gate_to_m",
            clock_s=self.bin_s,
            pulses=self.pulses,
        )

    def with_gate_delay(self, delay_ns: float) -> Self:
        """Return a copy whose gate opens `delay_ns` after emission and is as long as before.

        Parameters
        ----------
        delay_ns : time between the flash and the opening of the gate [ns]

        Raises
        ------
        ScenarioError : if the time is negative or NaN, or the gate would open too far away.
        """
        if not delay_ns >= 0.0:
            raise ScenarioError(f"delay_ns: {delay_ns:g} is not a time after emission; give a number from 0")
        opens_m = delay_ns * units.NS * units.RANGE_PER_DELAY_M_S
        return self.replace(gate_from_m=opens_m, gate_to_m=opens_m + (self.gate_to_m - self.gate_from_m))

    def noise_per_s(self, background_photons_per_s: np.ndarray) -> np.ndarray:
        """Return the rate of avalanches that are not due to the laser [1/s].

        Parameters
        ----------
        background_photons_per_s : sunlight on each pixel [photons/s]
        """
        return self.dark_count_rate_hz + self.detection_efficiency * background_photons_per_s

    def find_least_counts(self, background_photons_per_s: np.ndarray) -> np.ndarray:
        """Return the least counts of a peak that is reported.

        Parameters
        ----------
        background_photons_per_s : sunlight on each pixel [photons/s]
        """
        if self.least_counts is not None:
            return np.full(np.shape(background_photons_per_s), self.least_counts)
        noise = self._frame_noise_per_s(background_photons_per_s)
        return find_least_counts(self.false_alarm_probability, noise, self.gate_s, self.bin_s, self.peak_bins)

    def false_peak_probability(self, background_photons_per_s: np.ndarray) -> np.ndarray:
        """Return the probability that noise alone makes a pixel report, for a frame.

        Parameters
        ----------
        background_photons_per_s : sunlight on each pixel [photons/s]
        """
        noise = self._frame_noise_per_s(background_photons_per_s)
        least = self.find_least_counts(background_photons_per_s)
        return false_peak_probability(least, noise, self.gate_s, self.bin_s, self.peak_bins)

    def _frame_noise_per_s(self, background_photons_per_s: np.ndarray) -> np.ndarray:
        """Return counts of noise in a second of gate over all pulses, afterpulses included."""
        each = self.noise_per_s(background_photons_per_s)
        return self.pulses * each / (1.0 - self.afterpulse_probability)
