"""
How do I export frames with their truth?
========================================

A recording holds everything that a frame contains: reading, true poses of all bodies, and labels of each pixel.
Exports are made from it, or directly from a run.
"""

import tempfile
from pathlib import Path

import rso_lidar as rl

folder = Path(tempfile.mkdtemp())
scenario = rl.Scenario.load("examples/tumbling_inspection.toml")
rl.save(folder / "stage.h5", rl.simulate(scenario, frames=range(4)))

# %%
# One line gives another format; the suffix chooses it. Clouds have target and part of each point, `.npz` has all
# arrays, `.tum` the poses.
with rl.open(folder / "stage.h5") as recording:
    rl.save(folder / "clouds.pcd", recording)
    rl.save(folder / "arrays.npz", recording)
    rl.save(folder / "poses.tum", recording, target="stage")
for path in sorted(folder.rglob("*")):
    if path.is_file():
        print(f"{path.relative_to(folder)!s:24s} {path.stat().st_size / 1024:8.1f} kB")

# %%
# In Python a frame has it all. Poses are named `a_from_b`.
frame = rl.open(folder / "stage.h5")[0]
print("lidar_from_stage, position:", frame.truth.pose("lidar", "stage").translation)
print(
    "pixels by part:",
    {part: int((frame.labels.part == k).sum()) for k, part in enumerate(frame.source.targets[0].parts)},
)

# %%
# Formats and what each loses: :doc:`/exports`. The layout of the file: :doc:`/records`.
