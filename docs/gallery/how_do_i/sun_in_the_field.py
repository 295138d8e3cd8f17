"""
When is the Sun in the field?
=============================

A timeline tells it for a whole encounter without a flash: the angle of the Sun to the boresight, the phase angle,
and eclipses.
"""

import numpy as np
from matplotlib.figure import Figure

import rso_lidar as rl

scenario = rl.Scenario.load("examples/ghosts_and_glare.toml")
plain = rl.Lidar(
    receiver={"fov_deg": 5, "f_number": 1.8, "rays_per_pixel": 4}
)  # a simple lens: only angles are asked for
table = rl.timeline(scenario.replace(lidar=plain), every_s=40.0, casts=4).table
off_deg = np.array(table["sun_off_boresight_rad"]) / rl.units.DEG
figure = Figure(figsize=(8, 3.5), layout="constrained")
axes = figure.subplots()
axes.plot(table["time_s"], off_deg, ".-")
axes.axhline(2.5, ls="--", label="half of the field")
axes.set(xlabel="time [s]", ylabel="Sun off the boresight [deg]", title="The Sun passes behind the satellite")
axes.grid()
axes.legend()
figure

# %%
inside = off_deg < 2.5
print(f"in the field for {inside.mean():.0%} of the time, nearest {off_deg.min():.2f} deg")

# %%
# `[constraints]` with `sun_exclusion_deg` lets `rso-lidar check` report violations. What sunlight does to a frame:
# :doc:`/auto_gallery/instrument/ghosts_and_glare`.
