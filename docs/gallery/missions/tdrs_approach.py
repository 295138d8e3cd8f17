"""
Approach to a relay satellite
=============================

A follower hops from 3 km behind a relay satellite in geosynchronous orbit to 300 m behind it, in 45 minutes. This is
the first example of the package, and the one to copy: `rso-lidar new approach --from tdrs_approach`.
"""

import tempfile
from pathlib import Path

from PIL import Image

import rso_lidar as rl
from rso_lidar import picture

folder = Path(tempfile.mkdtemp())

# %%
# A scenario is one file, and `describe` says what it holds: the orbit, the geometry of the encounter, the optics, the
# link budget at the first and the last frame, and warnings. Nothing is simulated for it.
scenario = rl.Scenario.load("examples/tdrs_approach.toml")
print(scenario.describe())

# %%
# `rl.simulate` yields one frame for each laser flash. These are 12 of 540. Frame *k* depends on the scenario, the seed
# and *k* only, so that any selection gives the same frames as the whole run.
frames = list(rl.simulate(scenario, frames=range(0, 540, 49)))
for frame in frames:
    print(f"{frame.time_s:6.0f} s  {frame.valid.sum():5d} returns")

# %%
# The contact sheet has range on the left and intensity on the right. At 3 km a pixel is one metre wide and few of them
# receive enough photons to trigger. Photons fall with the square of the range as long as the target fills the pixel,
# so that at 300 m even the struts of the booms return. Single pixels in the sky are false alarms of the amplifier's
# noise.
Image.open(picture.contact_sheet(frames, folder / "sheet.png"))

# %%
# One frame in full: the range and the intensity that the sensor reported, the part of the satellite that each pixel
# truly saw, and the error of the range.
picture.frame_figure(frames[-1])

# %%
# The hop in the rtn axes of the target: radially out, along the track and across it. Two impulses suffice, and between
# them the follower drifts below the orbit.
picture.orbit_figure(frames, "tdrs")

# %%
# **To try.** Take less energy, ``rl.Scenario.load(path, ("lidar.laser.energy_mj=10",))``, and see from where the
# satellite is found. Leave out the target's `material`, so that it keeps those of the catalogue. Make a film of the
# whole run with `rso-lidar run` and `rso-lidar animate`. Keys and units: :doc:`/scenario`.
