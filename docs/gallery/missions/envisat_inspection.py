"""
Two days about a dead satellite
===============================

A servicing craft comes from 25 km to 80 m, by a safety ellipse and a circumnavigation, and leaves again. The plan is made
with simple equations and flown under the forces that act, with errors of burns and navigation, and corrections.
"""

import tempfile
from pathlib import Path

from PIL import Image

import rso_lidar as rl
from rso_lidar import picture

folder = Path(tempfile.mkdtemp())
scenario = rl.Scenario.load("examples/envisat_inspection.toml")
flight = scenario.follower.motion.fly(scenario.time.start_utc, scenario.target[0].motion)
print(flight.plan.describe())
print(flight.describe())

# %%
# The satellite turns once in 135 s. The lens zooms out as the craft comes nearer.
frames = list(rl.simulate(scenario, frames=[122, 140, 160, 178, 190, 200, 221, 245, 262, 292, 296, 299]))
Image.open(picture.contact_sheet(frames, folder / "sheet.png", columns=4, rows=3))

# %%
# **To try.** Fly it blindly, without `guidance`: `rso-lidar check` says how far off it ends. The study
# `examples/studies/envisat_inspection.py` reads the frames of both days, and flies the mission many times.
