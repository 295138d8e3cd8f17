"""The analog end of the chain: photons become primaries, electrons and the amplifier's output."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from rso_lidar.detector.chain.timing import TimeAxis
from rso_lidar.detector.settings.focal_plane import AmplitudeCrosstalk, Droop, Saturation, Speckle
from rso_lidar.detector.stages.amplification import amplify
from rso_lidar.detector.stages.array_effects import draw_speckle, limit_amplitude, solve_gain
from rso_lidar.detector.stages.avalanche import Avalanche, multiply
from rso_lidar.detector.stages.convolution import convolve_light
from rso_lidar.detector.stages.light import spread_light
from rso_lidar.detector.stages.neighbour_coupling import NeighbourCoupling
from rso_lidar.detector.stages.nonuniformity import CameraPixels
from rso_lidar.detector.stages.overlap import Overlap, split_rows
from rso_lidar.detector.stages.row_noise import AMPLIFIER, RowNoise
from rso_lidar.detector.stages.time_axis import Rows
from rso_lidar.parallel import run_in_threads
from rso_lidar.records import Photons

# Fewer expected photoelectrons in a step are the transform's rounding, or a negligible tail.
_LEAST_PRIMARIES = np.float32(1e-4)
_ROWS_AT_ONCE = 1024  # a block fits in the cache, and a frame has blocks for several threads


@dataclass(frozen=True, eq=False)
class FrontEnd:
    """Photodiodes and amplifiers of all pixels, None for effects that are off."""

    pixels: CameraPixels
    quantum_efficiency: float
    avalanche: Avalanche
    speckle: Speckle | None
    droop: Droop | None
    saturation: Saturation | None
    amplitude_crosstalk: AmplitudeCrosstalk | None
    has_gain_map: bool  # whether the gain differs from pixel to pixel
    has_timing_channel: bool

    def base_rate_per_s(self, photons: Photons) -> np.ndarray:
        """Return the primaries of each pixel that no pulse makes [1/s]: dark current and sunlight."""
        if photons.background_photons_per_s is None:
            return self.pixels.dark_per_s
        sunlight = self.quantum_efficiency * photons.background_photons_per_s.ravel()
        rate: np.ndarray = self.pixels.dark_per_s + sunlight
        return rate

    def background_electrons_per_s(self, photons: Photons) -> float:
        """Return the electrons of sunlight that the whole array draws [1/s]."""
        if photons.background_photons_per_s is None:
            return 0.0
        return float(photons.background_photons_per_s.sum()) * self.quantum_efficiency * self.avalanche.apd.gain

    def select(self, pixel: np.ndarray) -> FrontEnd:
        """Return that of some pixels, or of the same ones several times."""
        return replace(self, pixels=self.pixels.select(pixel))


@dataclass(frozen=True, eq=False)
class Still:
    """Signal and shot noise of rows before an amplifier adds noise of its own; arrays (row, step), gain (row)."""

    mean: np.ndarray  # behind the amplifier, at the gain of rest [electrons]
    excess: np.ndarray  # electrons over their mean, before the amplifier
    gain: np.ndarray  # of the row's pixel, factor of both


@dataclass(frozen=True, eq=False)
class Analog:
    """The amplifier's output about the returns, with what led to it; arrays (row, step), rates per step."""

    rows: Rows
    light: np.ndarray  # expected photons, each return a flash of no length
    primaries: np.ndarray  # expected photoelectrons of the signal
    electrons: np.ndarray  # drawn, after the APD; dark current and background included
    amplitude: np.ndarray  # electrons above the baseline, after the amplifier
    transfer: np.ndarray  # what light is multiplied by, transformed along time, to be the mean of amplitude
    gain: np.ndarray | None = None  # relative to the nominal gain: bias droop, gain of the pixels
    still: Still | None = None  # kept for a timing channel
    coupling: NeighbourCoupling | None = None  # of the amplitudes, where there is crosstalk

    def mean(self, rows: np.ndarray | slice = slice(None)) -> np.ndarray:
        """Return the amplitude (row, step) [electrons] of some rows without noise."""
        from scipy.fft import irfft, rfft

        if self.coupling is None:
            light = self.light[rows] if self.gain is None else self.light[rows] * self.gain[rows]
        else:
            every = self.light if self.gain is None else self.light * self.gain
            light = self.coupling.add(every, np.arange(len(every))[rows])
        mean: np.ndarray = irfft(rfft(light, axis=1) * self.transfer, self.rows.length, axis=1)
        return mean


def draw_speckle_factors(speckle: Speckle | None, photons: Photons, rng: np.random.Generator) -> np.ndarray | None:
    """Return the random factors (return) of speckle on the photons, one for each cluster; None without speckle."""
    if speckle is None or not len(photons.pixel):
        return None
    cells = np.bincount(photons.cluster, photons.coherence_cells, len(photons.cluster_pixel))
    factors: np.ndarray = draw_speckle(speckle, cells, rng)[photons.cluster]
    return factors


