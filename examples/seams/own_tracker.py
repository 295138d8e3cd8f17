"""A user-defined tracker: it points the PTU at the mean direction of the returns near the median range.

Any callable that takes an Observation and returns a Command, or None, can be a controller;
`rso_lidar.track.Controller` describes its arguments. `rso_lidar.track.Pointing` is the reference: it filters its angles.
"""

from pathlib import Path

import numpy as np

import rso_lidar as rl


class MeanDirection:
    """Point at the middle of what is seen; with too few returns keep the scenario's demand."""

    def __init__(self, gate_m, min_returns=20):
        self.gate_m, self.min_returns = gate_m, min_returns

    def __call__(self, observation):
        range_m = observation.reading.range_m
        if np.isfinite(range_m).sum() < self.min_returns:
            return None
        near = np.abs(range_m - np.nanmedian(range_m)) < self.gate_m
        right, down, ahead = observation.line_of_sight[near].mean(axis=0)
        pan, tilt = observation.pan_tilt_rad  # as the encoders measure them
        return rl.Command(pan_rad=pan - np.arctan2(right, ahead), tilt_rad=tilt - np.arctan2(down, ahead))


scenario = rl.Scenario.load(Path(__file__).parents[1] / "closed_loop.toml")
scenario = scenario.replace(name="Closed loop by a tracker of one's own", time=scenario.time.replace(duration_s=10.0))

if __name__ == "__main__":
    for frame in rl.simulate(scenario, MeanDirection(gate_m=20.0)):
        if frame.index % 4:
            continue
        x, y, z = frame.truth.pose("lidar", "stage").translation
        print(f"{frame.time_s:6.1f} s  {np.arctan2(np.hypot(x, y), z) / rl.units.DEG:5.3f} deg off boresight")
