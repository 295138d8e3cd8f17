"""
How do I get labels of each pixel?
==================================

Each frame has them: target, part, facet, true range, photons, incidence and filled share of every pixel, aligned
with the reading.
"""

import numpy as np
from matplotlib.figure import Figure

import rso_lidar as rl

scenario = rl.Scenario.load("examples/proximity_1570.toml")
frame = next(rl.simulate(scenario, frames=[20]))
names = frame.source.targets[0].parts
print({name: int((frame.labels.part == k).sum()) for k, name in enumerate(names) if (frame.labels.part == k).any()})

# %%
# Segmentation, true range, incidence and photons. Sky is -1 or NaN.
panels = {
    "part": np.where(frame.labels.part >= 0, frame.labels.part, np.nan),
    "true range [m]": frame.labels.range_m,
    "cosine of incidence": frame.labels.cos_incidence,
    "log10 photons": np.log10(np.where(frame.labels.photons > 1, frame.labels.photons, np.nan)),
}
figure = Figure(figsize=(10, 8), layout="constrained")
for axes, (title, values) in zip(figure.subplots(2, 2).flat, panels.items(), strict=True):
    shown = axes.imshow(values, cmap="tab20" if title == "part" else None, interpolation="nearest")
    axes.set(title=title, xticks=[], yticks=[])
    figure.colorbar(shown, ax=axes, shrink=0.85)
figure

# %%
# A bounding box of the target, and the labels of the points only.
rows, cols = np.nonzero(frame.labels.target >= 0)
print("box:", rows.min(), cols.min(), rows.max(), cols.max())
points, part = frame.points_m[frame.valid], frame.labels.part[frame.valid]
print(points.shape, part.shape)

# %%
# Whole datasets with splits: :doc:`/auto_gallery/learning/make_a_dataset`. Meaning of each label: :doc:`/records`.
