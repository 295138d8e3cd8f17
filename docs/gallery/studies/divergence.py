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
# The reach by beam, for a facet that fills a pixel and for one of a square metre. Each point is a link budget in closed
# form. A larger aperture helps the small facet only: at a constant f-number a pixel sees less of a large one.
figure = Figure(figsize=(8, 4), layout="constrained")
axes = figure.subplots()
beams_deg = (0.2, 0.4, 0.8, 1.6)
lidar = divergence.camera(105.0, divergence.TRIGGER)
for name, facet_m2 in (("fills a pixel", None), ("1 m²", 1.0)):
    reach_km = [divergence.reach_m(lidar, beam_deg, facet_m2) / 1e3 for beam_deg in beams_deg]
    axes.loglog(beams_deg, reach_km, "o-", label=name)
axes.axhline(10.0, ls="--")
axes.set(
    xlabel="full divergence [deg]",
    ylabel="range of 95 % [km]",
    title="50 mJ, 105 mm, a facing facet of reflectance 0.30",
)
axes.set_xticks(beams_deg, [f"{beam_deg:g}" for beam_deg in beams_deg])
axes.grid()
axes.legend()
figure

# %%
# The widest beam that still detects a facet of one square metre at 10 km, with the smaller aperture.
beam_deg = divergence.widest_deg(divergence.camera(105.0, divergence.TRIGGER), 10e3, 1.0)
print(f"{beam_deg:.3f} deg, {10e3 * beam_deg * rl.units.DEG:.0f} m wide at 10 km")

# %%
# **To try.** The gate with 16 pulses, `divergence.QUIET`, in place of the trigger. The reasoning is in
# `examples/studies/divergence.md`, the budget in :doc:`/studies`.
