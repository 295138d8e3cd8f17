"""
Closed loop: a tracker points the lidar
=======================================

A follower passes below a rocket stage and determines by itself where to point. A controller receives what the
spacecraft could know, the reading and the encoders, and commands the pan-tilt unit. It never sees the truth.
"""

import tempfile
from pathlib import Path

from PIL import Image

import rso_lidar as rl
from rso_lidar import picture

folder = Path(tempfile.mkdtemp())
import numpy as np

scenario = rl.Scenario.load("examples/closed_loop.toml", ("time.duration_s=60",))


def degrees_off_boresight(frame):
    """Return the true angle from the boresight to the stage."""
    x, y, z = frame.truth.pose("lidar", "stage").translation
    return np.arctan2(np.hypot(x, y), z) / rl.units.DEG


# %%
# In open loop the PTU keeps its first angle and loses the stage after some seconds. Half the field is 1.5 degrees.
for frame in rl.simulate(scenario, frames=range(0, 24, 4)):
    print(f"{frame.time_s:4.0f} s  {degrees_off_boresight(frame):5.2f} deg off the boresight")

# %%
# The reference controller gates the returns in range, filters the angles and leads them by the lag of the drive.
controller = rl.track.Pointing(gate_m=20.0, lead_s=0.16)
frames = list(rl.simulate(scenario, controller))
worst = max(degrees_off_boresight(frame) for frame in frames)
print(f"at worst {worst:.3f} deg off the boresight in {scenario.time.duration_s:.0f} s")

# %%
# Demanded, true and measured angles, their errors, and the rates.
picture.ptu_figure(frames, "The PTU in closed loop")

# %%
# The camera is noisy on purpose: some 60 pixels of each frame report a range where there is nothing.
Image.open(picture.animate(frames[::2], folder / "loop.gif", frame_rate_hz=8))

# %%
# **To try.** Remove the lead (`lead_s=0`) and watch the error grow. Raise `ptu.errors.command_latency_s`. Write a
# controller of your own: :doc:`/auto_gallery/own_parts/own_tracker`.
