"""What makes one pixel differ from the next, and one flash from a clean one; each off by default."""

from dataclasses import dataclass
from typing import Annotated, Self

import numpy as np
from pydantic import Field, model_validator

from rso_lidar import units
from rso_lidar.part import Flag, Fraction, NotNegative, Number, Part, Positive

_GAIN_WITHIN = 1e-6  # a relative error of the gain far below the noise of any frame
_MOST_ROUNDS = 50


class Timing(Part):
    """How well a pixel knows when light arrived: `pixel_jitter_ns` of each pixel and flash, `frame_jitter_ns` of a flash.

    Both are 1 sigma. The default of the first, 0.334 ns or 5 cm, is the plateau that the seed gives for high signals and
    that a matched filter alone would undercut; its cause is assumed.
    """

    pixel_jitter_ns: NotNegative = Field(
        default=0.334,
        description=(
            "Timing jitter of each pixel and flash, 1 sigma [ns]; 0.334 ns is 5 cm of range. Default: Fuller et al., "
            "sec. 3.3 (5 cm, 1 sigma, at sufficient signal); that the cause is jitter of each pixel is assumed."
        ),
    )
    frame_jitter_ns: NotNegative = Field(
        default=0.0, description="Timing jitter common to all pixels of a flash, 1 sigma [ns]. Default: a choice."
    )


class Maps(Part):
    """Fixed patterns of a camera: 1 sigma over its pixels of gain, offset and t0 (raw 5-15 %, few counts, 0.3-1 ns).

    With `calibrated` the reading is corrected by maps measured beforehand, which know each pixel to all but
    `residual_fraction` of its deviation. All figures are assumed.
    """

    gain_spread_fraction: Annotated[float, Field(ge=0.0, le=0.3)] = Field(
        default=0.10, description="Spread of the gain from pixel to pixel, 1 sigma over the mean; assumed."
    )
    offset_spread_counts: NotNegative = Field(
        default=3.0, description="Spread of the baseline from pixel to pixel, 1 sigma [counts]; assumed."
    )
    t0_spread_ns: NotNegative = Field(
        default=0.6, description="Spread of the time origin from pixel to pixel, 1 sigma [ns]; assumed."
    )
    calibrated: Flag = Field(default=False, description="Whether readings are corrected by maps measured beforehand.")
    residual_fraction: Fraction = Field(
        default=0.1, description="Share of each deviation that remains after calibration; assumed."
    )

    @property
    def unknown_fraction(self) -> float:
        """Return the share of each deviation that no calibration takes off."""
        return self.residual_fraction if self.calibrated else 1.0


class Defects(Part):
    """Pixels that never fire (`dead_fraction`) and pixels with a dark current of `hot_dark_current_na`; assumed."""

    dead_fraction: Fraction = Field(default=0.002, description="Share of pixels that never trigger; assumed.")
    hot_fraction: Fraction = Field(default=0.002, description="Share of pixels with a high dark current; assumed.")
    hot_dark_current_na: NotNegative = Field(default=100.0, description="Dark current of a hot pixel [nA]; assumed.")

    @model_validator(mode="after")
    def _no_more_than_all(self) -> Self:
        if self.dead_fraction + self.hot_fraction > 1.0:
            raise ValueError("dead_fraction + hot_fraction is over 1; there are no more pixels than all")
        return self


class Saturation(Part):
    """An amplifier that cannot pass `rail_electrons`, and comes back from there with the time constant `recovery_ns`.

    A pulse that hits the rail is stretched by recovery · ln(overdrive): late centroids, long trailing edges. Assumed.
    """

    rail_electrons: Positive = Field(
        default=600_000.0, description="Highest amplitude that the amplifier can pass [electrons]; assumed."
    )
    recovery_ns: Positive = Field(
        default=4.0, description="Time constant of the recovery from saturation [ns]; assumed."
    )

    def limited(self, amplitude: np.ndarray, step_s: float) -> np.ndarray:
        """Return amplitudes (row, step) [electrons] as the amplifier passes them on."""
        fade = np.float32(np.exp(-step_s / (self.recovery_ns * units.NS)))
        rail = np.float32(self.rail_electrons)
        limited: np.ndarray = np.minimum(amplitude, rail)
        over = np.flatnonzero(amplitude.max(axis=1, initial=0.0) > rail)
        memory = np.zeros(len(over), np.float32)  # what an overdriven stage has still to let go of
        for step in range(amplitude.shape[1]):
            now = amplitude[over, step]
            memory = np.where(now > rail, np.maximum(memory * fade, now), memory * fade)
            limited[over, step] = np.minimum(np.maximum(limited[over, step], memory), rail)
        return limited


