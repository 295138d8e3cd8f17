"""
Step 5: own tracker
===================

You close the loop: a controller of your own keeps a rocket stage in the field of view, from nothing but what the sensor
reports. Then you compare its errors with the truth, with the reference controller, and with Kalman filters and ICP.
"""

import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from PIL import Image

import rso_lidar as rl
from rso_lidar import picture

work = Path(tempfile.mkdtemp(prefix="tutorial-"))


def shell(command):
    """Run a command of the package in the folder, and print what it prints."""
    words = [sys.executable, "-m", "rso_lidar", *command.split()[1:]]
    done = subprocess.run(words, cwd=work, capture_output=True, text=True, check=True)
    print(f"$ {command}", done.stdout.rstrip(), sep="\n")


# %%
# The flyby
# ---------
#
# The example ``closed_loop`` is shipped: an inspector passes below a rocket stage at 3 m/s, 400 m away. The lidar is on
# a **pan-tilt unit** (PTU). Its drive has a lag, jitter and encoder noise. At zero it looks along the inspector's +x;
# positive pan turns left, positive tilt looks up. The scenario points it at the stage once, and never again.
#
# .. code-block:: console
#
#    $ rso-lidar new flyby --from closed_loop

subprocess.run(
    [sys.executable, "-m", "rso_lidar", "new", "flyby", "--from", "closed_loop"],
    cwd=work,
    check=True,
    capture_output=True,
)
scenario = rl.Scenario.load(work / "flyby.toml", ("time.duration_s=60",))


def measure_offset_deg(frame):
    """Return how far the stage truly is off the boresight [deg]. Only for judging: no controller sees it."""
    x, y, z = frame.truth.pose("lidar", "stage").translation
    return np.arctan2(np.hypot(x, y), z) / rl.units.DEG


open_loop = list(rl.simulate(scenario))
for frame in open_loop[:24:4]:
    on = (frame.labels.target >= 0).sum()
    print(f"{frame.time_s:5.1f} s  {measure_offset_deg(frame):5.2f} deg off the boresight, {on:4d} pixels on the stage")

# %%
# The field of view is 3° wide. After some seven seconds the stage has left it.
#
# What a controller may know
# --------------------------
#
# After each flash a controller is given an ``Observation``: the reading, the line of sight of each pixel, the
# *measured* pan and tilt, and the settings in force. Truth and labels are not part of it, so a controller cannot cheat
# by accident. It returns a ``Command``, which acts from the next flash on, or None to leave everything as it is.

observation = open_loop[0].observation
print(
    "reading     ", observation.reading.range_m.shape, f"with {np.isfinite(observation.reading.range_m).sum()} returns"
)
print("pan and tilt", np.asarray(observation.pan_tilt_rad).round(4), "rad, as the encoders measure them")
picture.frame_figure(open_loop[0])

# %%
# The sky is full of returns. This camera runs hot: some 60 pixels of each frame report a range where there is nothing.
# A tracker that takes the mean of all returns is pulled to the middle of the field, and the more so the smaller the
# target.
#
# Write one
# ---------
#
# The stage is compact, false alarms are spread over 2 km of range. So we look for the slice of range with the most
# returns, and take the mean of their lines of sight. The boresight has to turn by that much. In lidar axes x is right
# and y is down, so a target on the right needs less pan, and one below needs less tilt.


class SliceTracker:
    """Point at the returns in the fullest slice of range."""

    def __init__(self, slice_m=20.0, min_returns=10):
        self.slice_m, self.min_returns = slice_m, min_returns
        self.fixes = []

    def __call__(self, observation):
        range_m = observation.reading.range_m
        seen = np.isfinite(range_m)
        if seen.sum() < self.min_returns:
            return None
        ranges_m = np.sort(range_m[seen])
        inside = np.searchsorted(ranges_m, ranges_m + self.slice_m) - np.arange(ranges_m.size)
        nearest_m = ranges_m[inside.argmax()]
        if inside.max() < self.min_returns:
            return None
        ours = seen & (range_m >= nearest_m) & (range_m <= nearest_m + self.slice_m)
        right, down, ahead = np.median(observation.line_of_sight[ours], axis=0)
        self.fixes.append((observation.time_s, np.median(range_m[ours])))
        pan_rad, tilt_rad = observation.pan_tilt_rad
        return rl.Command(pan_rad=pan_rad - np.arctan2(right, ahead), tilt_rad=tilt_rad - np.arctan2(down, ahead))


