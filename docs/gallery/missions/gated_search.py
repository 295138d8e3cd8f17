"""
Search behind a range gate
==========================

A small laser finds a rocket stage 6 km away by tens of photons per pixel, too few for a trigger. Behind a range gate
all pixels store the same stretch of time, 32 pulses are averaged, and the gate moves with the ephemeris of the
stage.
"""

import tempfile
from pathlib import Path

from PIL import Image

import rso_lidar as rl
from rso_lidar import picture

folder = Path(tempfile.mkdtemp())
scenario = rl.Scenario.load("examples/gated_search.toml")

# %%
# Three frames with their stored samples, which a run keeps when it is asked to.
frames = list(rl.simulate(scenario, frames=[0, 17, 35], keep=["waveforms"]))
Image.open(picture.contact_sheet(frames, folder / "sheet.png", columns=3, rows=1))

# %%
# The brightest waveform of the first frame: a pulse of some 30 counts above a noise that 32 pulses have
# averaged.
from matplotlib.figure import Figure

waveforms = frames[0].kept["waveforms"]
brightest = waveforms.samples_counts.max(axis=1).argmax()
samples = waveforms.samples_counts[brightest]
figure = Figure(figsize=(8, 3.5), layout="constrained")
axes = figure.subplots()
axes.plot(samples, drawstyle="steps-mid")
axes.set(xlabel="sample", ylabel="ADC counts", title="What one pixel stored at 6 km")
axes.grid()
figure

# %%
# The figure of a frame shows how few pixels of 32 × 32 the stage covers.
picture.frame_figure(frames[-1])

# %%
# **To try.** Average 4 pulses instead of 32 (`lidar.detector.gate.pulses=4`). Use the trigger of the preset without
# the gate and see nothing. How a gate sets its threshold: :doc:`/instrument`.
