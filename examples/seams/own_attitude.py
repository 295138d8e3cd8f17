"""A user-defined attitude: an inspector that scans across the stage in front of it.

Any object with `orient` can be an attitude of a scenario; `rso_lidar.motion.Attitude` describes its arguments.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
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


steady = rl.Scenario.load(Path(__file__).parents[1] / "tumbling_inspection.toml")
nodding = Nodding(at="stage", amplitude_rad=2.0 * rl.units.DEG, period_s=120.0)
scenario = steady.replace(name="Inspection by a craft that nods", follower=steady.follower.replace(attitude=nodding))

if __name__ == "__main__":
    for frame in rl.simulate(scenario, frames=range(4)):
        _, down, ahead = frame.truth.pose("lidar", "stage").translation
        above_deg = -np.arctan2(down, ahead) / rl.units.DEG
        print(f"{frame.time_s:6.1f} s  stage {above_deg:5.3f} deg above the boresight  {frame.valid.sum():5d} returns")
