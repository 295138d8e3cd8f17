"""
A colour camera beside the lidar
================================

A craft flies round a dead satellite with two eyes: the lidar, which brings its own light, and a colour camera, which
has the light of the Sun and the Earth. A third camera looks at the stars.
"""

import numpy as np
from matplotlib.figure import Figure

import rso_lidar as rl
from rso_lidar import picture

scenario = rl.Scenario.load("examples/companion_camera.toml")

# %%
# One flash by day. Counts above the black level are drawn with the square root of their brightness, as screens do.
(frame,) = rl.simulate(scenario, frames=[16])


def develop(counts):
    """Return an image (row, col, 3) to look at, from 0 to 1."""
    light = np.clip(counts.astype(float) - 64.0, 0.0, None)
    return np.sqrt(np.clip(light / np.percentile(light, 99.8), 0.0, 1.0)) * np.ones(3)


figure = Figure(figsize=(9, 4.6), layout="constrained")
for axes, name in zip(figure.subplots(1, 2), frame.camera, strict=True):
    image = frame.camera[name]
    axes.imshow(develop(image.intensity_counts))
    axes.set(title=f"{name}: {1e3 * float(image.exposure_s):.3g} ms", xlabel="column", ylabel="row")
figure

# %%
# The same flash by the lidar.
picture.frame_figure(frame)

# %%
# **To try.** Fly frame 9, in the shadow of the Earth: the lidar sees the satellite, and the camera sees nothing but
# noise, however long it is exposed. Take a rolling shutter (`row_delay_us`). What a camera sees: :doc:`/imaging`.
