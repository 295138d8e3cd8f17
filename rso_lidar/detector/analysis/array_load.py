"""Effects of the pixels of one flash on each other: gain lost to the sagging bias, and how many latch together."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rso_lidar.detector.chain.analog import simulate_analog, solve_drooped_gain
from rso_lidar.detector.chain.camera import camera_of
from rso_lidar.detector.chain.traces import store_traces
from rso_lidar.detector.settings.gsfl import Gsfl
from rso_lidar.detector.stages.array_effects import latch_share
from rso_lidar.detector.stages.time_axis import place_rows
from rso_lidar.records import Photons

_SEED = 128  # random seed of the noise that decides when the pixels of the flash latch


@dataclass(frozen=True, eq=False)
class ArrayLoad:
    """Effects of the other pixels of a flash on each pixel.

    Parameters
    ----------
    gain : (pixel) of the APD relative to rest, the mean over the pixel's own light. 1 without light
    together_fraction : (pixel) share of the array that latches within a clock of it. 0 without light
    """

    gain: np.ndarray
    together_fraction: np.ndarray


def simulate_array_load(gsfl: Gsfl, photons: Photons) -> ArrayLoad:
    """Simulate what the pixels of one flash do to each other.

    Pixels latch as in one simulated flash. A pixel that does not latch there is taken to latch at the median delay of the
    others after its own light.

    Parameters
    ----------
    gsfl : the detector; without droop and crosstalk its pixels do nothing to each other
    """
    n_pixels = photons.shape[0] * photons.shape[1]
    gain, together = np.ones(n_pixels), np.zeros(n_pixels)
    camera = camera_of(gsfl, photons)
    if gsfl.droop is not None and len(photons.pixel):
        rows = place_rows(photons, camera.plan(0.0))
        axis = camera.axis(rows.length)
        analog = simulate_analog(camera.front, axis, photons, rows, None)
        steady_per_s = camera.front.background_electrons_per_s(photons)
        relative = solve_drooped_gain(gsfl.droop, rows, analog.electrons, steady_per_s, axis.step_s)
        drawn = np.bincount(rows.pixel, analog.primaries.sum(axis=1), n_pixels)
        left = np.bincount(rows.pixel, (analog.primaries * relative).sum(axis=1), n_pixels)
        np.divide(left, drawn, out=gain, where=drawn > 0.0)
    if gsfl.crosstalk is not None and gsfl.gate is None and len(photons.pixel):
        light = np.bincount(photons.pixel, photons.photons, n_pixels)
        lit = np.flatnonzero(light > 0.0)
        stored, _ = store_traces(camera, photons, np.random.Generator(np.random.Philox(_SEED)))
        at_s = np.zeros(n_pixels)
        at_s[lit] = np.bincount(photons.pixel, photons.photons * photons.delay_s, n_pixels)[lit] / light[lit]
        latched = np.isin(stored.pixel, lit)
        after_s = stored.latch_s[latched] - at_s[stored.pixel[latched]]
        at_s += np.median(after_s) if latched.any() else 0.0
        at_s[stored.pixel] = stored.latch_s
        share = latch_share(at_s[lit], stored.latch_s, gsfl.readout.sample_s, n_pixels)
        together[lit] = np.maximum(share, 1.0 / n_pixels)  # itself, at least
    return ArrayLoad(gain, together)
