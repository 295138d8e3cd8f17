"""
How do I use my own material?
=============================

Measured values go into a table, a fit into one of the shipped laws, and a formula into a Python object. A material
belongs to a target or to a part of it.
"""

import tempfile
from pathlib import Path

import numpy as np
from PIL import Image

import rso_lidar as rl
from rso_lidar import picture

angles_deg = (0.0, 10.0, 20.0, 40.0, 60.0, 80.0)
measured = rl.scene.TableBrdf(incidence_deg=angles_deg, measured_per_sr=(2.0, 0.6, 0.15, 0.06, 0.05, 0.04))
fitted = rl.Phong(diffuse=0.2, specular=0.5, exponent=40)

# %%
# The values are the BRDF in 1/sr in the direction of the lidar, without the cosine of incidence.
cosines = np.cos(np.array(angles_deg) * rl.units.DEG)
print("Phong at the same angles:", fitted.brdf_per_sr(cosines, cosines, np.ones(6)).round(3))

# %%
# On the whole target, or on a part of it. `rso-lidar models rocket_body` lists the parts.
folder = Path(tempfile.mkdtemp())
clean = rl.Scenario.load("examples/tumbling_inspection.toml")
pictures = []
for name, material in (("table", measured), ("phong", fitted)):
    stage = clean.target[0].replace(material=material)
    frames = rl.simulate(clean.replace(name=f"Rocket stage, {name}", target=(stage,)), frames=[104, 417])
    pictures.append(Image.open(picture.contact_sheet(frames, folder / f"{name}.png", columns=2, rows=1)))
pictures[0]

# %%
pictures[1]

# %%
# Shipped materials: `rso-lidar models materials`. A formula of your own: :doc:`/auto_gallery/own_parts/own_material`.