own = list(rl.simulate(scenario, SliceTracker()))
print(f"at worst {max(map(measure_offset_deg, own)):.3f} deg off the boresight, in {scenario.time.duration_s:g} s")

# %%
# It holds. A run with a controller is not parallel, because each frame depends on the ones before. The reference
# controller ``rl.track.Pointing`` adds what ours lacks: it filters its angles and leads the target by the lag of the
# drive.

reference = list(rl.simulate(scenario, rl.track.Pointing(gate_m=20.0, lead_s=0.16)))

figure = Figure(figsize=(8, 4.2), layout="constrained")
axes = figure.subplots()
runs = {"open loop": open_loop, "own tracker": own, "rl.track.Pointing": reference}
for name, frames in runs.items():
    offset_deg = [measure_offset_deg(frame) for frame in frames]
    axes.semilogy([frame.time_s for frame in frames], offset_deg, label=name)
axes.axhline(1.5, ls="--")
axes.text(60, 1.6, "edge of the field", ha="right", va="bottom")
axes.set_xlabel("time [s]")
axes.set_ylabel("stage off the boresight [deg]")
axes.set_ylim(0.005, 30)
axes.legend(loc="center right")
figure

# %%
# In open loop the stage leaves the field. Both trackers keep it near the boresight. Ours lags by a nearly constant
# angle: its command is computed from a flash half a second ago, while the line of sight turns. The scatter is the
# jitter of the drive and the noise of the encoders.

for name, frames in list(runs.items())[1:]:
    offset_deg = np.array([measure_offset_deg(frame) for frame in frames[4:]])
    print(f"{name:18s} rms {np.sqrt(np.mean(offset_deg**2)):.3f} deg, worst {offset_deg.max():.3f} deg")

# %%
# From pointing to position
# -------------------------
#
# Pointing is half of the work. Where *is* the stage, and how is it turned? ``rl.study.tracking`` runs reference
# trackers over recorded frames and reports their errors against truth: the centroid of the points, two Kalman filters
# (constant velocity, and Clohessy-Wiltshire, which knows the orbit), and ICP, which fits the mesh. On the command line
# it is ``rso-lidar track``; a recording is all that it needs.

some = own[8:48]  # 20 seconds; ICP takes a while for each frame
rl.save(work / "flyby.h5", some)
shell("rso-lidar track flyby.h5 --no-icp")

# %%
# How to read it: *right*, *down* and *ahead* are lidar axes. The centroid lies in front of the centre of mass, because
# only the near side is visible: a bias *ahead* of 1.2 m. The filters know the mesh and its mean offset over all views,
# so 0.3 m are left in this one. **NIS**, the normalised innovation squared, tells whether a filter believes its own
# errors. It should be 3 in the mean, one for each axis; below that the filter assumes more noise than there is. Here
# the shape hardly turns, so its scatter over all views is too much to assume, as the last line says.
#
# Your own estimate goes on the same axes. The tracker above kept the range of each fix:

tracker_fixes = SliceTracker()
for frame in some:
    tracker_fixes(frame.observation)
fix_time_s, fix_range_m = np.array(tracker_fixes.fixes).T
true_m = {round(frame.time_s, 3): np.linalg.norm(frame.truth.pose("lidar", "stage").translation) for frame in some}
own_error_m = fix_range_m - np.array([true_m[round(t, 3)] for t in fix_time_s])

