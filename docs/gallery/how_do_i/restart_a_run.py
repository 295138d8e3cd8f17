"""
How do I restart an interrupted run?
====================================

Each frame is complete on disk before the next begins. An unfinished file has a temporary name, can be read, and the
same command with ``--resume`` continues it.
"""

import tempfile
from pathlib import Path

import rso_lidar as rl

folder = Path(tempfile.mkdtemp())
scenario = rl.Scenario.load("examples/tumbling_inspection.toml")


def interrupted(frames):
    """Yield three frames and stop as Ctrl-C would."""
    for number, frame in enumerate(frames):
        if number == 3:
            raise KeyboardInterrupt
        yield frame


try:
    rl.save(folder / "stage.h5", interrupted(rl.simulate(scenario, frames=range(6))))
except KeyboardInterrupt:
    print("interrupted")

# %%
# What is there now, and what it holds:
for left in folder.iterdir():
    print(left.name.split("-")[0] + "-<id>" if "tmp" in left.name else left.name, len(rl.open(left).time_s), "frames")

# %%
# On the command line: ``rso-lidar run scenario.toml -o stage.h5 --resume``. Frames depend on their numbers only, so
# that in Python the rest can be made alone, too: ``rl.simulate(scenario, frames=range(3, 6))``. How files are
# protected: :doc:`/records`.
