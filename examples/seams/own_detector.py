"""A user-defined detector: it draws photoelectrons and reports the first cluster of each pixel that has enough of them.

Any object with `detect` and `traits` can be a detector of a scenario; see `rso_lidar.detector.Detector`.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

import rso_lidar as rl


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


inspection = rl.Scenario.load(Path(__file__).parents[1] / "tumbling_inspection.toml")
lidar = inspection.lidar.replace(detector=Threshold(electrons=80))
scenario = inspection.replace(name="Inspection with a detector of one's own", lidar=lidar)

if __name__ == "__main__":
    for frame in rl.simulate(scenario, frames=range(3)):
        print(f"{frame.time_s:6.1f} s  {frame.valid.sum():5d} returns, nearest at {np.nanmin(frame.range_m):.2f} m")
