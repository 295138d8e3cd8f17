"""
Make a dataset of random views
==============================

A dataset is made from one file that names the classes of targets and the probability law of everything that varies.
This one tells fragments of a break-up from CubeSats; each fragment has a shape of its own.
"""

import tempfile
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

import rso_lidar as rl

folder = Path(tempfile.mkdtemp())

# %%
# Twelve samples of each class. Sample *i* depends on the file and on *i* only: a dataset of any size can be made in
# parts, on any number of machines.
spec = rl.dataset.DatasetSpec.load("examples/datasets/debris.toml")
small = spec.replace(classes=tuple(one.replace(samples=12) for one in spec.classes))
data = rl.dataset.make(small, folder / "debris", workers=1)
print(f"classes {data.classes}, splits {list(data.splits)}")

# %%
# An item is one frame with its labels as arrays, which is what a data loader needs.
items = [data.split("train")[k] for k in range(8)]
print(sorted(items[0]))

# %%
# Eight frames: the reported range less its median. Fragments and CubeSats are some pixels wide, and clutter is in half
# of them.
figure = Figure(figsize=(10, 5.4), layout="constrained")
for axes, item in zip(figure.subplots(2, 4).flat, items, strict=True):
    range_m = item["range_m"]
    seen = np.argwhere(item["target"] >= 0) if (item["target"] >= 0).any() else np.array([[64, 64]])
    row, col = np.median(seen, axis=0).astype(int)
    cut = (slice(max(row - 20, 0), row + 20), slice(max(col - 20, 0), col + 20))
    axes.imshow(range_m[cut] - np.nanmedian(range_m[cut]), vmin=-1, vmax=1)
    axes.set(title=data.classes[int(item["class_id"])], xticks=[], yticks=[])
figure

# %%
# **To try.** ``rso-lidar dataset make examples/learning/seven_craft.toml -o seven`` makes 2,800 views of seven
# spacecraft, and `examples/learning/resnet.py` trains on them. Laws, labels and splits: :doc:`/datasets`; how
# predictions are scored: :doc:`/scoring`.
