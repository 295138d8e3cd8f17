"""
A day on a safety ellipse
=========================

A servicing craft inspects a relay satellite for a day before it comes nearer. It flies a walking safety ellipse, so
that without any burn it would stay at least 60 m away. The satellite points to the Earth, and its solar arrays
follow the Sun.
"""

import tempfile
from pathlib import Path

from PIL import Image

import rso_lidar as rl
from rso_lidar import picture

folder = Path(tempfile.mkdtemp())
scenario = rl.Scenario.load("examples/safety_ellipse.toml")

# %%
# The plan is the motion of the follower. The circle is its keep-out sphere: without any burn the ellipse stays outside.
motion = scenario.follower.motion
frames = list(rl.simulate(scenario, frames=range(0, 43, 3)))
picture.orbit_figure(frames, "tdrs", keep_out_m=motion.keep_out_m)

# %%
# The arrays turn once about their boom in the frames of a day: two joints of the model, with the law `follow_sun`.
Image.open(picture.contact_sheet(frames, folder / "sheet.png", columns=4, rows=3))

# %%
# **To try.** Let the ellipse drift faster with `drift_m`, and see where passive safety ends: `rso-lidar check
# examples/safety_ellipse.toml --set follower.motion.drift_m=400`. More plans: :doc:`/orbits`.
