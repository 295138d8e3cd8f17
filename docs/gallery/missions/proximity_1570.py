"""
A wide camera at 65 m
=====================

A camera at 1570 nm, 65 to 45 m from a relay satellite in sunlight. What a long-range scenario may leave out is on
here: a lens that blurs and distorts, a laser 8 cm beside it, sunlight behind the filter, speckle, and up to three
returns of a pixel.
"""

import tempfile
from pathlib import Path

from PIL import Image

import rso_lidar as rl
from rso_lidar import picture

folder = Path(tempfile.mkdtemp())
import numpy as np

scenario = rl.Scenario.load("examples/proximity_1570.toml")

# %%
# The two large dishes are brightest where their curved surface faces the lidar. The laser casts shadows of its own,
# because it does not sit behind the lens.
frames = list(rl.simulate(scenario, frames=[0, 13, 26, 39]))
Image.open(picture.contact_sheet(frames, folder / "sheet.png", columns=2, rows=2))

# %%
picture.frame_figure(frames[-1])

# %%
# At an edge one pixel sees two depths. The reading lists up to three returns, nearest first.
returns = frames[-1].observation.reading.return_range_m
count = np.isfinite(returns).sum(axis=2)
for number in (1, 2, 3):
    print(f"{(count == number).sum():5d} pixels with {number} return(s)")

# %%
# **To try.** Put the laser into the lens (`lidar.laser.offset_m=[0, 0, 0]`): the shadows vanish. Sharpen the lens with
# a smaller `sigma_um`, and count the pixels with two returns again. The chain: :doc:`/instrument`.
