"""
Which beam for 10 km?
=====================

The camera has 50 mJ. Wide beams find a target whose place is uncertain, narrow beams reach far. How wide may the
beam be, so that 95 % of the flashes detect a facet at 10 km?
"""

import importlib.util

from matplotlib.figure import Figure

import rso_lidar as rl
from rso_lidar.shipped import shipped

place = importlib.util.spec_from_file_location("divergence", shipped("examples/studies/divergence.py"))
divergence = importlib.util.module_from_spec(place)
place.loader.exec_module(divergence)

# %%
# The reach of a facet that fills a pixel, by beam and aperture. Each point is a link budget in closed form.
figure = Figure(figsize=(8, 4), layout="constrained")
axes = figure.subplots()
beams_deg = (0.2, 0.4, 0.8, 1.6)
for aperture_mm in (105.0, 200.0):
    lidar = divergence.camera(aperture_mm, divergence.TRIGGER)
    reach_km = [divergence.reach_m(lidar, beam_deg, None) / 1e3 for beam_deg in beams_deg]
    axes.loglog(beams_deg, reach_km, "o-", label=f"aperture {aperture_mm:.0f} mm")
axes.axhline(10.0, color="0.6", ls="--")
axes.set(xlabel="full divergence [deg]", ylabel="range of 95 % [km]", title="50 mJ, a facing facet of reflectance 0.30")
axes.grid(alpha=0.3, which="both")
axes.legend()
figure

# %%
# The widest beam that still detects a facet of one square metre at 10 km, with the smaller aperture.
beam_deg = divergence.widest_deg(divergence.camera(105.0, divergence.TRIGGER), 10e3, 1.0)
print(f"{beam_deg:.3f} deg, {10e3 * beam_deg * rl.units.DEG:.0f} m wide at 10 km")

# %%
# **To try.** The gate with 16 pulses, `divergence.QUIET`, in place of the trigger. The reasoning is in
# `examples/studies/divergence.md`, the budget in :doc:`/studies`.
