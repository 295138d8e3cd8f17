"""
A servicer comes to a geostationary satellite
=============================================

From 20 km to 12 m in 25 hours, by two hops and through a corridor behind the satellite. Guidance corrects the path every 25
minutes.
"""

import tempfile
from pathlib import Path

from PIL import Image

import rso_lidar as rl
from rso_lidar import picture

folder = Path(tempfile.mkdtemp())
scenario = rl.Scenario.load("examples/geo_servicer.toml")
flight = scenario.follower.motion.fly(scenario.time.start_utc, scenario.target[0].motion)
print(flight.plan.describe())
print(flight.describe())

# %%
# The last hours, from 2 km on: the lens zooms out as the satellite grows.
frames = list(rl.simulate(scenario, frames=[240, 280, 300, 316, 320, 324, 328, 330, 338, 340, 342, 350]))
Image.open(picture.contact_sheet(frames, folder / "sheet.png", columns=4, rows=3))

# %%
# **To try.** Stop at 30 m: `rso-lidar check examples/geo_servicer.toml --set follower.motion.plan.legs[6].to_m=-30`.
