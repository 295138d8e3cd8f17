"""
A material of your own
======================

The dust of an airless body, put on a rocket stage. A material is any object with a method `brdf_per_sr`: three
cosines in, the BRDF out, without the cosine of incidence.
"""

import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from PIL import Image

import rso_lidar as rl
from rso_lidar import picture


@dataclass(frozen=True)
class Dust:
    """Single scattering in a thick layer (Lommel and Seeliger): at full phase all of it is equally bright."""

    albedo: float

    def brdf_per_sr(self, cos_in, cos_out, cos_phase):
        return self.albedo / (4.0 * np.pi * np.maximum(cos_in + cos_out, 1e-3))


# %%
# At full phase a layer of dust is equally bright at all angles of incidence: the full Moon has no dark limb. White
# paint gets darker toward the edge of the tank.
folder = Path(tempfile.mkdtemp())
clean = rl.Scenario.load("examples/tumbling_inspection.toml")
stage = clean.target[0].replace(material=Dust(albedo=0.9))
dusty = clean.replace(name="Rocket stage, covered with dust", target=(stage,))
pictures = []
for name, scenario in (("clean", clean), ("dusty", dusty)):
    frames = rl.simulate(scenario, frames=[104, 417])
    pictures.append(Image.open(picture.contact_sheet(frames, folder / f"{name}.png", columns=2, rows=1)))
pictures[0]

# %%
# The same two frames with dust.
pictures[1]

# %%
# **To try.** Dust on one part only: `part_materials`. Measured data instead of a formula:
# :doc:`/auto_gallery/how_do_i/my_own_material`. The protocol is `rl.scene.Material`.
