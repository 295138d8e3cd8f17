"""Rows of the axis of time in NumPy: the oracle of `rso_lidar.detector.stages.time_axis`."""

import math

import numpy as np

from rso_lidar.detector.stages.time_axis import Rows, SamplingPlan
from rso_lidar.records import Photons

_LONGEST = 4.0  # pulses: of a return that is deeper, so much about its middle is watched on either side


def place_rows(
    photons: Photons, plan: SamplingPlan, least_photons: float = 0.0, sure_photons: float = math.inf
) -> Rows:
    """Place rows that hold every return."""
    n_pixels = photons.shape[0] * photons.shape[1]
    half_s = np.minimum(0.5 * photons.depth_spread_s, _LONGEST * photons.pulse_fwhm_s)
    enough = np.bincount(photons.pixel, photons.photons, n_pixels) > least_photons
    left = np.flatnonzero((photons.photons > 0.0) & enough[photons.pixel])
    if not len(left):
        none = np.zeros(0, np.int64)
        return Rows(none, none, none, none, plan.length, plan.room)
    pixel = photons.pixel[left]
    delay_s, half_s, light = photons.delay_s[left] + photons.late_s, half_s[left], photons.photons[left]
    from_s, to_s = delay_s - half_s - plan.rise * plan.step_s, delay_s + half_s + plan.fall * plan.step_s
    pixels, starts, firsts = [], [], []
    covered_s = np.full(n_pixels, -np.inf)
    done = np.zeros(n_pixels, bool)
    while len(pixel):
        group = np.flatnonzero(np.diff(pixel, prepend=-1))
        made = pixel[group]
        lit_s = np.minimum.reduceat(from_s, group)
        goes_on = lit_s <= covered_s[made]
        begin = np.floor(np.maximum(lit_s, covered_s[made]) / plan.step_s + 1e-9).astype(np.int64)
        # Rows begin on a sample, so that samples fall on steps.
        watched = begin // plan.steps_per_sample * plan.steps_per_sample
        pixels.append(made)
        starts.append(watched - plan.before)
        firsts.append(begin - watched + plan.before - goes_on)
        covered_s[made] = (watched + plan.watched) * plan.step_s
        later = to_s > covered_s[pixel]
        done[made] = np.add.reduceat(np.where(later, 0.0, light), group) > sure_photons
        later &= ~done[pixel]
        if not later.any():
            break
        pixel, from_s, to_s, light = pixel[later], from_s[later], to_s[later], light[later]
    pixel, start, first = (np.concatenate(column) for column in (pixels, starts, firsts))
    order = np.lexsort((start, pixel))
    last = np.full(len(pixel), plan.before + plan.watched)
    return Rows(pixel[order].astype(np.int64), start[order], first[order], last, plan.length, plan.room)
