"""What the pixels of one flash do to each other: gain lost to the sagging bias, and how many latch together."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from rso_lidar.detector import chain
from rso_lidar.detector.waveform import rows_about

if TYPE_CHECKING:
    from rso_lidar.detector.gsfl import Gsfl
    from rso_lidar.records import Photons

_SEED = 128  # random seed of the noise that decides when the pixels of the flash latch


@dataclass(frozen=True, eq=False)
class ArrayLoad:
    """What the other pixels of a flash do to each pixel of the array.

    `gain` (pixel) is the APD's relative to rest, the mean over the pixel's own light; `together_fraction` (pixel) the share
    of the array that latches within a clock of it. A pixel without light has 1 and 0.
    """

    gain: np.ndarray
    together_fraction: np.ndarray


def array_load(gsfl: Gsfl, photons: Photons) -> ArrayLoad:
    """Work out what the pixels of one flash do to each other.

    Pixels latch as in one simulated flash. A pixel that does not latch there is taken to latch at the median delay of the
    others after its own light.

    Parameters
    ----------
    gsfl : the detector; without droop and crosstalk its pixels do nothing to each other.
    photons : the light of the whole flash.
    """
    n_pixels = photons.shape[0] * photons.shape[1]
    gain, together = np.ones(n_pixels), np.zeros(n_pixels)
    if gsfl.droop is not None and len(photons.pixel):
        plan = gsfl.plan(photons.pulse_fwhm_s)
        rows = rows_about(photons, plan, n_pixels)
        made = chain.analog(gsfl, photons, rows, plan, gsfl.camera(n_pixels), None)
        relative = chain.drooped_gain(gsfl, rows, made.electrons, photons, plan.step_s)
        drawn = np.bincount(rows.pixel, made.primaries.sum(axis=1), n_pixels)
        left = np.bincount(rows.pixel, (made.primaries * relative).sum(axis=1), n_pixels)
        np.divide(left, drawn, out=gain, where=drawn > 0.0)
    if gsfl.crosstalk is not None and gsfl.gate is None and len(photons.pixel):
        light = np.bincount(photons.pixel, photons.photons, n_pixels)
        lit = np.flatnonzero(light > 0.0)
        stored = chain.traces(gsfl, photons, np.random.Generator(np.random.Philox(_SEED)))
        at_s = np.zeros(n_pixels)
        at_s[lit] = np.bincount(photons.pixel, photons.photons * photons.delay_s, n_pixels)[lit] / light[lit]
        latched = np.isin(stored.pixel, lit)
        after_s = stored.latch_s[latched] - at_s[stored.pixel[latched]]
        at_s += np.median(after_s) if latched.any() else 0.0
        at_s[stored.pixel] = stored.latch_s
        share = gsfl.crosstalk.share(at_s[lit], stored.latch_s, gsfl.readout.sample_s, n_pixels)
        together[lit] = np.maximum(share, 1.0 / n_pixels)  # itself, at least
    return ArrayLoad(gain, together)
