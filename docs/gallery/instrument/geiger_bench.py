"""
Bench: counting single photons
==============================

A photon-counting camera of 32 × 32 Geiger-mode pixels looks at a plate 150 m away with pulses of 50 nJ. A pixel of
the plate receives 0.4 photons of each pulse. One frame is the histogram of 100 pulses.
"""

import numpy as np
from matplotlib.figure import Figure

import rso_lidar as rl
from rso_lidar import picture

scenario = rl.Scenario.load("examples/geiger_bench.toml")
frames = list(rl.simulate(scenario, frames=range(6)))
picture.frame_figure(frames[0])

# %%
# The intensity is the number of counts in the peak of the histogram. Its spread is that of counting.
on = frames[0].labels.filled_fraction > 0.999
counts = np.concatenate([frame.intensity_counts[on] for frame in frames])
error_m = np.concatenate([(frame.range_m - frame.labels.range_m)[on] for frame in frames])
figure = Figure(figsize=(9, 3.6), layout="constrained")
left, right = figure.subplots(1, 2)
left.hist(counts, bins=np.arange(counts.max() + 2) - 0.5)
left.set(xlabel="counts in the peak", ylabel="pixels", title="Intensity")
right.hist(error_m[np.isfinite(error_m)] * 100, bins=40)
right.set(xlabel="range error [cm]", title="Range less truth")
figure

# %%
# More light is not always better: a pixel fires once in a pulse, at the first photon. Bright light therefore looks
# nearer, by up to half of the pulse.
for energy_mj in (5e-5, 5e-4, 5e-3):
    bright = rl.Scenario.load("examples/geiger_bench.toml", (f"lidar.laser.energy_mj={energy_mj}",))
    frame = next(rl.simulate(bright, frames=[0]))
    walk_m = np.nanmean((frame.range_m - frame.labels.range_m)[on])
    light = frame.labels.photons[on].mean()
    print(f"{energy_mj * 1e6:6.0f} nJ: {light:6.2f} photons a pulse, range off by {walk_m * 100:+.2f} cm")

# %%
# **To try.** Fewer pulses (`lidar.detector.pulses=10`), more dark counts (`dark_count_rate_hz`). What published
# single-photon cameras measured, and how near the model comes: :doc:`/calibration`.
