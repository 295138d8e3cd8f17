"""What makes one pixel differ from the next, and one flash from a clean one; each off by default."""

from dataclasses import dataclass
from typing import Annotated, Self

import numpy as np
from pydantic import Field, model_validator

from rso_lidar import units
from rso_lidar.part import Flag, Fraction, NotNegative, Number, Part, Positive


class Timing(Part):
    """How well a pixel knows when light arrived: `pixel_jitter_ns` of each pixel and flash, `frame_jitter_ns` of a flash.

    Both are 1 sigma. The default of the first, 0.334 ns or 5 cm, is the plateau that the seed gives for high signals and
    that a matched filter alone would undercut; its cause is assumed.
    """

    pixel_jitter_ns: NotNegative = 0.334
    frame_jitter_ns: NotNegative = 0.0


class Maps(Part):
    """Fixed patterns of a camera: 1 sigma over its pixels of gain, offset and t0 (raw 5-15 %, few counts, 0.3-1 ns).

    With `calibrated` the reading is corrected by maps measured beforehand, which know each pixel to all but
    `residual_fraction` of its deviation. All figures are assumed.
    """

    gain_spread_fraction: Annotated[float, Field(ge=0.0, le=0.3)] = 0.10
    offset_spread_counts: NotNegative = 3.0
    t0_spread_ns: NotNegative = 0.6
    calibrated: Flag = False
    residual_fraction: Fraction = 0.1

    @property
    def unknown_fraction(self) -> float:
        """Return the share of each deviation that no calibration takes off."""
        return self.residual_fraction if self.calibrated else 1.0


class Defects(Part):
    """Pixels that never fire (`dead_fraction`) and pixels with a dark current of `hot_dark_current_na`; assumed."""

    dead_fraction: Fraction = 0.002
    hot_fraction: Fraction = 0.002
    hot_dark_current_na: NotNegative = 100.0

    @model_validator(mode="after")
    def _no_more_than_all(self) -> Self:
        if self.dead_fraction + self.hot_fraction > 1.0:
            raise ValueError("dead_fraction + hot_fraction is over 1; there are no more pixels than all")
        return self


class Saturation(Part):
    """An amplifier that cannot pass `rail_electrons`, and comes back from there with the time constant `recovery_ns`.

    A pulse that hits the rail is stretched by recovery · ln(overdrive): late centroids, long trailing edges. Assumed.
    """

    rail_electrons: Positive = 600_000.0
    recovery_ns: Positive = 4.0

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
    """The APD bias sags under the photocurrent of the whole array, and with it the gain of every pixel (Seal, AFIT).

    C dV/dt = (V₀ − V)/R − Σ i(t); the gain falls by `gain_slope_per_v` for each volt. All values are assumed.
    """

    capacitance_nf: Positive = 10.0
    resistance_ohm: Positive = 1000.0
    gain_slope_per_v: NotNegative = 0.05

    def gain(self, electrons: np.ndarray, step_s: float, steady_per_s: float = 0.0) -> np.ndarray:
        """Return the gain (step) relative to rest, while `electrons` (step) leave the bias supply in each step.

        What a step draws is felt from the next one on; `steady_per_s` [electrons/s] have flowed for long before. The gain
        does not fall below 0.
        """
        from scipy.signal import lfilter

        capacitance_f = self.capacitance_nf * units.NF
        keep = np.exp(-step_s / (self.resistance_ohm * capacitance_f))
        drawn_v = electrons * units.ELEMENTARY_CHARGE_C / capacitance_f
        sag_v = lfilter([0.0, 1.0], [1.0, -keep], drawn_v)
        sag_v = sag_v + steady_per_s * units.ELEMENTARY_CHARGE_C * self.resistance_ohm
        gain: np.ndarray = np.maximum(1.0 - self.gain_slope_per_v * sag_v, 0.0)
        return gain


class Crosstalk(Part):
    """Pixels that latch together disturb each other (simultaneous ranging, Opt. Eng. 60(8) 083101).

    Where a share s of the array latches within one clock of a pixel, its range moves by `offset_m` · s and scatters by
    `noise_m` · s. Both figures are assumed.
    """

    offset_m: Number = 0.3
    noise_m: NotNegative = 0.3

    def shift_m(self, latch_s: np.ndarray, clock_s: float, n_pixels: int, rng: np.random.Generator) -> np.ndarray:
        """Return the error of range [m] of pixels that latched at `latch_s` (trace), of an array of `n_pixels`."""
        order = np.sort(latch_s)
        together = np.searchsorted(order, latch_s + clock_s, "right") - np.searchsorted(order, latch_s - clock_s)
        share = together / n_pixels
        shift: np.ndarray = share * (self.offset_m + self.noise_m * rng.standard_normal(len(latch_s)))
        return shift


class Speckle(Part):
    """Coherent light that interferes: the photons of a return vary by a gamma law of M = 1 + A Ω / λ² modes.

    A is the aperture, Ω the lit solid angle in the pixel; a surface that depolarises has twice as many modes.
    """

    depolarising: Flag = True

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
