"""
How far can a network classify?
===============================

The network of Fuller et al. needs some 100 pixels on the target. How far is that, for which spacecraft, and does the
light reach as far?
"""

import importlib.util

from matplotlib.figure import Figure

from rso_lidar.shipped import shipped

place = importlib.util.spec_from_file_location("classify", shipped("examples/studies/classify.py"))
classify = importlib.util.module_from_spec(place)
place.loader.exec_module(classify)

# %%
# Silhouettes in random attitudes give the range at which the target covers 100 pixels, and the signal chain says how
# many of them report. Three craft and six attitudes here; the study has seven and forty.
models = {name: name for name in ("tdrs", "juno", "stardust")}
rows = classify.study(models, attitudes=6)
for row in rows:
    print(
        f"{row['craft']:10s} {row['longest_m']:5.1f} m long, 100 pixels at {row['worst_m']:4.0f} to {row['best_m']:4.0f} m, "
        f"{row['detected']:4.0f} pixels report at {row['mean_m']:.0f} m"
    )

# %%
figure = Figure(figsize=(8, 3.4), layout="constrained")
axes = figure.subplots()
for place, row in enumerate(rows):
    axes.plot([row["worst_m"], row["best_m"]], [place, place], lw=6, alpha=0.4, color="C0")
    axes.plot(row["mean_m"], place, "o", color="C0")
    axes.plot(row["box_range_m"], place, "x", color="C1")
axes.set_yticks(range(len(rows)), [row["craft"] for row in rows])
axes.set(xlabel="range of 100 pixels [m]", title="Bar: attitudes; dot: mean; cross: estimate from the bounding box")
axes.set_ylim(-0.6, len(rows) - 0.4)
axes.grid(axis="x")
figure

# %%
# **To try.** Your own meshes in place of the shipped models. Another lens: change `classify.CAMERA`. The reasoning is
# in `examples/studies/classify.md`.
