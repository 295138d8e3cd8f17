"""
What does a tracker know of a tumbling stage?
=============================================

A follower comes along the V-bar in five hops from 2 km to 50 m. Filters of the position and ICP on the shape run on
the recording, and their errors against the truth say what they know when.
"""

import importlib.util

import numpy as np

import rso_lidar as rl
from rso_lidar import picture
from rso_lidar.shipped import shipped

place = importlib.util.spec_from_file_location("tumbling", shipped("examples/studies/tumbling.py"))
tumbling = importlib.util.module_from_spec(place)
place.loader.exec_module(tumbling)

# %%
# The study flies 1350 frames with each of two cameras. These are two minutes of the second hop, from 940 m on, with
# the camera as it is. ICP aligns the mesh of the stage with each cloud of points and starts from the pose before.
approach = tumbling.scenario(None)
frames = list(rl.simulate(approach, frames=range(420, 480, 2)))
made = rl.study.tracking(frames)
picture.frame_figure(frames[15])

# %%
# The errors over time: place and turn by ICP, and the filters of the position beside it.
made.figure()

# %%
# In numbers. The middle of what is seen lies before the centre of mass, and no average removes that; the shape does.
table = made.table
for name, column in (("centroid", table["centroid_error_ahead_m"]), ("ICP", table["icp_error_m"])):
    print(f"{name:9s} median error {np.nanmedian(column):+.2f} m")
print(f"long axis {np.nanmedian(table['icp_long_axis_error_rad']) / rl.units.DEG:.2f} deg")

# %%
# **To try.** `tumbling.flown(tumbling.ZOOM)` flies the zoom lens, whose diffuser and energy follow the range. The
# reasoning is in `examples/studies/tumbling.md`, the trackers in :doc:`/tracking`.
