"""
A detector of your own
======================

An ideal clock behind a threshold on photoelectrons. A detector is any object with a method `detect`, photons in and
a reading out, and with an attribute `traits`.
"""

from dataclasses import dataclass

import numpy as np

import rso_lidar as rl
from rso_lidar import picture


@dataclass(frozen=True)
class Threshold:
    """Ideal timing behind a threshold on photoelectrons."""

    electrons: int
    traits = rl.detector.DetectorTraits(sees_to_m=2000.0, threshold_photons=100.0)

    def detect(self, photons, rng):
        # Each sub-ray that hits is a return. The returns of a cluster arrive as one pulse.
        light = np.bincount(photons.cluster, photons.photons)
        delay_s = np.bincount(photons.cluster, photons.photons * photons.delay_s) / np.maximum(light, 1e-30)
        found = np.flatnonzero(rng.poisson(0.8 * light) >= self.electrons)
        pixel, first = np.unique(photons.cluster_pixel[found], return_index=True)  # clusters run from near to far
        range_m, counts = np.full(photons.shape, np.nan), np.zeros(photons.shape, np.uint16)
        range_m.flat[pixel] = delay_s[found[first]] * rl.units.RANGE_PER_DELAY_M_S
        counts.flat[pixel] = np.minimum(np.rint(light[found[first]]), 65_535)
        return rl.records.Reading(range_m, counts, np.zeros(photons.shape, np.uint8)), None


# %%
# Noise of its own: the random generator that it is given depends on the seed and on the frame.
inspection = rl.Scenario.load("examples/tumbling_inspection.toml")
for electrons in (20, 80, 320):
    lidar = inspection.lidar.replace(detector=Threshold(electrons=electrons))
    frame = next(rl.simulate(inspection.replace(lidar=lidar), frames=[417]))
    print(f"threshold {electrons:3d} photoelectrons: {frame.valid.sum():5d} returns")

# %%
picture.frame_figure(frame)

# %%
# **To try.** Report the brightest cluster in place of the first. Add timing jitter with `rng.normal`. The protocol is
# `rl.detector.Detector`; a shipped detector with all optional methods is the Geiger-mode array.
