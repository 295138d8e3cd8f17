"""
Descent to the Moon
===================

A lander comes down from 1 km to 30 m in a minute and looks straight below itself, at ground that a random seed
makes: craters as densely as on old ground, and rocks on 5 % of it.
"""

import tempfile
from pathlib import Path

from PIL import Image

import rso_lidar as rl
from rso_lidar import picture

folder = Path(tempfile.mkdtemp())
scenario = rl.Scenario.load("examples/lunar_descent.toml")

# %%
# The field is 536 m wide at 1 km and 16 m at 30 m. The energy falls with the range, from 50 mJ to 0.5 mJ, or the
# converter would saturate.
frames = list(rl.simulate(scenario, frames=range(4, 60, 5)))
Image.open(picture.contact_sheet(frames, folder / "sheet.png", columns=4, rows=3))

# %%
# A frame from the middle of the descent.
picture.frame_figure(frames[8])

# %%
# The film of these frames.
Image.open(picture.animate(frames, folder / "descent.gif", frame_rate_hz=3))

# %%
# **To try.** Another site: `target.site.terrain.seed=4`. More rocks: `rock_fraction`. Your own elevation model: a
# `HeightField` in place of the craters (:doc:`/models`). The map that such frames give:
# :doc:`/auto_gallery/studies/lunar_descent_map`.
