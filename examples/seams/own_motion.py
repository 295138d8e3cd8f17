"""A user-defined motion: a spiral descent toward the Earth, flown as the target of an approach.

Any object with `states` can be a motion of a scenario; `rso_lidar.motion.Motion` describes its arguments.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

import rso_lidar as rl


@dataclass(frozen=True)
class Descent:
    """A circular orbit in the equator's plane that loses height at a constant rate."""

    radius_m: float
    rate_m_s: float

    def states(self, epochs):
        t, n = epochs.time_s, np.sqrt(rl.units.EARTH_GM_M3_S2 / self.radius_m**3)
        radius, zero = self.radius_m - self.rate_m_s * t, np.zeros_like(t)
        out = np.stack([np.cos(n * t), np.sin(n * t), zero], axis=1)
        along = np.stack([-np.sin(n * t), np.cos(n * t), zero], axis=1)
        return rl.records.BodyState(radius[:, None] * out, (n * radius)[:, None] * along - self.rate_m_s * out)


hop = rl.Scenario.load(Path(__file__).parents[1] / "tumbling_inspection.toml")
stage = hop.target[0].replace(motion=Descent(radius_m=6_900e3, rate_m_s=2.0))
scenario = hop.replace(name="Inspection of a stage that descends", target=(stage,))

if __name__ == "__main__":
    for frame in rl.simulate(scenario, frames=range(3)):
        height_km = np.linalg.norm(frame.truth.states[stage.name].position_m) / 1e3 - 6378.137
        print(f"{frame.time_s:6.1f} s  {height_km:8.3f} km high  {frame.valid.sum():5d} returns")
