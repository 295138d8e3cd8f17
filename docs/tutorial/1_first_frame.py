"""
Step 1: first frame
===================

You simulate one flash of a lidar at a relay satellite, look at what the sensor reports, and compare it with what was
really there.

A **flash lidar** is a camera with a pulsed laser. One pulse lights the whole field. Each pixel then measures when its own
light comes back, which gives a range, and how much, which gives an intensity. The simulator follows that light: orbits say
where the satellite is, rays say which part of it each pixel sees, optics say how many photons return, and a model of the
detector turns photons into counts, with noise.
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

work = Path(tempfile.mkdtemp(prefix="tutorial-"))  # all files of this page; your own folder does as well

# %%
# On the command line
# -------------------
#
# Most work can be done without Python. In your terminal you type what stands behind the ``$`` below. On this page, the
# function ``shell`` does it, so that you see what the commands really print.


def shell(command):
    """Run a command of the package in the folder, and print what it prints."""
    words = [sys.executable, "-m", "rso_lidar", *command.split()[1:]]
    done = subprocess.run(words, cwd=work, capture_output=True, text=True, check=True)
    print(f"$ {command}", done.stdout.rstrip(), sep="\n")


# %%
# ``new`` writes a scenario to start from. A scenario is one text file (TOML) that describes a mission: time, targets,
# the *follower* (the spacecraft that carries the lidar), and the lidar. Every number carries its unit in its name.
#
# .. code-block:: console
#
#    $ rso-lidar new approach --from tdrs_approach

subprocess.run([sys.executable, "-m", "rso_lidar", "new", "approach"], cwd=work, check=True, capture_output=True)
text = (work / "approach.toml").read_text()
print(text[text.index("version") :])

# %%
# The follower moves from 3 km behind a relay satellite to 300 m behind it, in 45 minutes. ``run`` simulates and
# records. Here we ask for every 60th of the 540 frames.

shell("rso-lidar run approach.toml -o approach.h5 --frames 0:540:60")

# %%
# *On target* counts the pixels whose light comes from the satellite, and how many of them reported a range. *False
# triggers* are pixels that reported a range although nothing was there. ``plot`` draws all frames of the recording.

shell("rso-lidar plot approach.h5 -o approach.png")
Image.open(work / "approach.png")

# %%
# Each pair shows range on the left and intensity on the right, and is cropped to the satellite; the orange square shows
# where the crop is in the field.
#
# - **The first frames have holes.** The light of a pixel falls with the square of the range. At 3 km a pixel gets a few
#   hundred photons, and this detector needs about 780 to trigger in half of all flashes.
# - **Colours change across the satellite**, because one end of the solar array is nearer than the other. They are
#   relative to the median of each frame; otherwise the approach itself would hide the shape.
# - **Intensity is higher where a surface faces the lidar**, and grows as the satellite comes near.
# - **Single pixels far from the satellite** are false alarms: noise of the amplifier that crosses the threshold.
#
# In Python
# ---------
#
# The same file gives the same frames in Python. ``frames`` picks some of them: frame 520 is at 2600 s.

scenario = rl.Scenario.load(work / "approach.toml")
frame = next(rl.simulate(scenario, frames=[520]))
print(frame)

# %%
# What the sensor reports is an array per quantity, one value for each pixel. Row 0 is at the top, and columns grow to
# the right. A pixel without a return is NaN in range and 0 in intensity, never a range of zero.

print(frame.range_m.shape, frame.range_m.dtype, "range [m]")
print(frame.intensity_counts.shape, frame.intensity_counts.dtype, "intensity [counts of the converter]")
print(f"{frame.valid.sum()} of {frame.valid.size} pixels report a range")

picture.frame_figure(frame)

# %%
# ``points_m`` holds the same ranges as points, in **lidar axes**: z along the boresight, x to the right, y down. A
# point is the range times the line of sight of its pixel. Range is measured along the line of sight from the lens, so
# it is not the z coordinate; at the edge of this field of 2.5° the two differ by 0.02 %, which is 9 cm at 400 m.

points_m = frame.points_m[frame.valid]
x, y, z = points_m.T
center_m = frame.truth.pose("lidar", "tdrs").translation
on_target = np.abs(z - center_m[2]) < 20.0

figure = Figure(figsize=(9, 4), layout="constrained")
front, top = figure.subplots(1, 2)
for axes, (across, up), names in ((front, (x, -y), "x −y"), (top, (x, z - center_m[2]), "x z")):
    shown = axes.scatter(across[on_target], up[on_target], c=z[on_target] - center_m[2], s=2)
    axes.set_aspect("equal")
    axes.set_xlabel(f"{names.split()[0]} [m]")
    axes.set_ylabel(f"{names.split()[1]} [m]" if axes is front else "z − z of the satellite [m]")
front.set_title("as the lidar looks")
top.set_title("from above")
figure.colorbar(shown, label="z − z of the satellite [m]")
figure

# %%
# On the left are the points as the lidar sees them, on the right the same points from above. No lidar sees the back of
# the satellite, so from above there is only one side of it. The scatter along z is the noise of the ranges, about 5 cm.
#
# Truth and labels
# ----------------
#
# A simulator knows what a sensor cannot. Each frame carries two kinds of it, kept apart from the reading:
#
# - ``frame.truth``: where everything was. ``pose("lidar", "tdrs")`` takes coordinates in the axes of the satellite to
#   coordinates in lidar axes. This ``a_from_b`` order is used throughout.
# - ``frame.labels``: for each pixel, what it really saw: target, part, true range, expected photons. −1 is sky.

lidar_from_tdrs = frame.truth.pose("lidar", "tdrs")
print("centre of mass in lidar axes [m]:", lidar_from_tdrs.translation.round(2))

error_m = frame.range_m - frame.labels.range_m
seen = frame.valid & (frame.labels.target >= 0)
print(f"range error on the satellite: median {1e3 * np.median(error_m[seen]):+.1f} mm, "
      f"spread {1.4826 * np.median(np.abs(error_m[seen] - np.median(error_m[seen]))):.3f} m")  # fmt: skip
print(f"false alarms in the sky: {(frame.valid & (frame.labels.target < 0)).sum()}")

# %%
# The error of the ranges has two causes: the noise of the detector, and pixels at edges that see two surfaces at once.
# The first is a bell, the second its long tails. The label of a part shows the edges.

parts = frame.source.targets[0].parts
figure = Figure(figsize=(9.5, 3.8), layout="constrained")
left, right = figure.subplots(1, 2)
left.imshow(np.ma.masked_less(frame.labels.part, 0), cmap="tab20", interpolation="nearest")
left.set_title("label: part of the satellite")
left.set_xlabel("column")
left.set_ylabel("row")
edge = seen & (frame.labels.cluster_count > 1)
bins = np.linspace(-0.5, 0.5, 81)
right.hist(error_m[seen & ~edge], bins, label="one surface in the pixel")
right.hist(error_m[edge], bins, label="two or more surfaces")
right.set_xlabel("range error [m]")
right.set_ylabel("pixels")
right.legend()
figure

# %%
# The noise is random, but it is not arbitrary: frame *k* depends on the scenario, its ``seed`` and *k*, and on nothing
# else. The same frame made again has the same bits, alone or among others. Another seed has other noise about the same
# truth.

again = next(rl.simulate(scenario, frames=[520]))
other = next(rl.simulate(scenario.with_seed(1), frames=[520]))
both = frame.valid & other.valid & seen
print("same seed, same bits:", np.array_equal(frame.range_m, again.range_m, equal_nan=True))
print(
    f"other seed: ranges differ by {np.std((frame.range_m - other.range_m)[both & ~edge]):.3f} m (standard deviation)"
)

# %%
# That is the square root of two times the noise of one range, because both frames have noise.
#
# **The result.** You have recorded an approach, found the satellite in it, and measured the precision of the sensor
# against truth: about 5 cm. You have used no more than one file and thirty lines of Python.
#
# Exercises
# ---------
#
# 1. At which range does the lidar first see half of the satellite's pixels? Use the recording.
#
#    .. dropdown:: Answer
#
#       The share of the pixels on target that are valid, frame by frame. It passes one half at about 2.3 km and 90 % at
#       1.2 km. At the edges of thin parts some pixels stay dim to the end.
#
#       .. code-block:: python
#
#          for frame in rl.open(work / "approach.h5"):
#              on = frame.labels.target >= 0
#              print(f"{np.nanmedian(frame.labels.range_m[on]):7.1f} m  {frame.valid[on].mean():.2f}")
#
# 2. What does half of the laser's energy do to that range?
#
#    .. dropdown:: Answer
#
#       Photons go with energy / range², so the same light comes from a range smaller by the square root of two: half
#       of the pixels at 1.7 km in place of 2.3 km. Change the file, or set the field on the command line:
#
#       .. code-block:: console
#
#          $ rso-lidar run approach.toml -o half.h5 --frames 0:540:60 --set lidar.laser.energy_mj=25
#
# 3. Make the sky quiet: what happens without false alarms?
#
#    .. dropdown:: Answer
#
#       ``type = "empirical"`` under ``[lidar.detector]`` is a fast detector with curves instead of a signal chain, and
#       its rate of false alarms is a number, ``false_alarms_per_s = 0``. In the signal chain false alarms follow from
#       noise and threshold: a higher threshold has fewer of them, and a shorter reach.
#
#       .. code-block:: python
#
#          quiet = scenario.replace(lidar=scenario.lidar.replace(detector=rl.Empirical(false_alarms_per_s=0)))
#          frame = next(rl.simulate(quiet, frames=[520]))
#          print((frame.valid & (frame.labels.target < 0)).sum())
#
# Go on with step 2: an orbit of your own.
