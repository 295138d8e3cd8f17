"""
Thrusters in the loop
=====================

A follower with thrusters starts 120 m behind a rocket stage with a velocity in the wrong direction. Its controller
sees only the readings of the lidar, and commands accelerations. The equations of motion are the user's own function.
"""

import importlib.util
import tempfile
from pathlib import Path

from matplotlib.figure import Figure
from PIL import Image

import rso_lidar as rl
from rso_lidar import picture
from rso_lidar.shipped import shipped

folder = Path(tempfile.mkdtemp())

# %%
# The example is a scenario and a Python file beside it. The scenario names its dynamics as `dynamics =
# "thrusters.py:relative_motion"`. The file holds a controller, too: a spring with a damper on a smoothed centroid of
# the returns.
place = importlib.util.spec_from_file_location("thrusters", shipped("examples/thrusters.py"))
thrusters = importlib.util.module_from_spec(place)
place.loader.exec_module(thrusters)
scenario = rl.Scenario.load("examples/thrusters.toml", trust_code=True)

# %%
# Twice the same start: without commands, and with the controller.
flights = {
    "drifting": list(rl.simulate(scenario, frames=range(0, 480, 20))),
    "holding": list(rl.simulate(scenario, thrusters.Hold())),
}
for name, frames in flights.items():
    radial, along, cross = frames[-1].truth.pose("stage.rtn", "follower").translation
    print(f"{name:9s} after {frames[-1].time_s:.0f} s: {radial:6.1f} {along:7.1f} {cross:6.1f} m in rtn axes")

# %%
# The two paths, seen from across the track.
figure = Figure(figsize=(8, 4.5), layout="constrained")
axes = figure.subplots()
for name, frames in flights.items():
    path = [frame.truth.pose("stage.rtn", "follower").translation for frame in frames]
    axes.plot([p[1] for p in path], [p[0] for p in path], label=name)
axes.plot(0, 0, "*", color="C2", ms=12, label="stage")
axes.set(xlabel="along-track [m]", ylabel="radial [m]", title="The follower in the rtn axes of the stage")
axes.grid()
axes.legend()
figure

# %%
# What the lidar saw while the controller held its place.
Image.open(picture.contact_sheet(flights["holding"], folder / "sheet.png", columns=4, rows=3))

# %%
# **To try.** Weaken the damping in a subclass of `thrusters.Hold` and see it overshoot. Give the detector more false
# alarms. Fly the same loop from another process: :doc:`/auto_gallery/connect/flight_software`.
