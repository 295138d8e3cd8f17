"""Empirical detector: curves over photons in the form of Fuller et al. (sec. 3.3), fitted to the default signal chain."""

import math
from functools import cached_property
from typing import Annotated, Literal, Self

import numpy as np
from pydantic import Field, model_validator

from rso_lidar import units
from rso_lidar.detector.settings.presets import FITTED
from rso_lidar.detector.settings.report import ReportWords, refuse_flags
from rso_lidar.detector.settings.traits import DetectorTraits
from rso_lidar.part import NotNegative, Number, Part, Positive, Whole

_NORMAL_95 = 1.6448536269514722  # the standard normal quantile of 0.95


class Empirical(Part):
    """A fast detector described by curves: detection, intensity and range noise as functions of photons.

    The model is that of Fuller et al., sec. 3.3. The signal of N expected photons is Gaussian with variance NEP² + F N /
    QE [photons²]. NEP is `noise_equivalent_photons` of the amplifier; F is the APD's excess noise factor and QE the
    quantum efficiency. A pixel triggers where the signal passes the threshold that gives 95 % at `reference_photons`. The
    defaults are fitted to the curves of the full chain with preset ``noise_limited`` (`make calibrate`).

    Light returns in clusters of range. The first cluster that triggers is reported, unless a false trigger comes before it.
    Only returns between `armed_from_m` and `armed_to_m` count. False triggers come there at `false_alarms_per_s`.

    Counts rise by `counts_per_photon` and bend toward `compression_counts` like x / (1 + (x/s)⁴)^¼. The converter clips
    them at 2^`adc_bits` − 1. The range noise has three terms in quadrature: `range_plateau_m`, and the shot noise and the
    amplifier noise behind a filter matched to the pulse. That filter sees samples every `sample_ns`, with
    `range_excess_noise_factor` for F and `range_noise_equivalent_photons` for NEP. Intensity has two such figures of its
    own.

    A tilted surface is as easy to detect and to range as a facing one: only the full chain stretches the pulse.
    """

    type: Literal["empirical"] = "empirical"
    reference_photons: Positive = Field(
        default=1000.0,
        description=(
            "Photons on a pixel that are detected with a probability of 95 % [photons]. Default: Fuller et al., sec. "
            "3.3."
        ),
    )
    noise_equivalent_photons: Positive = Field(
        default=FITTED["noise_equivalent_photons"],
        description=(
            "Amplifier noise expressed in photons, 1 sigma [photons]. Default: fitted to the detection of `gsfl`, "
            "preset `noise_limited` (`make calibrate`)."
        ),
    )
    quantum_efficiency: Annotated[Number, Field(gt=0, le=1)] = Field(
        default=0.8, description="Photoelectrons per photon. Default: assumed, equal to that of `gsfl`."
    )
    excess_noise_factor: Annotated[Number, Field(ge=1)] = Field(
        default=FITTED["excess_noise_factor"],
        description=(
            "Effective excess noise factor F of detection. Default: fitted together with `noise_equivalent_photons`. "
            "It includes the spread of thresholds and the trigger's search over a whole pulse, so it is not the F of "
            "the APD."
        ),
    )
    false_alarms_per_s: NotNegative = Field(
        default=FITTED["false_alarms_per_s"],
        description=(
            "False alarm rate of one pixel while armed [1/s]. Default: computed for `gsfl`, averaged over its spread "
            "of thresholds."
        ),
    )
    armed_from_m: NotNegative = Field(
        default=1.0, description="Range at which the pixels are armed; nothing nearer triggers [m]. Default: assumed."
    )
    armed_to_m: Positive = Field(
        default=5000.0,
        description=(
            "Range at which the pixels are disarmed; nothing farther triggers [m]. Default: assumed; the introduction "
            "of Fuller et al. mentions 5 km."
        ),
    )
    intensity_noise_equivalent_photons: NotNegative = Field(
        default=FITTED["intensity_noise_equivalent_photons"],
        description=(
            "Amplifier noise in the intensity, expressed in photons, 1 sigma [photons]. Default: fitted to the "
            "scatter of the counts of `gsfl`."
        ),
    )
    intensity_excess_noise_factor: NotNegative = Field(
        default=FITTED["intensity_excess_noise_factor"],
        description=(
            "Effective excess noise factor of the intensity. Default: fitted to the scatter of the counts of `gsfl`, "
            "together with `intensity_noise_equivalent_photons`."
        ),
    )
    counts_per_photon: Positive = Field(
        default=FITTED["counts_per_photon"],
        description="Slope of the linear regime [counts/photon]. Default: fitted to the counts of `gsfl`.",
    )
    compression_counts: Positive = Field(
        default=FITTED["compression_counts"],
        description="Level at which the response starts to compress [counts]. Default: fitted to the counts of `gsfl`.",
    )
    adc_bits: Annotated[Whole, Field(ge=4, le=16)] = Field(
        default=12,
        description=(
            "Resolution of the converter [bits]; full scale is 2^bits − 1 counts. Default: assumed; low confidence."
        ),
    )
    range_plateau_m: NotNegative = Field(
        default=FITTED["range_plateau_m"],
        description=(
            "Range noise that remains with high signal, 1 sigma [m]. Default: fitted to the range noise of `gsfl`, "
            "whose jitter gives the 5 cm of Fuller et al."
        ),
    )
    range_noise_equivalent_photons: NotNegative = Field(
        default=FITTED["range_noise_equivalent_photons"],
        description=(
            "Amplifier noise in the range, expressed in photons [photons]. Default: fitted to the range noise of "
            "`gsfl`."
        ),
    )
    range_excess_noise_factor: NotNegative = Field(
        default=FITTED["range_excess_noise_factor"],
        description=(
            "Effective excess noise factor of the range. Default: fitted to the range noise of `gsfl`, together with "
            "`range_noise_equivalent_photons`."
        ),
    )
    sample_ns: Positive = Field(
        default=2.38,
        description="Interval between samples of the pulse [ns]. Default: assumed, a clock of 420 MHz; low confidence.",
    )
    report: ReportWords | None = Field(
        default=None,
        description="Integer words in which the camera reports its pixels. If omitted, the frame has numbers alone.",
    )

    @model_validator(mode="after")
    def _sensible(self) -> Self:
        refuse_flags(self.report)
        if self.armed_to_m <= self.armed_from_m:
            raise ValueError(f"armed_to_m ({self.armed_to_m:g}) must be beyond armed_from_m ({self.armed_from_m:g})")
        if self.threshold_photons <= 0:
            raise ValueError("the noise is so strong that 95 % detection there is impossible; lower the noise")
        return self

    @property
    def sees_from_m(self) -> float:
        """Least range [m] at which anything is detected."""
        return self.armed_from_m

    @property
    def sees_to_m(self) -> float:
        """Greatest range [m] at which anything is detected."""
        return self.armed_to_m

    @property
    def full_scale_counts(self) -> int:
        """Greatest count that the converter reports."""
        return int(2**self.adc_bits) - 1

    @property
    def saturation_photons(self) -> float:
        """Photons of a return whose counts clip. Infinite where they bend before."""
        over = self.full_scale_counts / self.compression_counts
        if over >= 1.0:
            return math.inf
        return self.full_scale_counts / math.sqrt(math.sqrt(1.0 - over**4)) / self.counts_per_photon

    @cached_property
    def traits(self) -> DetectorTraits:
        """Facts that a scenario reads about this detector."""
        return DetectorTraits(
            sees_to_m=self.sees_to_m,
            threshold_photons=self.threshold_photons,
            sees_from_m=self.sees_from_m,
            saturation_photons=self.saturation_photons,
            window_keys="armed_from_m and armed_to_m",
        )

    @cached_property
    def threshold_photons(self) -> float:
        """Trigger level, in photons [1], that gives 95 % at `reference_photons`."""
        reference = self.reference_photons
        return reference - _NORMAL_95 * float(self.noise_photons(np.array(reference)))

    def noise_photons(self, photons: np.ndarray) -> np.ndarray:
        """Return the standard deviation of the signal of returns [photons]: constant noise and shot noise.

        Parameters
        ----------
        photons : (return) expected photons
        """
        shot = self.excess_noise_factor * photons / self.quantum_efficiency
        noise: np.ndarray = np.sqrt(self.noise_equivalent_photons**2 + shot)
        return noise

    def detection_probability(self, photons: np.ndarray) -> np.ndarray:
        """Return the probability that returns trigger: the normal distribution at signal less threshold, over noise.

        Parameters
        ----------
        photons : (return) expected photons

        Examples
        --------
        >>> round(float(Empirical().detection_probability(np.array(1000.0))), 6)
        0.95
        """
        from scipy.special import ndtr

        probability: np.ndarray = ndtr((photons - self.threshold_photons) / self.noise_photons(photons))
        return probability

    def range_noise_m(self, photons: np.ndarray, pulse_fwhm_s: float) -> np.ndarray:
        """Return the standard deviation [m] of the range of returns, by their expected photons.

        σ² = plateau² + (c/2)² (s² F/(QE N) + 2 s Δt/√π (NEP/N)²), s = FWHM/2.3548. These are the matched filter's shares
        of shot noise and of white amplifier noise: the Cramér-Rao bound of a known Gaussian pulse (docs/instrument.md).

        Parameters
        ----------
        photons : (return) expected photons
        pulse_fwhm_s : length of the laser's pulse [s]
        """
        s = pulse_fwhm_s / units.FWHM_PER_SIGMA
        photons = np.maximum(photons, 1e-9)
        shot = s**2 * self.range_excess_noise_factor / (self.quantum_efficiency * photons)
        relative = self.range_noise_equivalent_photons / photons
        white = 2.0 * s * self.sample_ns * units.NS / math.sqrt(math.pi) * relative**2
        noise: np.ndarray = np.sqrt(self.range_plateau_m**2 + units.RANGE_PER_DELAY_M_S**2 * (shot + white))
        return noise

    def counts(self, photons: np.ndarray) -> np.ndarray:
        """Return the counts of returns before quantisation: linear, then bending, then clipped (Fuller et al., fig. 13).

        Parameters
        ----------
        photons : (return) expected photons
        """
        linear = self.counts_per_photon * np.maximum(photons, 0.0)
        bent = linear / (1.0 + (linear / self.compression_counts) ** 4) ** 0.25
        clipped: np.ndarray = np.minimum(bent, float(self.full_scale_counts))
        return clipped
