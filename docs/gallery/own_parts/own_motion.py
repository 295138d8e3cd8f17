"""
A motion of your own
====================

A rocket stage that spirals down toward the Earth, as the target of an inspection. A motion is any object with a
method `states`: epochs in, positions and velocities out.
"""

from dataclasses import dataclass

import numpy as np

import rso_lidar as rl
from rso_lidar import picture


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


# %%
# It takes the place of the `motion` of a body. The follower's motion is relative to the stage, so it comes along.
hop = rl.Scenario.load("examples/tumbling_inspection.toml")
stage = hop.target[0].replace(motion=Descent(radius_m=6_900e3, rate_m_s=2.0))
scenario = hop.replace(name="Inspection of a stage that descends", target=(stage,))

frames = list(rl.simulate(scenario, frames=range(0, 300, 50)))
for frame in frames:
    height_km = np.linalg.norm(frame.truth.states["stage"].position_m) / 1e3 - 6378.137
    print(f"{frame.time_s:6.0f} s  {height_km:8.3f} km high  {frame.valid.sum():5d} returns")

# %%
picture.frame_figure(frames[2])

# %%
# **To try.** Fly the follower on your motion. Give the relative motion instead, from a table: `{ type = "table", file
# = ... }`. The protocol is `rl.motion.Motion`; :doc:`/seams` says what is checked.
