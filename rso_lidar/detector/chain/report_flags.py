"""Flags of reported returns: what the sensor says of its own samples and of its neighbours, and what is true."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from rso_lidar import units
from rso_lidar.detector.ranging.location import Locator
from rso_lidar.detector.settings.focal_plane import AmplitudeCrosstalk
from rso_lidar.detector.stages.neighbour_coupling import list_neighbours
from rso_lidar.kernels import kernel, packed
from rso_lidar.records import Labels, Photons, Reading, Waveforms

_WIDER = 1.2  # times a single pulse: a pulse so wide is of several depths
_SIGMAS = 4.0  # by which noise may widen a pulse: 3e-5 of single pulses, were noise Gaussian
_HALF_SLOPE = math.log(4.0)  # of a Gaussian at half of its height, over height and FWHM
# Pulses farther apart than so many FWHM do not overlap: the sum of two falls below half of its height between them.
_APART_FWHM = 1.5
_MOSTLY = 0.5  # share of an amplitude that the neighbours explain, from which a return is flagged as crosstalk


@dataclass(frozen=True, eq=False)
class Flagger:
    """What a camera knows in order to flag its returns."""

    locator: Locator
    crosstalk: AmplitudeCrosstalk | None

    @cached_property
    def neighbours(self) -> tuple[np.ndarray, np.ndarray]:
        """Offsets (neighbour, row_col) and factors of the neighbours that couple; none without crosstalk."""
        if self.crosstalk is None:
            return np.zeros((0, 2), np.int64), np.zeros(0)
        return list_neighbours(self.crosstalk)

    @cached_property
    def single_width(self) -> float:
        """Greatest width at half height that a single pulse shows between samples, over all phases [samples]."""
        matched = self.locator.matched
        place = matched.half + 2 + (np.arange(64) + 0.5) / 64
        samples = matched.curve(2 * matched.half + 6, place)
        return float(measure_widths(samples, place, np.full(len(place), 0.5)).max())

    def flag(
        self,
        reading: Reading,
        waveforms: Waveforms,
        samples: np.ndarray,
        clipped: np.ndarray,
        range_m: np.ndarray,
        found_s: np.ndarray,
        amplitude: np.ndarray,
    ) -> Reading:
        """Return a reading with the flags `crosstalk` and `superimposed` of its reported returns.

        Parameters
        ----------
        samples : (trace, sample) [counts] above the baseline, calibrated
        clipped : (trace, sample) whether a sample is at a rail
        range_m, found_s, amplitude : (trace, return) range, delay since the first sample [s], and height [counts]
        """
        pixel, shape = waveforms.pixel, reading.range_m.shape
        superimposed = np.zeros(shape, np.uint8)
        reported_m = reading.range_m.ravel()[pixel].astype(float)
        trace = np.flatnonzero(np.isfinite(reported_m))
        if len(trace):
            off_m = np.abs(range_m[trace] - reported_m[trace, None])
            of = np.argmin(np.where(np.isfinite(off_m), off_m, np.inf), axis=1)
            height, delay_s = amplitude[trace, of], found_s[trace, of]
            place = (delay_s + self.locator.matched.pulse.peak_s) / waveforms.sample_s
            width = measure_widths(samples[trace], place, 0.5 * height)
            noise = self.locator.sigma_counts / np.maximum(height, 1e-9)
            limit = self.single_width * (_WIDER + _SIGMAS * math.sqrt(2.0) / _HALF_SLOPE * noise)
            # The width of a clipped pulse tells its height. Other returns of the pixel may clip.
            reach = _APART_FWHM * self.locator.matched.pulse.fwhm_s / waveforms.sample_s
            is_own = np.abs(np.arange(clipped.shape[1]) - place[:, None]) <= reach
            is_wide = (width > limit) & ~(clipped[trace] & is_own).any(axis=1)
            superimposed.ravel()[pixel[trace]] = is_wide
        near_m = self.locator.matched.pulse.fwhm_s * units.RANGE_PER_DELAY_M_S
        explained = np.zeros(shape)
        offset, factor = self.neighbours
        sum_neighbours(
            packed(reading.range_m, np.float32),
            packed(reading.intensity_counts, np.float64),
            packed(offset, np.int64),
            packed(factor, np.float64),
            float(near_m),
            explained,
        )
        crosstalk = (explained > _MOSTLY * reading.intensity_counts).astype(np.uint8)
        return replace(reading, crosstalk=crosstalk, superimposed=superimposed)


def measure_widths(samples: np.ndarray, place: np.ndarray, level: np.ndarray) -> np.ndarray:
    """Return for how long (trace) [samples] a pulse stays above a level about its place, by straight lines.

    A pulse that is cut by an end of its trace has the width that is stored.

    Parameters
    ----------
    samples : (trace, sample)
    place : (trace) of the peak [samples]
    level : (trace) in the unit of the samples
    """
    n = samples.shape[1]
    trace = np.arange(len(samples))
    near = np.clip(np.rint(place)[:, None] + np.arange(-1, 2), 0, n - 1).astype(np.int64)
    top = np.take_along_axis(near, np.argmax(samples[trace[:, None], near], axis=1)[:, None], axis=1)
    below, step = samples < level[:, None], np.arange(n)
    before = np.where(below & (step < top), step, -1).max(axis=1)
    after = np.where(below & (step > top), step, n).min(axis=1)

    def cross(low: np.ndarray, high: np.ndarray) -> np.ndarray:
        """Return where the straight line from a sample below the level to one above it crosses."""
        low, high = np.clip(low, 0, n - 1), np.clip(high, 0, n - 1)
        rise = samples[trace, high] - samples[trace, low]
        share = (level - samples[trace, low]) / np.where(rise == 0.0, 1.0, rise)
        crossing: np.ndarray = low + np.clip(share, 0.0, 1.0) * (high - low)
        return crossing

    width: np.ndarray = cross(after, after - 1) - cross(before, before + 1)
    return width


@kernel
def sum_neighbours(
    range_m: np.ndarray,
    counts: np.ndarray,
    offset: np.ndarray,
    factor: np.ndarray,
    near_m: float,
    explained: np.ndarray,
) -> None:
    """Write the counts that each pixel's neighbours explain: their shares, where they report about the same range.

    Parameters
    ----------
    range_m, counts : (row, col) of the reading
    offset, factor : (neighbour, row_col) and (neighbour)
    near_m : greatest difference of ranges [m]
    explained : (row, col), written
    """
    n_rows, n_cols = range_m.shape
    for row in range(n_rows):
        for col in range(n_cols):
            total = 0.0
            for j in range(len(factor)):
                at_row, at_col = row + offset[j, 0], col + offset[j, 1]
                if at_row < 0 or at_row >= n_rows or at_col < 0 or at_col >= n_cols:
                    continue
                if abs(range_m[at_row, at_col] - range_m[row, col]) <= near_m:  # never of NaN
                    total += factor[j] * counts[at_row, at_col]
            explained[row, col] = total


def label_flags(
    flagger: Flagger,
    labels: Labels,
    photons: Photons,
    reading: Reading,
    *,
    electrons_per_photon: float,
    clip_electrons: float,
    rail_electrons: float,
) -> Labels:
    """Return labels with the true flags of the reported returns, from the expected light about their ranges.

    Parameters
    ----------
    photons : expected light on every pixel
    reading : with the reported ranges
    electrons_per_photon : mean number of electrons after the APD for each photon
    clip_electrons : amplitude from which a return is saturated
    rail_electrons : amplitude that clips in the amplifier; infinite without a rail
    """
    pulse = flagger.locator.matched.pulse
    offset, factor = flagger.neighbours
    per_photon = electrons_per_photon * pulse.peak
    n_pixels = reading.range_m.size
    own, coupled, mean_s, square_s2 = (np.zeros(n_pixels) for _ in range(4))
    sum_near_light(
        packed(np.searchsorted(photons.pixel, np.arange(n_pixels + 1)), np.int64),
        packed(photons.delay_s + photons.late_s, np.float64),
        packed(photons.photons, np.float64),
        packed(photons.depth_spread_s, np.float64),
        packed(reading.range_m.ravel() / units.RANGE_PER_DELAY_M_S, np.float64),
        reading.range_m.shape[1],
        packed(offset, np.int64),
        packed(factor, np.float64),
        rail_electrons / per_photon,
        _APART_FWHM * pulse.fwhm_s,
        (own, coupled, mean_s, square_s2),
    )
    total = own + coupled
    share = np.divide(1.0, total, out=np.zeros(n_pixels), where=total > 0.0)
    variance_s2 = np.maximum(square_s2 * share - (mean_s * share) ** 2, 0.0)
    # Depths add to the variance of a pulse: so much wider it is, and so much lower, as if all were Gaussian.
    wider = np.sqrt(1.0 + variance_s2 * (8.0 * math.log(2.0) / pulse.fwhm_s**2))
    flags = {
        "crosstalk": coupled > own,
        "saturated": total * per_photon / wider >= clip_electrons,
        "superimposed": wider > _WIDER,
    }
    shape = reading.range_m.shape
    return replace(labels, **{name: flag.reshape(shape).astype(np.uint8) for name, flag in flags.items()})


@kernel
def sum_near_light(
    first: np.ndarray,
    delay_s: np.ndarray,
    photons: np.ndarray,
    depth_spread_s: np.ndarray,
    reported_s: np.ndarray,
    n_cols: int,
    offset: np.ndarray,
    factor: np.ndarray,
    most_photons: float,
    near_s: float,
    sums: tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray],
) -> None:
    """Sum the light about each reported delay: the pixel's own, and the shares of its neighbours.

    Parameters
    ----------
    first : (pixel + 1) first return of each pixel
    delay_s, photons, depth_spread_s : (return) those of `Photons`
    reported_s : (pixel) reported delay [s], NaN where none
    n_cols : columns of the array
    offset, factor : (neighbour, row_col) and (neighbour)
    most_photons : of a neighbour, that its rail lets pass
    near_s : greatest difference of delays [s]
    sums : (pixel) own photons, coupled photons, and their delays after the report [s] and squares of these [s²], written
    """
    own, coupled, mean_s, square_s2 = sums
    n_rows = len(reported_s) // n_cols
    for pixel in range(len(reported_s)):
        if not np.isfinite(reported_s[pixel]):
            continue
        row, col = pixel // n_cols, pixel % n_cols
        for j in range(-1, len(factor)):
            at_row, at_col, share = row, col, 1.0
            if j >= 0:
                at_row, at_col, share = row + offset[j, 0], col + offset[j, 1], factor[j]
            if at_row < 0 or at_row >= n_rows or at_col < 0 or at_col >= n_cols:
                continue
            light, delays, squares = 0.0, 0.0, 0.0
            for k in range(first[at_row * n_cols + at_col], first[at_row * n_cols + at_col + 1]):
                after_s = delay_s[k] - reported_s[pixel]
                if abs(after_s) <= near_s:
                    light += photons[k]
                    delays += photons[k] * after_s
                    squares += photons[k] * (after_s * after_s + depth_spread_s[k] * depth_spread_s[k] / 12.0)
            if light > most_photons and j >= 0:
                share *= most_photons / light
            if j < 0:
                own[pixel] = light
            else:
                coupled[pixel] += share * light
            mean_s[pixel] += share * delays
            square_s2[pixel] += share * squares
