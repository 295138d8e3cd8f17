"""
Gyro, star tracker and GNSS beside the lidar
============================================

A follower with an inertial unit, a star tracker and GNSS drifts behind a spinning rocket stage. Their samples reach
a controller with the next flash, and a recording holds them beside the frames.
"""

import tempfile
from pathlib import Path

from PIL import Image

import rso_lidar as rl
from rso_lidar import picture

folder = Path(tempfile.mkdtemp())
import numpy as np
from matplotlib.figure import Figure

scenario = rl.Scenario.load("examples/onboard_sensors.toml")
for sensor in scenario.sensor:
    print(f"{sensor.name:14s} {sensor.rate_hz:5.0f} Hz  preset {sensor.preset}")

# %%
# A recording gives each sensor as one series over all frames.
path = rl.save(folder / "sensors.h5", rl.simulate(scenario))
recording = rl.open(path)
gyro, gnss = recording.sensors["gyro"], recording.sensors["gnss"]

figure = Figure(figsize=(9, 6), layout="constrained")
upper, lower = figure.subplots(2, sharex=True)
upper.plot(gyro.time_s, gyro.angular_velocity_rad_s / rl.units.DEG, label=["x", "y", "z"])
upper.set(ylabel="rate [deg/s]", title="Gyro, in its own axes")
upper.legend(ncols=3, loc="upper right")
there = gnss.valid & np.isin(gnss.time_s, recording.time_s)
true_m = np.array([frame.truth.states["follower"].position_m for frame in recording])
error_m = gnss.position_m[there] - true_m[np.searchsorted(recording.time_s, gnss.time_s[there])]
lower.plot(gnss.time_s[there], error_m, ".", label=["x", "y", "z"])
lower.axvspan(30, 40, alpha=0.15)
lower.set(xlabel="time [s]", ylabel="error [m]", title="GNSS less truth, inertial axes; shaded: outage")
lower.legend(ncols=3)
figure

# %%
# The lidar sees the stage meanwhile.
Image.open(picture.contact_sheet(recording, folder / "sheet.png", columns=4, rows=2))

# %%
# **To try.** Give the star tracker a longer `latency_s`. Read the example script, which estimates the attitude from
# gyro and star tracker alone. Error models and sources: :doc:`/sensors`.
