"""Histograms of photon times: avalanches of every pixel and pulse, and the peak that they form.

Avalanches are an inhomogeneous Poisson process while a pixel is alive. The next one comes where the integral of the rate has
grown by an exponential draw since the pixel became alive. So first-photon bias and dead-time loss follow by themselves.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from rso_lidar.detector.geiger.array import GeigerArray
from rso_lidar.kernels import kernel, packed
from rso_lidar.parallel import run_in_threads
from rso_lidar.philox import draw_block, draw_key
from rso_lidar.records import Photons

_PER_PULSE = 16  # steps of time in a pulse's length, at least
_BAND = 128  # pixels that one thread takes at a time
_WORDS = 2.0**32
_STAGE = 0  # of the words' address


@dataclass(frozen=True, eq=False)
class PhotonPeaks:
    """Highest peaks of the histograms of one frame; arrays (pixel).

    Parameters
    ----------
    delay_s : centroid of the peak, two-way delay since emission [s]; NaN where nothing was counted
    counts : in the peak
    total_counts : in the whole histogram
    """

    delay_s: np.ndarray
    counts: np.ndarray
    total_counts: np.ndarray


def count_photons(
    array: GeigerArray, photons: Photons, rng: np.random.Generator, threads: int | None = 1
) -> PhotonPeaks:
    """Count and time the photons of one frame in all its pulses: time and counts of the highest peak of each pixel."""
    n_pixels = photons.shape[0] * photons.shape[1]
    sunlight = photons.background_photons_per_s
    noise_per_s = array.noise_per_s(np.zeros(n_pixels) if sunlight is None else sunlight.ravel())
    step_s = photons.pulse_step_s
    energy = np.concatenate([[0.0], np.cumsum(photons.pulse_power_per_s)]) * step_s
    energy /= energy[-1]
    summed = np.concatenate([[0.0], np.cumsum(0.5 * (energy[1:] + energy[:-1]))]) * step_s
    delay_s, counts, total = np.empty(n_pixels), np.empty(n_pixels, np.int64), np.empty(n_pixels, np.int64)
    pulse_epoch, pulse_energy, pulse_late_s = photons.list_pulses(array.pulses)
    pulses_at = np.bincount(pulse_epoch)
    epoch = np.zeros(len(photons.pixel), np.int64) if photons.epoch is None else photons.epoch
    place = photons.pixel * np.int64(len(pulses_at)) + epoch
    given = (
        draw_key(rng),
        (packed(pulse_epoch, np.int64), packed(pulse_energy, np.float64), packed(pulse_late_s, np.float64)),
        (array.opens_s, array.gate_s, array.bin_s, array.hold_off_s, array.jitter_ns * 1e-9),
        (array.afterpulse_probability, array.afterpulse_time_ns * 1e-9),
        (array.n_bins, array.peak_bins),
        packed(noise_per_s, np.float64),
        packed(np.searchsorted(place, np.arange(n_pixels * len(pulses_at) + 1)), np.int64),
        packed(photons.delay_s + photons.late_s, np.float64),
        packed(photons.photons * (array.pulses / pulses_at)[epoch] * array.detection_efficiency, np.float64),
        packed(photons.depth_spread_s, np.float64),
        (-(len(photons.pulse_power_per_s) // 2 + 0.5) * step_s, step_s),
        packed(energy, np.float64),
        packed(summed, np.float64),
        min(array.bin_s, photons.pulse_fwhm_s / _PER_PULSE),
        (delay_s, counts, total),
    )
    run_in_threads(
        threads, lambda first: _count(first, min(first + _BAND, n_pixels), *given), range(0, n_pixels, _BAND)
    )
    return PhotonPeaks(delay_s, counts, total)


@kernel
def _count(
    first: int,
    end: int,
    key: np.ndarray,
    pulses: tuple[np.ndarray, np.ndarray, np.ndarray],
    times: tuple[float, float, float, float, float],
    afterpulse: tuple[float, float],
    bins: tuple[int, int],
    noise_per_s: np.ndarray,
    start: np.ndarray,
    delay_s: np.ndarray,
    primaries: np.ndarray,
    depth_s: np.ndarray,
    pulse: tuple[float, float],
    energy: np.ndarray,
    summed: np.ndarray,
    step_s: float,
    peaks: tuple[np.ndarray, np.ndarray, np.ndarray],
) -> None:
    """Fill the histograms of a band of pixels and find their peaks.

    Parameters
    ----------
    key : (2) uint32 of the frame
    pulses : (pulse) epoch of the exposure, energy over the mean, and delay beyond the mean [s], of each
    times : opening of the gate, its length, bin, hold-off and jitter [s]
    afterpulse : probability, and mean time after the hold-off [s]
    noise_per_s : (pixel) rate of avalanches not due to the laser [1/s]
    start : (pixel, epoch, and 1 more) first return of each pixel at each epoch
    delay_s, primaries, depth_s : (return) delay, mean avalanches, and time over which its surface stretches it
    pulse : first edge of the pulse's taps and their step [s]
    energy, summed : (edge) share of the pulse's energy before each edge of its taps, and its integral [s]
    peaks : delay, peak counts and total counts (pixel), written
    """
    opens_s, gate_s, bin_s, hold_off_s, jitter_s = times
    n_bins, peak_bins = bins
    pulse_epoch, pulse_energy, pulse_late_s = pulses
    n_epochs, latest_s = np.max(pulse_epoch) + 1, np.max(np.abs(pulse_late_s))
    histogram, touched = np.zeros(n_bins, np.int64), np.empty(n_bins, np.int64)
    light = np.zeros(int((gate_s + 2.0 * latest_s) / step_s) + 3)
    integral = np.zeros(len(light))
    for pixel in range(first, end):
        rate = noise_per_s[pixel]
        n_touched, total = 0, 0
        n, light_s = 0, 0.0
        for number in range(len(pulse_epoch)):
            is_first = number == 0 or pulse_epoch[number] != pulse_epoch[number - 1]
            if is_first:
                row = pixel * n_epochs + pulse_epoch[number]
                some = slice(start[row], start[row + 1])
                light_s, n = _integrate(
                    delay_s[some] - opens_s,
                    primaries[some],
                    depth_s[some],
                    pulse,
                    energy,
                    summed,
                    step_s,
                    (-latest_s, gate_s + latest_s),
                    light,
                )
            from_s = light_s + pulse_late_s[number]
            if is_first or latest_s > 0.0 or pulse_energy[number] != pulse_energy[number - 1]:
                for k in range(n):
                    integral[k] = pulse_energy[number] * light[k] + rate * (from_s + k * step_s)
            alive_s, step = 0.0, 0
            waiting_s = math.inf  # until an afterpulse
            while alive_s < gate_s:
                words = draw_block(key, step, number, pixel, _STAGE)
                step += 1
                before = _integral_at(alive_s, rate, integral, n, from_s, step_s)
                wait = -math.log((words[0] + 0.5) / _WORDS)
                at_s = min(_time_of(before + wait, rate, integral, n, from_s, step_s), waiting_s)
                if at_s >= gate_s:
                    break
                chance = (words[1] + 0.5) / _WORDS
                alive_s = at_s + hold_off_s
                waiting_s = math.inf
                if chance < afterpulse[0]:
                    waiting_s = alive_s - afterpulse[1] * math.log(chance / afterpulse[0])
                if jitter_s > 0.0:
                    radius = math.sqrt(-2.0 * math.log((words[2] + 0.5) / _WORDS))
                    at_s += jitter_s * radius * math.cos(2.0 * math.pi * words[3] / _WORDS)
                place = math.floor(at_s / bin_s)
                if place < 0 or place >= n_bins:
                    continue
                if histogram[place] == 0:
                    touched[n_touched] = place
                    n_touched += 1
                histogram[place] += 1
                total += 1
        centre, most = _peak(histogram, touched[:n_touched], peak_bins)
        for k in range(n_touched):
            histogram[touched[k]] = 0
        peaks[0][pixel] = opens_s + (centre + 0.5) * bin_s
        peaks[1][pixel] = most
        peaks[2][pixel] = total


@kernel
def _integrate(
    delay_s: np.ndarray,
    primaries: np.ndarray,
    depth_s: np.ndarray,
    pulse: tuple[float, float],
    energy: np.ndarray,
    summed: np.ndarray,
    step_s: float,
    window_s: tuple[float, float],
    integral: np.ndarray,
) -> Any:
    """Write the integral of the laser's rate over the time in which a pixel's returns come.

    Parameters
    ----------
    delay_s, primaries, depth_s : (return) delays after the opening [s], mean avalanches, and stretch [s]
    pulse, energy, summed : the pulse, as for `_count`
    step_s, window_s : step of the integral; begin and end of the gate, widened by the jitter of emission [s]
    integral : (step) written

    Returns
    -------
    Time of the first value after the opening [s], and the number of values: a tuple.
    """
    first_s, last_s = math.inf, -math.inf
    length_s = (len(energy) - 1) * pulse[1]
    for k in range(len(delay_s)):
        if primaries[k] > 0.0:
            edge_s = delay_s[k] + pulse[0] - 0.5 * depth_s[k]
            first_s = min(first_s, edge_s)
            last_s = max(last_s, edge_s + length_s + depth_s[k])
    first_s, last_s = max(first_s, window_s[0]), min(last_s, window_s[1])
    if last_s <= first_s:
        return 0.0, 0
    n = min(math.ceil((last_s - first_s) / step_s) + 1, len(integral))
    integral[:n] = 0.0
    for k in range(len(delay_s)):
        if primaries[k] <= 0.0:
            continue
        edge_s = delay_s[k] + pulse[0] - 0.5 * depth_s[k]
        begin = max(0, math.floor((edge_s - first_s) / step_s))
        before = _share(first_s + begin * step_s - delay_s[k], depth_s[k], pulse, energy, summed)
        for i in range(begin + 1, n):
            after = _share(first_s + i * step_s - delay_s[k], depth_s[k], pulse, energy, summed)
            integral[i] += primaries[k] * (after - before)
            before = after
            if first_s + i * step_s > edge_s + length_s + depth_s[k]:
                break
    for i in range(1, n):
        integral[i] += integral[i - 1]
    return first_s, n


@kernel
def _share(at_s: float, depth_s: float, pulse: tuple[float, float], energy: np.ndarray, summed: np.ndarray) -> float:
    """Return the share of a return's energy that has come at a time after its delay.

    Parameters
    ----------
    at_s, depth_s : the time, and the time over which the surface stretches the pulse evenly [s]
    pulse, energy, summed : the pulse, as for `_count`
    """
    if depth_s < pulse[1]:
        return _look_up(at_s, pulse, energy, 0.0)
    late = _look_up(at_s + 0.5 * depth_s, pulse, summed, 1.0)
    return (late - _look_up(at_s - 0.5 * depth_s, pulse, summed, 1.0)) / depth_s


@kernel
def _look_up(at_s: float, pulse: tuple[float, float], table: np.ndarray, slope: float) -> float:
    """Return a value between the edges of a table; 0 before them, and with a slope behind them.

    Parameters
    ----------
    at_s : the time [s]
    pulse : first edge and step of the table [s]
    table : (edge) values
    """
    place = (at_s - pulse[0]) / pulse[1]
    last = len(table) - 1
    if place <= 0.0:
        return 0.0
    if place >= last:
        return float(table[last] + slope * (place - last) * pulse[1])
    k = int(place)
    return float(table[k] + (place - k) * (table[k + 1] - table[k]))


@kernel
def _integral_at(at_s: float, rate: float, integral: np.ndarray, n: int, from_s: float, step_s: float) -> float:
    """Return the integral of the rate from the opening to a time.

    Parameters
    ----------
    at_s : time after the opening [s]
    rate : of noise [1/s]
    integral, n, from_s, step_s : its values where the laser's light comes, their number, first time and step
    """
    if n == 0 or at_s <= from_s:
        return rate * at_s
    place = (at_s - from_s) / step_s
    if place >= n - 1:
        return float(integral[n - 1] + rate * (at_s - from_s - (n - 1) * step_s))
    k = int(place)
    return float(integral[k] + (place - k) * (integral[k + 1] - integral[k]))


@kernel
def _time_of(value: float, rate: float, integral: np.ndarray, n: int, from_s: float, step_s: float) -> float:
    """Return when the integral of the rate reaches a value [s after the opening], infinity if never."""
    if n == 0 or value < integral[0]:
        return value / rate if rate > 0.0 else math.inf
    if value >= integral[n - 1]:
        if rate <= 0.0:
            return math.inf
        return float(from_s + (n - 1) * step_s + (value - integral[n - 1]) / rate)
    low, high = 0, n - 1
    while high - low > 1:
        middle = (low + high) // 2
        if integral[middle] <= value:
            low = middle
        else:
            high = middle
    return float(from_s + step_s * (low + (value - integral[low]) / (integral[high] - integral[low])))


@kernel
def _peak(histogram: np.ndarray, touched: np.ndarray, peak_bins: int) -> Any:
    """Return the centroid [bins] of the window with most counts, the nearest of equals, and its counts.

    Parameters
    ----------
    histogram : (bin) counts
    touched : bins that have counts
    """
    most, first, centre = 0, -1, math.nan
    for begin in touched:
        counts, moment = 0, 0
        for place in range(begin, min(begin + peak_bins, len(histogram))):
            counts += histogram[place]
            moment += histogram[place] * place
        if counts > most or (counts == most and begin < first):
            most, first, centre = counts, begin, moment / counts
    return centre, most
