"""The analog end of the chain: photons become primaries, electrons and the amplifier's output."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from rso_lidar.detector.settings.focal_plane import Droop, Speckle
from rso_lidar.detector.settings.gsfl import Gsfl
from rso_lidar.detector.stages.amplification import Filters, amplify, build_filters
from rso_lidar.detector.stages.array_effects import draw_speckle, limit_amplitude, solve_gain
from rso_lidar.detector.stages.avalanche import multiply
from rso_lidar.detector.stages.convolution import PulseFilters, convolve_light, transform_pulse
from rso_lidar.detector.stages.light import spread_light
from rso_lidar.detector.stages.nonuniformity import CameraPixels
from rso_lidar.detector.stages.overlap import Overlap, split_rows
from rso_lidar.detector.stages.row_noise import AMPLIFIER, RowNoise
from rso_lidar.detector.stages.time_axis import Rows, SamplingPlan
from rso_lidar.parallel import run_in_threads
from rso_lidar.records import Photons

# Fewer expected photoelectrons in a step are the transform's rounding, or a negligible tail.
_LEAST_PRIMARIES = np.float32(1e-4)
_ROWS_AT_ONCE = 1024  # a block fits in the cache, and a frame has blocks for several threads


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

    def mean(self, rows: np.ndarray | slice = slice(None)) -> np.ndarray:
        """Return the amplitude (row, step) [electrons] of some rows without noise."""
        from scipy.fft import irfft, rfft

        light = self.light[rows] if self.gain is None else self.light[rows] * self.gain[rows]
        mean: np.ndarray = irfft(rfft(light, axis=1) * self.transfer, self.rows.length, axis=1)
        return mean


def base_rate_per_s(quantum_efficiency: float, camera: CameraPixels, photons: Photons) -> np.ndarray:
    """Return the primaries of each pixel that no pulse makes [1/s]: dark current and sunlight.

    Parameters
    ----------
    quantum_efficiency : photoelectrons for each photon.
    camera : the pixels, with their dark current.
    photons : the light, with its background.
    """
    if photons.background_photons_per_s is None:
        return camera.dark_per_s
    rate: np.ndarray = camera.dark_per_s + quantum_efficiency * photons.background_photons_per_s.ravel()
    return rate


def background_electrons_per_s(gsfl: Gsfl, photons: Photons) -> float:
    """Return the electrons of sunlight that the whole array draws [1/s]."""
    if photons.background_photons_per_s is None:
        return 0.0
    return float(photons.background_photons_per_s.sum()) * gsfl.quantum_efficiency * gsfl.apd.gain


def draw_speckle_factors(speckle: Speckle | None, photons: Photons, rng: np.random.Generator) -> np.ndarray | None:
    """Return the random factors (return) of speckle on the photons, one for each cluster; None without speckle.

    Parameters
    ----------
    speckle : its settings; None for light without speckle.
    photons : light on every pixel, in clusters.
    rng : random generator.
    """
    if speckle is None or not len(photons.pixel):
        return None
    cells = np.bincount(photons.cluster, photons.coherence_cells, len(photons.cluster_pixel))
    factors: np.ndarray = draw_speckle(speckle, cells, rng)[photons.cluster]
    return factors


def simulate_analog(
    gsfl: Gsfl,
    photons: Photons,
    rows: Rows,
    plan: SamplingPlan,
    camera: CameraPixels,
    rng: np.random.Generator | None,
    threads: int | None = 1,
) -> Analog:
    """Simulate the amplifier's output over the rows.

    Parameters
    ----------
    gsfl : the detector.
    photons : light on every pixel.
    rows, plan : stretches of time, and the axis of time.
    camera : the pixels.
    rng : random generator (None: the mean of the output, free of noise).
    threads : number of threads (None: one for each core). The result is the same to the bit.

    Returns
    -------
    amplitudes over the rows, with what the comparator needs.
    """
    n, gain = rows.length, np.float32(gsfl.apd.gain)
    amplifier = build_filters(gsfl.amplifier, n, plan.step_s)
    factors = draw_speckle_factors(gsfl.speckle, photons, rng) if rng else None
    filters = _pulse_filters(
        amplifier,
        gsfl.quantum_efficiency,
        gsfl.apd.gain,
        photons.pulse_step_s,
        photons.pulse_power_per_s.tobytes(),
    )
    n_rows = len(rows.pixel)
    light, primaries, quiet, excess, electrons, amplitude = (np.empty((n_rows, n), np.float32) for _ in range(6))
    base = (base_rate_per_s(gsfl.quantum_efficiency, camera, photons) * plan.step_s).astype(np.float32)[rows.pixel]
    common = float(base.min(initial=np.inf)) if len(base) else 0.0
    pixel_gain = camera.gain[rows.pixel].astype(np.float32)

    overlap = Overlap.of(rows)
    noise = None if rng is None else RowNoise.of(rows, rng)
    blocks = split_rows(rows, _ROWS_AT_ONCE)

    def amplify_block(block: slice, noise: RowNoise) -> None:
        words = noise.select(block).draw(AMPLIFIER, 1, n)[0]
        overlap.select(block).carry(words)
        amplify(amplifier, quiet[block], excess[block], pixel_gain[block], words, amplitude[block])

    def simulate_block(block: slice) -> None:
        """Write the mean behind the amplifier, and the excess of the electrons before it, both at the gain of rest."""
        light[block] = spread_light(photons, rows.select(block), plan.step_s, factors)
        convolve_light(light[block], filters, _LEAST_PRIMARIES, primaries[block], quiet[block])
        if noise is None:
            np.multiply(quiet[block], pixel_gain[block, None], out=amplitude[block])
            return
        block_overlap = overlap.select(block)
        block_overlap.carry(primaries[block])
        expected = np.add(primaries[block], base[block, None], out=excess[block])
        electrons[block] = multiply(expected, gsfl.apd, noise.select(block), base=common)
        block_overlap.carry(electrons[block])
        expected *= -gain
        expected += electrons[block]
        if gsfl.droop is None:  # under a droop the whole array decides the gain
            amplify_block(block, noise)

    run_in_threads(threads, simulate_block, blocks)
    relative = None
    if gsfl.maps is not None:
        relative = pixel_gain[:, None]
    if gsfl.droop is not None and noise is not None:
        steady = np.float32(gsfl.apd.gain) * base[:, None]
        steady_per_s = background_electrons_per_s(gsfl, photons)
        sag = solve_drooped_gain(gsfl.droop, rows, electrons - steady, steady_per_s, plan.step_s) - np.float32(1.0)
        relative = (sag + np.float32(1.0)) * (np.float32(1.0) if relative is None else relative)
        excess += electrons * sag
        for block in blocks:
            amplify_block(block, noise)
    if rng is None:
        electrons = gain * primaries
    if gsfl.saturation is not None:
        amplitude = limit_amplitude(gsfl.saturation, amplitude, plan.step_s)
    still = None if gsfl.zero_crossing is None or noise is None else Still(quiet, excess, pixel_gain)
    return Analog(rows, light, primaries, electrons, amplitude, filters.amplified, relative, still)


@lru_cache(maxsize=16)
def _pulse_filters(
    amplifier: Filters, efficiency: float, gain: float, pulse_step_s: float, power_per_s: bytes
) -> PulseFilters:
    """Return the filters from light to primaries, and on to the amplitude, kept.

    Parameters
    ----------
    amplifier : over the steps of a row.
    efficiency, gain : quantum efficiency, and mean gain of the APD.
    pulse_step_s, power_per_s : taps of the laser's pulse, the second as bytes.
    """
    pulse = efficiency * transform_pulse(pulse_step_s, np.frombuffer(power_per_s), amplifier.n, amplifier.step_s)
    return PulseFilters.of(pulse, gain * pulse * amplifier.mean, amplifier.n)


def solve_drooped_gain(
    droop: Droop, rows: Rows, electrons: np.ndarray, steady_per_s: float, step_s: float
) -> np.ndarray:
    """Return the gain (row, step) relative to rest in the dark, while the whole array draws on the bias supply.

    Steady sunlight has sagged it before the flash, and the dark current belongs to rest: neither counts among the electrons
    of the flash. Rows of a pixel that overlap in time hold the same light once.

    Parameters
    ----------
    droop : the bias supply.
    rows : stretches of time of the lit pixels.
    electrons : (row, step) electrons drawn at the gain of rest, less the mean of dark current and sunlight.
    steady_per_s : electrons of sunlight on the whole array [1/s].
    step_s : length of a step [s].
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
