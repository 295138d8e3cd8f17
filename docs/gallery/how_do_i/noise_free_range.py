"""
How do I get range without noise?
=================================

You need not switch noise off: the labels of a noisy frame are the truth of the same frame. A run without any
detector gives the expected photons.
"""

import numpy as np
from matplotlib.figure import Figure

import rso_lidar as rl

scenario = rl.Scenario.load("examples/tumbling_inspection.toml")
frame = next(rl.simulate(scenario, frames=[417], keep=["photons"]))
error_m = frame.range_m - frame.labels.range_m

# %%
# `range_m` of the labels is that of the brightest surface in the pixel, `first_range_m` that of the nearest. Beside
# the noise the difference shows pixels that see two surfaces.
figure = Figure(figsize=(10, 4), layout="constrained")
left, right = figure.subplots(1, 2)
shown = left.imshow(frame.labels.range_m, interpolation="nearest")
figure.colorbar(shown, ax=left, label="true range [m]")
shown = right.imshow(error_m, cmap="RdBu_r", vmin=-0.3, vmax=0.3, interpolation="nearest")
figure.colorbar(shown, ax=right, label="reported less true [m]")
figure

# %%
# Light before any detector: the returns of all rays, with delay and expected photons.
photons = frame.kept["photons"]
print(f"{photons.delay_s.size} returns, {photons.photons.sum():.0f} photons")

# %%
# A detector with almost no noise: no false alarms, no range noise, and 95 % detection at 50 photons.
quiet = rl.Empirical(
    reference_photons=50.0,
    noise_equivalent_photons=0.1,
    false_alarms_per_s=0.0,
    range_plateau_m=0.0,
    range_noise_equivalent_photons=0.0,
    armed_to_m=500,
)
still = next(rl.simulate(scenario.replace(lidar=scenario.lidar.replace(detector=quiet)), frames=[417]))
difference_m = still.range_m - still.labels.first_range_m
print(f"{still.valid.sum()} returns, median difference {np.nanmedian(np.abs(difference_m)) * 1e3:.2f} mm")

# %%
# What a reading and a label mean: :doc:`/records`. The fast detector: :doc:`/physics`.