table = rl.study.tracking(some, poses=False).table
figure = Figure(figsize=(8, 4), layout="constrained")
axes = figure.subplots()
axes.plot(fix_time_s, own_error_m, "o-", label="own: median range of the slice")
axes.plot(table["time_s"], table["centroid_error_ahead_m"], label="centroid")
axes.plot(table["time_s"], table["cw_error_ahead_m"], label="Clohessy-Wiltshire filter")
axes.axhline(0)
axes.set_xlabel("time [s]")
axes.set_ylabel("error along range [m]")
axes.legend()
figure

# %%
# The attitude comes from ICP: the points are fitted to the mesh, from several guesses at first, and then from the pose
# of the frame before. Six frames are enough to see it.

poses = rl.study.tracking(some[:6]).table
for time_s, place_m, turn_rad, axis_rad in zip(
    poses["time_s"], poses["icp_error_m"], poses["icp_error_rad"], poses["icp_long_axis_error_rad"], strict=True
):
    print(f"{time_s:5.1f} s  place {place_m:.2f} m, long axis {axis_rad / rl.units.DEG:.2f} deg, "
          f"turn in all {turn_rad / rl.units.DEG:.1f} deg")  # fmt: skip

# %%
# Centimetres and about a degree: a few hundred points on a known shape are a strong measurement. The direction of the
# long axis is ten times better than the turn about it, because the body of the stage is nearly round.
#
# The result
# ----------
#
# The whole run, as an animation: a stage held in the field by thirty lines of yours.

Image.open(picture.animate(own[::2], work / "own.gif"))

# %%
# **You have flown a closed loop, from a mesh, an orbit, a laser and a detector to commands and back**, and you know
# what each part of it costs in error.
#
# Exercises
# ---------
#
# 1. Let your tracker lead: the target moves on by one period while the command waits.
#
#    .. dropdown:: Answer
#
#       Keep the pan and tilt of the last fix, and add the difference of the last two directions once more. The
#       direction of a fix in the axes of the inspector is ``pan_rad - arctan2(right, ahead)``, whatever the PTU did
#       between.
#
#       .. code-block:: python
#
#          class Leading(SliceTracker):
#              last = None
#
#              def __call__(self, observation):
#                  command = super().__call__(observation)
#                  if command is None:
#                      return None
#                  now = np.array([command.pan_rad, command.tilt_rad])
#                  step, self.last = (0.0 if self.last is None else now - self.last), now
#                  return rl.Command(pan_rad=now[0] + step[0], tilt_rad=now[1] + step[1]) if np.ndim(step) else command
#
#
#          frames = list(rl.simulate(scenario, Leading()))
#          print(np.sqrt(np.mean([measure_offset_deg(frame) ** 2 for frame in frames[4:]])))
#
#       The rms falls from 0.12° to 0.05°, as good as the reference on this smooth path. On a path with turns the
#       difference of two noisy fixes needs a filter.
#
# 2. The camera runs hotter still. Does the tracker hold with seventy times the false alarms?
#
#    .. dropdown:: Answer
#
#       .. code-block:: python
#
#          for rate in (300, 3000, 20000):
#              noisy = rl.Scenario.load(
#                  work / "flyby.toml", ("time.duration_s=20", f"lidar.detector.false_alarms_per_s={rate}")
#              )
#              frames = list(rl.simulate(noisy, SliceTracker()))
#              print(rate, max(map(measure_offset_deg, frames)))
#
#       It does: the worst offset stays below 0.2°, with 3,700 false pixels of 16,384. A slice of 20 m out of 2 km holds
#       one false alarm in a hundred, some forty pixels against the 600 of the stage.
#
# 3. Run your tracker as a program of its own, as flight software would.
#
#    .. dropdown:: Answer
#
#       ``rso-lidar serve flyby.toml`` puts the simulation behind a socket (``pip install "rso-lidar[loop]"``). The
#       client steps it, and gets the same observations. See the page on the loop.
#
# This was the tutorial. Your next page depends on who you are: :doc:`/readers`.
