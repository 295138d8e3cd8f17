"""
How do I run headless, on many cores or on a cluster?
=====================================================

Nothing needs a display: pictures are drawn without one. Frames are independent, so they can be divided among
machines in any way, and the bits are the same.
"""

import tempfile
from pathlib import Path

import numpy as np

import rso_lidar as rl

folder = Path(tempfile.mkdtemp())
scenario = rl.Scenario.load("examples/tumbling_inspection.toml")

# %%
# Three jobs of an array, here one after the other. On a command line each is ``rso-lidar run scenario.toml -o
# part_$N.h5 --frames $N:574:3``, with ``--workers`` for the cores of its machine.
for job in range(3):
    rl.save(folder / f"part_{job}.h5", rl.simulate(scenario, frames=range(job, 12, 3)))

# %%
# Put together again, in the order of their numbers: the same as one run.
parts = [rl.open(folder / f"part_{job}.h5") for job in range(3)]
frames = sorted((frame for part in parts for frame in part), key=lambda frame: frame.index)
rl.save(folder / "whole.h5", frames)
at_once = list(rl.simulate(scenario, frames=range(12)))
print(all(np.array_equal(a.range_m, b.range_m, equal_nan=True) for a, b in zip(frames, at_once, strict=True)))

# %%
# In a script, guard ``rl.simulate(..., workers=8)`` by ``if __name__ == "__main__":``. `NUMBA_CACHE_DIR` names a
# folder for compiled code where the home folder is read-only. Containers and more: :doc:`/command_line`.
