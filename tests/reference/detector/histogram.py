"""Histograms of photon times in NumPy: the oracle of `rso_lidar.detector.geiger.histogram`."""

import numpy as np

from tests.reference import philox

_PER_PULSE = 16  # steps of time in a pulse's length, as the kernel has them
_STAGE = 0


def count_photons(array, photons, key):
    """Return the centroid of the peak [s], its counts and all counts of each pixel: three arrays."""
    sunlight = photons.background_photons_per_s
    n_pixels = photons.shape[0] * photons.shape[1]
    rate = array.noise_per_s(np.zeros(n_pixels) if sunlight is None else sunlight.ravel())
    found = [_count_pixel(array, photons, key, pixel, rate[pixel]) for pixel in range(n_pixels)]
    delay_s, counts, total = (np.array(values) for values in zip(*found, strict=True))
    return delay_s, counts, total


def _count_pixel(array, photons, key, pixel, rate):
    times_s = []
    for pulse, light in enumerate(photons.split_pulses(array.pulses)):
        at_s, arrived = integrate_light(array, light, pixel)
        # Between the laser's first and last light the integral is linear from step to step; elsewhere it is noise.
        end_s = max(array.gate_s, at_s[-1]) + 1.0
        knots_s = np.concatenate([[0.0], at_s, [end_s]])
        integral = np.concatenate([[0.0], arrived, arrived[-1:]]) + rate * knots_s
        rising = np.concatenate([[True], np.diff(integral) > 0.0])
        alive_s, step, waiting_s = 0.0, 0, np.inf
        while alive_s < array.gate_s:
            words = (philox.blocks(key, step, pulse, pixel, _STAGE).astype(float) + 0.5) / 2.0**32
            step += 1
            value = np.interp(alive_s, knots_s, integral) - np.log(words[0])
            at = np.interp(value, integral[rising], knots_s[rising], right=np.inf)
            at = min(at, waiting_s)
            if at >= array.gate_s:
                break
            alive_s = at + array.hold_off_s
            waiting_s = np.inf
            if words[1] < array.afterpulse_probability:
                waiting_s = alive_s - 1e-9 * array.afterpulse_time_ns * np.log(words[1] / array.afterpulse_probability)
            normal = np.sqrt(-2.0 * np.log(words[2])) * np.cos(2.0 * np.pi * (words[3] - 0.5 / 2.0**32))
            times_s.append(at + 1e-9 * array.jitter_ns * normal)
    place = np.floor(np.array(times_s) / array.bin_s).astype(int)
    place = place[(place >= 0) & (place < array.n_bins)]
    return (*find_peak(np.bincount(place, minlength=array.n_bins), array), len(place))


def integrate_light(array, photons, pixel):
    """Return times after the opening of the gate [s], and the laser's mean avalanches until then: two arrays."""
    mine = (photons.pixel == pixel) & (photons.photons > 0.0)
    delay_s = (photons.delay_s[mine] + photons.late_s - array.opens_s)[:, None]
    depth_s = photons.depth_spread_s[mine][:, None]
    step_s, power = photons.pulse_step_s, photons.pulse_power_per_s
    edge_s = step_s * (np.arange(len(power) + 1) - len(power) // 2 - 0.5)
    first_s = max(np.min(delay_s + edge_s[0] - 0.5 * depth_s, initial=np.inf), 0.0)
    last_s = min(np.max(delay_s + edge_s[-1] + 0.5 * depth_s, initial=-np.inf), array.gate_s)
    if last_s <= first_s:
        return np.zeros(1), np.zeros(1)
    fine_s = min(array.bin_s, photons.pulse_fwhm_s / _PER_PULSE)
    at_s = first_s + fine_s * np.arange(int(np.ceil((last_s - first_s) / fine_s)) + 1)
    energy = np.concatenate([[0.0], np.cumsum(power)]) / power.sum()
    summed = np.concatenate([[0.0], np.cumsum(0.5 * (energy[1:] + energy[:-1]))]) * step_s
    since_s = at_s - delay_s

    def integral(time_s):
        return np.interp(time_s, edge_s, summed) + np.maximum(time_s - edge_s[-1], 0.0)

    stretched = np.maximum(depth_s, step_s)
    share = np.where(
        depth_s < step_s,
        np.interp(since_s, edge_s, energy),
        (integral(since_s + 0.5 * stretched) - integral(since_s - 0.5 * stretched)) / stretched,
    )
    primaries = array.detection_efficiency * photons.photons[mine][:, None]
    return at_s, (primaries * (share - share[:, :1])).sum(axis=0)


def find_peak(histogram, array):
    """Return the centroid of the window with most counts, the nearest of equals, as a delay [s]; and its counts."""
    begins = np.flatnonzero(histogram)
    if not len(begins):
        return np.nan, 0
    windows = np.lib.stride_tricks.sliding_window_view(
        np.concatenate([histogram, np.zeros(array.peak_bins, int)]), array.peak_bins
    )
    begin = begins[np.argmax(windows[begins].sum(axis=1))]
    counts = windows[begin]
    centre = begin + (counts * np.arange(array.peak_bins)).sum() / counts.sum()
    return array.opens_s + (centre + 0.5) * array.bin_s, counts.sum()
