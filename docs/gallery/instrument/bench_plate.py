"""
Bench: a plate at 3 km
======================

A camera and a plate, 3 km apart, and nothing moves. The answer is known in closed form: a pixel that the plate fills
receives 1000 photons, and is detected in 95 % of the flashes (Fuller et al., sec. 5).
"""

import numpy as np

import rso_lidar as rl
from rso_lidar import picture

scenario = rl.Scenario.load("examples/bench_plate.toml")
frames = list(rl.simulate(scenario))
picture.frame_figure(frames[0])

# %%
# The plate covers not quite 4 × 4 pixels. The 300 frames differ only by their noise, so that rates can be counted. The
# labels hold the expected photons of each pixel and the share of it that is filled.
filled = frames[0].labels.filled_fraction > 0.999
detected = np.array([frame.valid[filled] for frame in frames])
photons = frames[0].labels.photons[filled]
print(f"expected photons of the filled pixels: {photons.round(1)}")
print(f"detected: {detected.mean():.3f} of {detected.size} flashes and pixels")

# %%
# Range noise of the same pixels. The label is the true range, without noise.
error_m = np.array([frame.range_m[filled] - frame.labels.range_m[filled] for frame in frames])
print(f"range error: mean {np.nanmean(error_m):+.4f} m, standard deviation {np.nanstd(error_m):.4f} m")

# %%
# **To try.** Replace the fast detector by the signal chain,
# ``scenario.replace(lidar=scenario.lidar.replace(detector=rl.Gsfl()))``, and compare both rates. Tilt the plate. The
# closed form for any range is :doc:`/auto_gallery/how_do_i/how_far_can_i_see`.
