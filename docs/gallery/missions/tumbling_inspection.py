"""
Inspection of a tumbling rocket stage
=====================================

An inspector flies once around a spent upper stage, on a 2:1 ellipse that needs no thrust. The stage tumbles free of
torque about its axis of greatest inertia, and the axis wobbles.
"""

import tempfile
from pathlib import Path

from PIL import Image

import rso_lidar as rl
from rso_lidar import picture

folder = Path(tempfile.mkdtemp())
scenario = rl.Scenario.load("examples/tumbling_inspection.toml")

# %%
# Twelve frames of one revolution. White paint, bare metal and gold foil have different BRDFs, so that the intensity
# shows the tank, the nozzle and the pressure bottles. Bare metal that faces the lidar glints and saturates the
# converter.
frames = list(rl.simulate(scenario, frames=range(0, 574, 52)))
Image.open(picture.contact_sheet(frames, folder / "sheet.png", columns=4, rows=3))

# %%
# A frame at the closest range. The lower panels need the truth that each frame carries: the part that each pixel saw,
# and range minus true range.
nearest = min(frames, key=lambda frame: frame.truth.pose("lidar", "stage").translation[2])
picture.frame_figure(nearest)

# %%
# The ellipse in the rtn axes of the stage: 250 m along the track and 125 m radially.
picture.orbit_figure(frames, "stage")

# %%
# The truth of the attitude is in each frame. The wobble of a torque-free body shows in the body rates, which are not
# constant although no torque acts.
for frame in frames[:6]:
    _, rate = frame.truth.rates("inertial", "stage")
    print(f"{frame.time_s:6.0f} s  body rates {rate / rl.units.DEG} deg/s")

# %%
# **To try.** Add a cross-track velocity to the follower's `velocity_m_s`. Change `body_rate_deg_s`. Track the pose:
# :doc:`/auto_gallery/studies/tumbling`.
