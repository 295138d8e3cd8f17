"""A user-defined material: the dust of an airless body, put on a rocket stage.

Any object with `brdf_per_sr` can be a material of a scenario; `rso_lidar.scene.Material` describes its arguments.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

import rso_lidar as rl


@dataclass(frozen=True)
class Dust:
    """Single scattering in a thick layer (Lommel and Seeliger): at full phase all of it is equally bright."""

    albedo: float

    def brdf_per_sr(self, cos_in, cos_out, cos_phase):
        return self.albedo / (4.0 * np.pi * np.maximum(cos_in + cos_out, 1e-3))


clean = rl.Scenario.load(Path(__file__).parents[1] / "tumbling_inspection.toml")
stage = clean.target[0].replace(material=Dust(albedo=0.9))
scenario = clean.replace(name="Rocket stage, covered with dust", target=(stage,))

if __name__ == "__main__":
    for frame in rl.simulate(scenario, frames=range(3)):
        print(f"{frame.time_s:6.1f} s  {frame.valid.sum():5d} returns")
