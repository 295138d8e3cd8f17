"""
A trade: lens and energy
========================

Which lens and how much energy find a relay satellite at 3 km? A trade study is a file that names a scenario, the
fields that vary, and the figures of merit. It gives one table and one report.
"""

import numpy as np
from matplotlib.figure import Figure

import rso_lidar as rl

# %%
# The shipped study has 36 points with eight flashes each. These are its lens and its energy only, with two flashes.
study = rl.study.Study.load("examples/studies/trade_lens.toml")
small = study.replace(axis=study.axis[1:], frames=[0, 72], report={"pictures": 0})
made = rl.trade(small)
table = made.table
print(*table)

# %%
# Rows are points. The share of the target's pixels that report rises with the energy and with the aperture.
figure = Figure(figsize=(8, 4), layout="constrained")
axes = figure.subplots()
f_number, energy_mj = table["lidar.receiver.f_number"], table["lidar.laser.energy_mj"]
for value in np.unique(f_number):
    rows = f_number == value
    axes.semilogx(energy_mj[rows], table["detection_fraction"][rows], "o-", label=f"f/{value:g}")
axes.axhline(small.min_detection_fraction, ls="--", label="ranked above")
axes.set(xlabel="pulse energy [mJ]", ylabel="detection fraction", title="TDRS at 3 km, beam of 2.5 degrees")
axes.grid()
axes.legend()
figure

# %%
# **To try.** `made.save("lens.html")` writes the report, `rso-lidar trade` does both. Add an axis: any field of a
# scenario can be one. Figures of merit: :doc:`/studies`.
