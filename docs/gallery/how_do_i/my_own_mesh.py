"""
How do I use my own mesh, and its units?
========================================

Any STL, OBJ, PLY, glTF or OFF file can be a target. Meshes rarely state their unit, so you do: `scale` is metres in
one unit of the file, and `size_m` is the longest side.
"""

import tempfile
from pathlib import Path

import trimesh

import rso_lidar as rl
from rso_lidar import picture

# %%
# A mesh in millimetres, as a drawing program might write it.
folder = Path(tempfile.mkdtemp())
body = trimesh.creation.box((2000, 1500, 1500))
wings = trimesh.creation.box((100, 9000, 1200))
dish = trimesh.creation.cone(radius=900, height=500).apply_translation([1000, 0, 0])
trimesh.util.concatenate([body, wings, dish]).export(folder / "craft.stl")

# %%
# In metres it is 9 m wide. The centre of mass is the origin of the body axes; if it is not stated, the file's origin
# is taken and a warning says so.
craft = rl.Target(
    name="craft",
    model=str(folder / "craft.stl"),
    scale=0.001,
    center_of_mass_m=(0.0, 0.0, 0.0),
    material="white_paint",
    motion=rl.Fixed(position_m=(120.0, 0.0, 0.0)),
    attitude=rl.FixedAttitude(euler_zyx_deg=(150.0, 20.0, 0.0)),
)
bench = rl.Scenario.load("examples/second_bounce.toml")
scenario = bench.replace(name="A mesh of one's own", target=(craft,), lidar=bench.lidar.replace(bounces=1))
print("sides in metres:", rl.scene.load_mesh(folder / "craft.stl").size_m * craft.scale)

# %%
picture.frame_figure(next(rl.simulate(scenario, frames=[0])))

# %%
# `rso-lidar models check craft.stl` looks for holes, flipped windings, hidden facets and implausible sizes, and
# `rso-lidar models add` puts it into your library: :doc:`/models`.
