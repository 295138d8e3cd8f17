"""
Ghosts and glare: the Sun passes behind a satellite
===================================================

The Sun crosses the field of view and passes behind a relay satellite 250 m away. The lens has two ghosts and
scatters light of the Sun, the Earth and the Moon, and full pixels spill charge to their neighbours.
"""

import tempfile
from pathlib import Path

from PIL import Image

import rso_lidar as rl
from rso_lidar import picture

folder = Path(tempfile.mkdtemp())
scenario = rl.Scenario.load("examples/ghosts_and_glare.toml")

# %%
# From left to right the image of the Sun moves over the focal plane. Where it falls, its noise triggers the pixels
# before the pulse returns, and the range is that of nothing.
frames = list(rl.simulate(scenario, frames=[0, 6, 13, 17, 20, 26]))
Image.open(picture.contact_sheet(frames, folder / "sheet.png", columns=3, rows=2))

# %%
# The Sun in full. Labels are not blinded: the lower left panel shows what is there, the upper ones what the camera
# reports.
picture.frame_figure(frames[2])

# %%
# Ghosts, glare and bloom off, one after the other: pixels that report a wrong range, in the frame with the Sun.
lidar = scenario.lidar
variants = {
    "as it is": lidar,
    "no bloom": lidar.replace(detector=lidar.detector.replace(bloom=None)),
    "no ghosts": lidar.replace(receiver=lidar.receiver.replace(ghosts=())),
    "no glare": lidar.replace(receiver=lidar.receiver.replace(glare=None)),
}
for name, variant in variants.items():
    frame = next(rl.simulate(scenario.replace(lidar=variant), frames=[13]))
    wrong = frame.valid & ~(abs(frame.range_m - frame.labels.range_m) < 1.0)
    print(f"{name:10s} {wrong.sum():5d} pixels report a range more than 1 m off, or where there is nothing")

# %%
# **To try.** A narrower filter (`lidar.receiver.filter_width_nm=0.5`). When is the Sun in the field at all?
# :doc:`/auto_gallery/how_do_i/sun_in_the_field`. Equations and sources: :doc:`/instrument`.
