"""
Light that meets two surfaces
=============================

A craft in gold foil turns on a bench. Its body and its solar wing stand at right angles, and light that goes from
one to the other returns later than light that meets one surface only.
"""

import numpy as np
from matplotlib.figure import Figure

import rso_lidar as rl
from rso_lidar import picture

scenario = rl.Scenario.load("examples/second_bounce.toml")
alone = scenario.replace(lidar=scenario.lidar.replace(bounces=1))

# %%
# The same frames with one bounce and with two. The second bounce is off by default, because it doubles the time of a
# frame.
chosen = [0, 2, 4, 6, 8, 10]
once, twice = list(rl.simulate(alone, frames=chosen)), list(rl.simulate(scenario, frames=chosen))
for first, both in zip(once, twice, strict=True):
    more = both.labels.photons.sum() / first.labels.photons.sum() - 1.0
    print(f"{both.time_s:4.0f} s: {more:+6.1%} of light by the second bounce")

# %%
# What the second bounce adds, pixel by pixel, in the frame where it adds most.
most = max(range(len(chosen)), key=lambda k: twice[k].labels.photons.sum() / once[k].labels.photons.sum())
added = np.nan_to_num(twice[most].labels.photons) - np.nan_to_num(once[most].labels.photons)
figure = Figure(figsize=(10, 4.4), layout="constrained")
for axes, values, title in zip(
    figure.subplots(1, 2),
    (np.nan_to_num(once[most].labels.photons), added),
    ("one bounce", "added by the second"),
    strict=True,
):
    shown = axes.imshow(np.log10(np.maximum(values, 1.0)), vmin=0, vmax=5)
    axes.set(title=title, xlabel="col", ylabel="row")
figure.colorbar(shown, label="expected photons, power of ten")
figure

# %%
# A frame as the sensor reports it.
picture.frame_figure(twice[most])

# %%
# **To try.** Leave out `material`, so that the craft keeps the materials of the catalogue, and see how little is left
# of the effect. What is modelled and what is not: :doc:`/physics`.