def simulate_analog(
    front: FrontEnd,
    axis: TimeAxis,
    photons: Photons,
    rows: Rows,
    rng: np.random.Generator | None,
    threads: int | None = 1,
) -> Analog:
    """Simulate the amplifier's output over the rows; without a generator its mean, free of noise."""
    n, gain, step_s = rows.length, np.float32(front.avalanche.apd.gain), axis.step_s
    factors = draw_speckle_factors(front.speckle, photons, rng) if rng else None
    n_rows = len(rows.pixel)
    light, primaries, quiet, excess, electrons, amplitude = (np.empty((n_rows, n), np.float32) for _ in range(6))
    base = (front.base_rate_per_s(photons) * step_s).astype(np.float32)[rows.pixel]
    common = float(base.min(initial=np.inf)) if len(base) else 0.0
    pixel_gain = front.pixels.gain[rows.pixel].astype(np.float32)

    overlap = Overlap.of(rows)
    noise = None if rng is None else RowNoise.of(rows, rng)
    blocks = split_rows(rows, _ROWS_AT_ONCE)

    def amplify_block(block: slice, noise: RowNoise) -> None:
        words = noise.select(block).draw(AMPLIFIER, 1, n)[0]
        overlap.select(block).carry(words)
        amplify(axis.amplifier, quiet[block], excess[block], pixel_gain[block], words, amplitude[block])

    def simulate_block(block: slice) -> None:
        """Write the mean behind the amplifier, and the excess of the electrons before it, both at the gain of rest."""
        light[block] = spread_light(photons, rows.select(block), step_s, factors)
        convolve_light(light[block], axis.light, _LEAST_PRIMARIES, primaries[block], quiet[block])
        if noise is None:
            np.multiply(quiet[block], pixel_gain[block, None], out=amplitude[block])
            return
        block_overlap = overlap.select(block)
        block_overlap.carry(primaries[block])
        expected = np.add(primaries[block], base[block, None], out=excess[block])
        electrons[block] = multiply(expected, front.avalanche, noise.select(block), base=common)
        block_overlap.carry(electrons[block])
        expected *= -gain
        expected += electrons[block]
        if front.droop is None:  # under a droop the whole array decides the gain
            amplify_block(block, noise)

    run_in_threads(threads, simulate_block, blocks)
    relative = None
    if front.has_gain_map:
        relative = pixel_gain[:, None]
    if front.droop is not None and noise is not None:
        steady_per_s = front.background_electrons_per_s(photons)
        drawn = electrons - gain * base[:, None]
        sag = solve_drooped_gain(front.droop, rows, drawn, steady_per_s, step_s) - np.float32(1.0)
        relative = (sag + np.float32(1.0)) * (np.float32(1.0) if relative is None else relative)
        excess += electrons * sag
        for block in blocks:
            amplify_block(block, noise)
    if rng is None:
        electrons = gain * primaries
    if front.saturation is not None:
        amplitude = limit_amplitude(front.saturation, amplitude, step_s)
    coupling = None
    if front.amplitude_crosstalk is not None:
        coupling = NeighbourCoupling.of(front.amplitude_crosstalk, rows, photons.shape)
        amplitude = coupling.add(amplitude, np.arange(n_rows), threads)
        if front.saturation is not None:
            np.minimum(amplitude, np.float32(front.saturation.rail_electrons), out=amplitude)
    still = Still(quiet, excess, pixel_gain) if front.has_timing_channel and noise is not None else None
    return Analog(rows, light, primaries, electrons, amplitude, axis.light.amplified, relative, still, coupling)


def solve_drooped_gain(
    droop: Droop, rows: Rows, electrons: np.ndarray, steady_per_s: float, step_s: float
) -> np.ndarray:
    """Return the gain (row, step) relative to rest in the dark, while the whole array draws on the bias supply.

    Steady sunlight has sagged it before the flash, and the dark current belongs to rest: neither counts among the electrons
    of the flash. Rows of a pixel that overlap in time hold the same light once.

    Parameters
    ----------
    rows : stretches of time of the lit pixels
    electrons : (row, step) electrons drawn at the gain of rest, less the mean of dark current and sunlight
    steady_per_s : electrons of sunlight on the whole array [1/s]
    """
    if not len(rows.pixel):
        return electrons
    begin = int(rows.start.min())
    place = (rows.start - begin)[:, None] + np.arange(rows.length)
    is_same_pixel = np.diff(rows.pixel, prepend=-1) == 0
    covered = np.where(is_same_pixel, np.roll(rows.start, 1) + rows.length - begin, 0)
    drawn = np.where(place >= covered[:, None], electrons, np.float32(0.0))
    span = int(place.max()) + 1
    if span > 2**24:  # far-apart returns: the supply recovers between them
        begins, place = np.unique(place, return_inverse=True)
        place, span = place.reshape(electrons.shape), len(begins)
    current = np.bincount(place.ravel(), drawn.ravel(), span)
    gain: np.ndarray = solve_gain(droop, current, step_s, steady_per_s).astype(np.float32)[place]
    return gain
