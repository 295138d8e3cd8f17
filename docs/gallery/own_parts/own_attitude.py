"""
An attitude of your own
=======================

An inspector that nods: it scans across the stage in front of it. An attitude is any object with a method `orient`:
the situation of the body in, rotation and body rate out.
"""

from dataclasses import dataclass

import numpy as np
from matplotlib.figure import Figure
from scipy.spatial.transform import Rotation

import rso_lidar as rl


@dataclass(frozen=True)
class Nodding:
    """Body +x toward a body, turned about body y as a sine of time."""

    at: str
    amplitude_rad: float
    period_s: float

    @property
    def looks_at(self):
        return (self.at,)

    def orient(self, situation):
        aim = rl.LookAt(at=self.at).orient(situation)  # in root axes
        w = 2.0 * np.pi / self.period_s
        phase, body_y = w * situation.epochs.time_s[:, None], np.array([0.0, 1.0, 0.0])
        nod = Rotation.from_rotvec(self.amplitude_rad * np.sin(phase) * body_y)
        rate_rad_s = nod.inv().apply(aim.rate_rad_s) + self.amplitude_rad * w * np.cos(phase) * body_y
        return rl.motion.Orientation(aim.rotation * nod, rate_rad_s)


# %%
# The rest of the scenario stays. Where the stage is in the field follows the nod.
steady = rl.Scenario.load("examples/tumbling_inspection.toml")
nodding = Nodding(at="stage", amplitude_rad=2.0 * rl.units.DEG, period_s=120.0)
scenario = steady.replace(name="Inspection by a craft that nods", follower=steady.follower.replace(attitude=nodding))

frames = list(rl.simulate(scenario, frames=range(13)))
figure = Figure(figsize=(8, 3.5), layout="constrained")
axes = figure.subplots()
above_deg = []
for frame in frames:
    _, down, ahead = frame.truth.pose("lidar", "stage").translation
    above_deg.append(-np.arctan2(down, ahead) / rl.units.DEG)
axes.plot([frame.time_s for frame in frames], above_deg, "o-")
axes.set(xlabel="time [s]", ylabel="stage above the boresight [deg]", title="One nod in two minutes")
axes.grid()
figure

# %%
# **To try.** Nod about body z as well, with another period. Name two bodies in `looks_at` and look from one to the
# other. The protocol is `rl.motion.Attitude`; :doc:`/seams` says what is checked.
