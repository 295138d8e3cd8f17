"""
How do I put two targets into one scene?
========================================

Add a second `[[target]]`. Labels say which target a pixel sees, and each target hides the other.
"""

import tempfile
from pathlib import Path

from PIL import Image

import rso_lidar as rl
from rso_lidar import picture

scenario = rl.Scenario.load("examples/tumbling_inspection.toml")
stage = scenario.target[0]
piece = rl.Target(
    name="cubesat",
    model="cubesat_12u",
    motion=rl.Hill(relative_to="stage", position_m=(0.0, 8.0, 0.0), velocity_m_s=(0.0, 0.0, 0.0)),
    attitude=rl.Spin(axis=(0.0, 1.0, 1.0), rate_deg_s=4.0),
)
both = scenario.replace(name="A stage and a CubeSat", target=(stage, piece))
frames = list(rl.simulate(both, frames=[0, 100, 120, 400, 420, 440]))
for frame in frames:
    counts = [int((frame.labels.target == k).sum()) for k in range(2)]
    print(f"{frame.time_s:6.0f} s  pixels of the stage {counts[0]:5d}, of the CubeSat {counts[1]:3d}")

# %%
Image.open(picture.contact_sheet(frames, Path(tempfile.mkdtemp()) / "sheet.png", columns=3, rows=2))

# %%
# Clutter by the dozen: :doc:`/auto_gallery/learning/make_a_dataset`. Relative motion of any body to any other:
# :doc:`/orbits`.
