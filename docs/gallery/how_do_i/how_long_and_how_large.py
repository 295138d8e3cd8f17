"""
How long will a run take, and how large is the file?
====================================================

Fly some frames, measure, and multiply: frames are independent and about equally long for equally large targets.
"""

import tempfile
import time
from pathlib import Path

import rso_lidar as rl

folder = Path(tempfile.mkdtemp())
scenario = rl.Scenario.load("examples/tumbling_inspection.toml")
n_frames = round(scenario.time.duration_s * scenario.time.frame_rate_hz)
few = range(0, n_frames, n_frames // 8)
next(rl.simulate(scenario, frames=[0]))  # compiled code is loaded once
start = time.perf_counter()
path = rl.save(folder / "few.h5", rl.simulate(scenario, frames=few))
seconds, size_mb = time.perf_counter() - start, path.stat().st_size / 1e6
print(f"{len(few)} frames: {seconds:.1f} s, {size_mb:.2f} MB")
print(f"all {n_frames}: about {seconds * n_frames / len(few):.0f} s, {size_mb * n_frames / len(few):.0f} MB")

# %%
# `rso-lidar dataset check` does this for a dataset. Memory does not grow with the number of frames.
