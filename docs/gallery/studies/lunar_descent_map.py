"""
Where can it land?
==================

A map of heights and one of hazards, from the frames of a descent, and what was there.
"""

import importlib.util

import rso_lidar as rl
from rso_lidar.shipped import shipped
from rso_lidar.study import build_elevation_map, build_true_elevation

place = importlib.util.spec_from_file_location("lunar_descent", shipped("examples/studies/lunar_descent.py"))
lunar_descent = importlib.util.module_from_spec(place)
place.loader.exec_module(lunar_descent)

# %%
# Fifteen frames of sixty. The points of each frame are put on a grid of one metre with the pose of the lander.
scenario = rl.Scenario.load("examples/lunar_descent.toml")
frames = list(rl.simulate(scenario, frames=range(1, 60, 4)))
found = build_elevation_map(frames, "site", lunar_descent.SIZE_M, lunar_descent.CELL_M)
truth = build_true_elevation(scenario.surfaces[0], found)
print(*lunar_descent.table(found, truth), sep="\n")

# %%
# The true ground, the map, their difference, and where a lander of 5 m would stand on less than 10 degrees and 30 cm.
lunar_descent.figure(found, truth)

# %%
# **To try.** Poses that drift, as a navigation's do: `lunar_descent.drifting`. All 60 frames. The reasoning is in
# `examples/studies/lunar_descent.md`.
