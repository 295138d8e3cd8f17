"""
A tracker of your own
=====================

A controller that points the PTU at the mean direction of the returns near the median range. It is any callable that
takes an `Observation` and returns a `Command`, or None.
"""

import numpy as np
from matplotlib.figure import Figure

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


# %%
# The same flight with this tracker, and with the reference tracker that filters its angles.
scenario = rl.Scenario.load("examples/closed_loop.toml", ("time.duration_s=30",))
controllers = {
    "mean direction": MeanDirection(gate_m=20.0),
    "rl.track.Pointing": rl.track.Pointing(gate_m=20.0, lead_s=0.16),
}
figure = Figure(figsize=(8, 3.8), layout="constrained")
axes = figure.subplots()
for name, controller in controllers.items():
    frames = list(rl.simulate(scenario, controller))
    places = np.array([frame.truth.pose("lidar", "stage").translation for frame in frames])
    off_deg = np.arctan2(np.hypot(places[:, 0], places[:, 1]), places[:, 2]) / rl.units.DEG
    axes.plot([frame.time_s for frame in frames], off_deg, label=name)
axes.axhline(1.5, ls="--", label="edge of the field")
axes.set(xlabel="time [s]", ylabel="stage off the boresight [deg]", title="Two trackers on one pass")
axes.legend()
axes.grid()
figure

# %%
# **To try.** Lead the target by its rate. Raise `false_alarms_per_s` until one of both loses it. The protocol is
# `rl.track.Controller`; filters and ICP are in :doc:`/tracking`.
