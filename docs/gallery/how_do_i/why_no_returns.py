"""
Why are there no returns?
=========================

In order: is the target in the field, is there light, is the detector armed, does it trigger? `check` answers all
four without a run, and the labels of a frame answer them pixel by pixel.
"""

import rso_lidar as rl

scenario = rl.Scenario.load(
    "examples/tdrs_approach.toml", ("lidar.laser.energy_mj=0.5", "lidar.detector.armed_to_m=2900")
)
for line in scenario.describe().splitlines():
    if any(word in line.lower() for word in ("photons", "warning", "armed", "field")):
        print(line)

# %%
# In a frame: is the target in the field, has it light, and does a pixel report it?
frame = next(rl.simulate(scenario, frames=[0]))
on = frame.labels.target >= 0
print("pixels that see the target:", int(on.sum()))
print("photons in the brightest:", float(frame.labels.photons[on].max()))
print("true range:", float(frame.labels.range_m[on].min()), "m; pixels that report:", int((frame.valid & on).sum()))

# %%
# Here the light is too weak *and* the target is beyond the armed range. Flipped facets are no reason: facets have two
# sides. A mesh in the wrong unit is: :doc:`/auto_gallery/how_do_i/my_own_mesh`.