class Droop(Part):
    """An APD bias that sags under the photocurrent of the whole array, and with it the gain of every pixel.

    C dV/dt = (V₀ − V)/R − Σ i(t): the sum of the photocurrents loads the bias regulator (M. Seal, Nonlinear time-variant
    response in an avalanche photodiode array based LADAR, thesis, AFIT; it gives no circuit values that could be read). A
    sag of v leaves 1/(1 + `gain_slope_per_v` · v) of the gain. That is M = a/(V_b − V), which the data sheet of the InGaAs
    APDs C30645 and C30662 (Excelitas) states above M = 4 with a = 40 to 50 V, so 0.22 per volt at M = 10; Miller's law
    M = 1/(1 − (V/V_b)ⁿ) has the same form near V_b. C is the junctions' own: 1.25 pF more at 200 µm than at 80 µm (same data
    sheet) is 0.24 pF in a pixel of 80 µm, 4 nF in 128 x 128 of them. That nothing else holds the bias, and R, the output
    resistance of the regulator (a loop of 0.8 MHz with C), are assumed.
    """

    capacitance_nf: Positive = Field(
        default=4.0,
        description=(
            "Capacitance C that holds the APD bias [nF]: the junctions of 128 x 128 pixels, from a data sheet. No "
            "further capacitance is assumed."
        ),
    )
    resistance_ohm: Positive = Field(
        default=50.0, description="Output resistance R of the bias regulator [Ω]; assumed."
    )
    gain_slope_per_v: NotNegative = Field(
        default=0.22,
        description=(
            "Slope of the gain loss [1/V]: a sag of v volts leaves 1/(1 + slope · v) of the gain. From the data sheet "
            "of InGaAs APDs at a gain of 10."
        ),
    )

    def gain(self, electrons: np.ndarray, step_s: float, steady_per_s: float = 0.0) -> np.ndarray:
        """Return the gain (step) relative to rest under the current that pixels draw from the bias supply.

        A lower gain draws less, so sag and gain are solved together. What a step draws is felt from the next one on.

        Parameters
        ----------
        electrons : (step) electrons that all pixels draw in each step at the gain of rest.
        step_s : length of a step [s].
        steady_per_s : electrons that have flowed for long before, at the gain of rest [1/s].
        """
        from scipy.signal import lfilter

        slope, capacitance_f = self.gain_slope_per_v, self.capacitance_nf * units.NF
        keep = np.exp(-step_s / (self.resistance_ohm * capacitance_f))
        drawn_v = electrons * units.ELEMENTARY_CHARGE_C / capacitance_f
        # v (1 + slope v) = I R under a steady current.
        loaded_v = steady_per_s * units.ELEMENTARY_CHARGE_C * self.resistance_ohm
        steady_v = 2.0 * loaded_v / (1.0 + np.sqrt(1.0 + 4.0 * slope * loaded_v))
        sag_v = np.full(np.shape(electrons), steady_v)
        for _ in range(_MOST_ROUNDS):
            gain = 1.0 / (1.0 + slope * sag_v)
            missed_v = steady_v + lfilter([0.0, 1.0], [1.0, -keep], drawn_v * gain) - sag_v
            sag_v += missed_v / (
                1.0 + slope * sag_v * gain
            )  # Newton's step for the case that all current flows at once
            if slope * np.abs(missed_v).max(initial=0.0) < _GAIN_WITHIN:
                break
        found: np.ndarray = 1.0 / (1.0 + slope * sag_v)
        return found


