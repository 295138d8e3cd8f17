"""
How do I close the loop with my own controller?
===============================================

A controller is any function of an `Observation`: reading, line of sight, measured angles, samples of other sensors.
It returns a `Command` or None. It never sees the truth.
"""

import numpy as np

import rso_lidar as rl


def controller(observation):
    """Point at the nearest group of returns."""
    range_m = observation.reading.range_m
    if np.isfinite(range_m).sum() < 20:
        return None  # keep what is in force
    near = np.abs(range_m - np.nanmedian(range_m)) < 20.0
    right, down, ahead = observation.line_of_sight[near].mean(axis=0)
    pan, tilt = observation.pan_tilt_rad
    return rl.Command(pan_rad=pan - np.arctan2(right, ahead), tilt_rad=tilt - np.arctan2(down, ahead))


scenario = rl.Scenario.load("examples/closed_loop.toml", ("time.duration_s=15",))
for frame in rl.simulate(scenario, controller):
    if frame.index % 5 == 0:
        print(f"{frame.time_s:5.1f} s  {(frame.labels.target >= 0).sum():5d} pixels on the stage")

# %%
# Commands between flashes, thrusters and wheels go through `rl.Simulation`, whose steps may be shorter than the
# interval of the flashes.
with rl.Simulation(scenario) as simulation:
    simulation.step()
    while simulation.time_s < 1.0:
        simulation.step(rl.Command(pan_rad=0.8), dt_s=0.02)
    print(f"at {simulation.time_s:.2f} s pan and tilt are {np.array(simulation.observation.pan_tilt_rad).round(4)} rad")

# %%
# In another process or language: :doc:`/auto_gallery/connect/flight_software`. Reinforcement learning:
# :doc:`/gymnasium`.
