"""
How do I describe my own detector?
==================================

In three ways, from quick to free: change the stages of the shipped chain, use the fast model with curves of your
own, or write a Python object.
"""

import numpy as np

import rso_lidar as rl

bench = rl.Scenario.load("examples/bench_plate.toml")
detectors = {
    "chain, as shipped": rl.Gsfl(),
    "chain, quieter amplifier": rl.Gsfl(preset="offset_limited"),
    "chain, centroid": rl.Gsfl(ranging=rl.detector.Ranging(algorithm="centroid")),
    "fast model": rl.Empirical(),
    "fast model, 95 % at 300 photons": rl.Empirical(reference_photons=300),
}

# %%
# The same plate at 3 km, 1000 photons on a filled pixel, 60 flashes.
for name, detector in detectors.items():
    scenario = bench.replace(lidar=bench.lidar.replace(detector=detector))
    frames = list(rl.simulate(scenario, frames=range(60)))
    filled = frames[0].labels.filled_fraction > 0.999
    error_m = np.array([(frame.range_m - frame.labels.range_m)[filled] for frame in frames])
    near = np.abs(error_m) < 2.0  # without false alarms
    print(f"{name:32s} detected {near.mean():5.1%}, range noise {np.std(error_m[near]) * 100:5.1f} cm")

# %%
# The Python object: :doc:`/auto_gallery/own_parts/own_detector`. Stages with equations and sources:
# :doc:`/instrument`.