class Crosstalk(Part):
    """Electronic crosstalk between pixels that latch together (simultaneous ranging crosstalk, Opt. Eng. 60(8) 083101).

    Where a share s of the array latches within one clock of a pixel, its range scatters by `noise_m` · s, 1 sigma. The mean
    shift is common to the array, and the camera's calibration takes it off: what is left of it is `offset_m` · (s −
    `calibrated_fraction`), with the share that latched together during calibration (0.5 for a checkerboard, 1 for a wall).

    The paper states a precision of 8.04 cm for a camera of 128 x 128 pixels before a checkerboard, which triggers half of
    them. `noise_m` makes the default camera give that: 5 cm are its `timing`, the rest is taken for crosstalk. How that
    grows with s is not published, and linear by assumption. No mean shift is published either: 0 is a calibrated camera.
    """

    offset_m: Number = Field(
        default=0.0,
        description=(
            "Mean range shift, before calibration, when the whole array triggers within one clock [m]. 0 describes a "
            "calibrated camera."
        ),
    )
    calibrated_fraction: Fraction = Field(
        default=0.0,
        description=(
            "Share of the array that triggered together when the mean shift was calibrated: 0.5 for a checkerboard."
        ),
    )
    noise_m: NotNegative = Field(
        default=0.126,
        description=(
            "Range noise when the whole array triggers within one clock, 1 sigma [m]. Derived from a published "
            "precision of 8.04 cm (Opt. Eng. 60(8) 083101)."
        ),
    )

    def share(self, at_s: np.ndarray, latch_s: np.ndarray, clock_s: float, n_pixels: int) -> np.ndarray:
        """Return the share of the array that latches within one clock of each instant.

        Parameters
        ----------
        at_s : (pixel) instants, such as those at which these pixels latch themselves [s].
        latch_s : (latch) when pixels of the array latched [s].
        clock_s : time between samples [s].
        n_pixels : pixels of the array.
        """
        order = np.sort(latch_s)
        together = np.searchsorted(order, at_s + clock_s, "right") - np.searchsorted(order, at_s - clock_s)
        share: np.ndarray = together / n_pixels
        return share

    def shift_m(self, share: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        """Draw the range error [m] of pixels (pixel), given the share of the array that latches with each."""
        shift: np.ndarray = self.offset_m * (share - self.calibrated_fraction)
        shift += self.noise_m * share * rng.standard_normal(np.shape(share))
        return shift


class Speckle(Part):
    """Coherent light that interferes: the photons of a return vary by a gamma law of M = 1 + A Ω / λ² modes.

    A is the aperture, Ω the lit solid angle in the pixel; a surface that depolarises has twice as many modes.
    """

    depolarising: Flag = Field(
        default=True,
        description="Whether the surface depolarises the light, which doubles the number of speckle modes.",
    )

    def factors(self, coherence_cells: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        """Return the factors, of mean 1, on the photons of clusters with so many coherence cells."""
        modes = (1.0 + coherence_cells) * (2.0 if self.depolarising else 1.0)
        factors: np.ndarray = rng.standard_gamma(modes) / modes
        return factors


@dataclass(frozen=True, eq=False)
class Camera:
    """One camera's pixels (n_pixels): drawn once from its seed, the same in every flash and every run."""

    threshold: np.ndarray  # factor
    gain: np.ndarray  # factor
    offset_counts: np.ndarray
    t0_s: np.ndarray
    dead: np.ndarray  # bool
    hot: np.ndarray  # bool


def camera(n_pixels: int, seed: int, threshold_spread: float, maps: Maps | None, defects: Defects | None) -> Camera:
    """Return the pixels of a camera; each map has its own draws, so that one setting does not move the others."""
    drawn = [np.random.Generator(np.random.Philox(np.random.SeedSequence(seed, spawn_key=(k,)))) for k in range(5)]
    threshold, gain, offset, t0 = (rng.standard_normal(n_pixels) for rng in drawn[:4])
    chance = drawn[4].random(n_pixels)
    none = np.zeros(n_pixels)
    dead = defects.dead_fraction if defects else 0.0
    hot = defects.hot_fraction if defects else 0.0
    return Camera(
        threshold=np.maximum(1.0 + threshold_spread * threshold, 0.2),
        gain=np.maximum(1.0 + maps.gain_spread_fraction * gain, 0.2) if maps else none + 1.0,
        offset_counts=maps.offset_spread_counts * offset if maps else none,
        t0_s=maps.t0_spread_ns * units.NS * t0 if maps else none,
        dead=chance < dead,
        hot=(chance >= dead) & (chance < dead + hot),
    )
