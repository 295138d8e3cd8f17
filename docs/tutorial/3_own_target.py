"""
Step 3: own target
==================

You build a small spacecraft as a mesh, give its parts their materials, let its solar array turn, and measure the angle of
the array from the ranges of the lidar.

A **target** is a mesh of triangles with named parts. Any STL, OBJ, PLY, glTF or OFF file will do. Here the mesh is made
with ``trimesh``, which is installed with the package; a model from a CAD program takes its place in the same way.
"""

import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
import trimesh
from matplotlib.figure import Figure

import rso_lidar as rl

work = Path(tempfile.mkdtemp(prefix="tutorial-"))


def shell(command):
    """Run a command of the package in the folder, and print what it prints."""
    words = [sys.executable, "-m", "rso_lidar", *command.split()[1:]]
    done = subprocess.run(words, cwd=work, capture_output=True, text=True, check=True)
    print(f"$ {command}", done.stdout.rstrip(), sep="\n")


# %%
# Build the mesh
# --------------
#
# Body axes are x forward, y left, z up. The craft is a bus of 1 m × 1 m × 1.5 m, and on its left (+y) a boom with a
# solar array of 2 m × 1.2 m. Each part is a closed solid with a name. Coordinates are in metres.


def box(size_m, center_m):
    """Return a box as a mesh."""
    return trimesh.creation.box(size_m, trimesh.transformations.translation_matrix(center_m))


solids = {
    "bus": box((1.0, 1.0, 1.5), (0.0, 0.0, 0.0)),
    "boom": box((0.06, 0.4, 0.06), (0.0, 0.7, 0.0)),
    "array": box((0.03, 2.0, 1.2), (0.0, 1.9, 0.0)),
}
craft = trimesh.Scene()
for name, solid in solids.items():
    craft.add_geometry(solid, geom_name=name, node_name=name)
(work / "craft.glb").write_bytes(craft.export(file_type="glb"))

shell("rso-lidar models check craft.glb")

# %%
# ``models check`` looks before you fly: size, holes, winding, and facets that no ray from outside can meet. Here the
# two facets where boom and bus touch are such. Facets are two-sided in the simulation, so that a wrong winding loses no
# light.
#
# Units
# ~~~~~
#
# The most frequent accident with a mesh is its unit: STL files do not state one, and CAD programs like millimetres.

millimetres = trimesh.util.concatenate([solid.copy().apply_scale(1000.0) for solid in solids.values()])
millimetres.export(work / "craft_mm.stl")
shell("rso-lidar models check craft_mm.stl")

# %%
# The command doubts a spacecraft that is 3400 m across, and says which unit would make sense. In a scenario you would
# write ``scale = 0.001``, or ``size_m = 3.4`` for the longest side. STL also loses the names of parts, which is why
# this tutorial goes on with glTF (``.glb``): it keeps them and is in metres.
#
# Put it into a scenario
# ----------------------
#
# - ``part_materials`` gives each part a material, by a name from ``rso-lidar models materials``, or with numbers of
#   your own.
# - ``joint`` is a hinge: the array and its boom turn about the body's y axis, by 1.5° a second.
# - ``center_of_mass_m`` is the origin of the body, in coordinates of the mesh. If it is left out, it is assumed at the
#   origin of the file, and a warning says so.
# - The attitude ``rtn`` turns the body relative to its orbit. 180° about z would make its +x point down, at an
#   inspector 50 m below; 165°, and 20° about y, show more than one side.

(work / "craft.toml").write_text("""\
version = 1
name    = "A craft of my own"
seed    = 3

[time]
start_utc     = 2024-09-17T12:00:00Z
duration_s    = 64
frame_rate_hz = 0.25                    # every 4 s: the array turns by 6 degrees from frame to frame

[[target]]
name             = "craft"
model            = "craft.glb"          # looked up beside this file
center_of_mass_m = [0, 0, 0]
attitude         = { type = "rtn", euler_zyx_deg = [165, 20, 0] }

[target.part_materials]
bus   = "mli_gold"
boom  = "aluminium"
array = { type = "phong", diffuse = 0.15, specular = 0.10, exponent = 20 }

[target.motion]
type                    = "kepler"
epoch_utc               = 2024-09-17T12:00:00Z
semi_major_axis_km      = 6928.137
eccentricity            = 0.0
inclination_deg         = 97.6
raan_deg                = 35.0
argument_of_perigee_deg = 0.0
true_anomaly_deg        = 0.0

[[target.joint]]
name       = "drive"
parts      = ["boom", "array"]
position_m = [0, 0.5, 0]                # a point of the hinge line, body axes
axis       = [0, 1, 0]
angle      = { type = "fixed", angle_deg = -45, rate_deg_s = 1.5 }

[follower]
motion   = { type = "hill", relative_to = "craft", position_m = [-50, 0, 0], velocity_m_s = [0, 0, 0] }
attitude = { type = "look_at", at = "craft" }

[lidar]
preset   = "gsfl_1064"
laser    = { energy_mj = 1, divergence_deg = 7 }
receiver = { fov_deg = 7 }
""")

scenario = rl.Scenario.load(work / "craft.toml")
frames = list(rl.simulate(scenario))
print(len(frames), "frames;", f"{frames[0].valid.sum()} returns in the first")

# %%
# A key that does not exist, or a material with a wrong name, is an error that names the place and the cure:

try:
    rl.Scenario.load(work / "craft.toml", ('target.0.part_materials.boom="aluminum"',))
except rl.ScenarioError as error:
    print(error)

# %%
# What the lidar sees
# -------------------
#
# Four frames, with the label of the part beside range and intensity.

figure = Figure(figsize=(10, 5.6), layout="constrained")
grid = figure.subplots(3, 4)
parts = scenario.source.targets[0].parts
for column, k in zip(grid.T, (0, 4, 8, 12), strict=True):
    frame = frames[k]
    depth_m = frame.range_m - np.linalg.norm(frame.truth.pose("lidar", "craft").translation)
    column[0].imshow(np.where(frame.labels.target >= 0, depth_m, np.nan), vmin=-0.8, vmax=0.8)
    column[1].imshow(np.log10(np.maximum(frame.intensity_counts, 1)), cmap="gray", vmin=1.0, vmax=2.7)
    column[2].imshow(np.ma.masked_less(frame.labels.part, 0), cmap="tab10", vmin=0, vmax=9)
    column[0].set_title(f"array at {-45 + 1.5 * frame.time_s:+.0f}°")
    for axes in column:
        axes.set_xticks([])
        axes.set_yticks([])
        axes.set_xlim(44, 127)  # columns and rows about the craft
        axes.set_ylim(94, 36)
for row, name in zip(grid, ("range, ±0.8 m", "intensity, log", "label: " + ", ".join(parts)), strict=True):
    row[0].set_ylabel(name)
figure

# %%
# The body is turned by 20° about the axis of the hinge, so the array faces the lidar when the hinge is at −20°. There
# it is brightest: little is lost to the cosine of the tilt, and the lobe of the Phong material (``specular``) sends
# light straight back. At other angles one long edge is nearer than the other, and the light falls. The front of the bus
# is gold foil at 25° from the line of sight; its top and its side are at flatter angles, and darker. Dark pixels at the
# rim of the bus are those that are filled in part.
#
# Measure the angle of the array
# ------------------------------
#
# The test of any simulation is whether one can get back what one put in. Take the points on the array, move them into
# body axes, fit a plane, and compare its tilt with the angle of the hinge. The label picks the points; a tracker of
# yours would have to segment them itself.

array = parts.index("array")
angles = []
for frame in frames:
    on_array = frame.valid & (frame.labels.part == array) & (frame.labels.cluster_count == 1)
    craft_from_lidar = frame.truth.pose("craft", "lidar")
    points_m = craft_from_lidar.apply(frame.points_m[on_array])
    centered_m = points_m - points_m.mean(axis=0)
    normal = np.linalg.svd(centered_m, full_matrices=False)[2][2]
    normal *= np.sign(normal[0])
    measured_deg = np.arctan2(-normal[2], normal[0]) / rl.units.DEG
    angles.append((frame.time_s, -45 + 1.5 * frame.time_s, measured_deg, on_array.sum()))
time_s, true_deg, measured_deg, count = np.array(angles).T

figure = Figure(figsize=(8, 5), layout="constrained")
above, below = figure.subplots(2, 1, sharex=True, height_ratios=(2, 1))
above.plot(time_s, true_deg, label="hinge (truth)")
above.plot(time_s, measured_deg, "o", label="plane through the points")
above.set_ylabel("angle [deg]")
above.legend()
below.plot(time_s, measured_deg - true_deg, "o", color="C1")
below.axhline(0.0)
below.set_xlabel("time [s]")
below.set_ylabel("error [deg]")
figure

# %%

print(f"points on the array: {count.min():.0f} to {count.max():.0f}")
print(
    f"error of the angle: mean {np.mean(measured_deg - true_deg):+.2f} deg, rms {np.std(measured_deg - true_deg):.2f} deg"
)

# %%
# **The result.** A noise of 5 cm on each range, and half a degree on a panel 1.2 m wide: the mean over many points is
# at work. Independent errors would give 5 cm / (0.35 m · √1000) = 0.26°, with 0.35 m the rms distance of the points
# from the hinge.
#
# ``frame.truth.pose("lidar", "craft.drive")`` is the pose of the hinge itself: each joint has axes in the tree of
# poses.
#
# Exercises
# ---------
#
# 1. Paint the bus black. By which factor does its light fall?
#
#    .. dropdown:: Answer
#
#       .. code-block:: python
#
#          dull = rl.Scenario.load(work / "craft.toml", ('target.0.part_materials.bus="black_paint"',))
#          one = next(rl.simulate(dull, frames=[0]))
#          on_bus = (one.labels.part == parts.index("bus")) & (one.labels.filled_fraction > 0.99)
#          print(np.median(frames[0].labels.photons[on_bus] / one.labels.photons[on_bus]))
#
#       By 3.7, not by the 16 of the two reflectances (0.80 and 0.05): most of the light of gold foil leaves in a lobe
#       about the mirror direction, and at 25° that misses the lidar.
#
# 2. Use the STL in millimetres. What do you lose?
#
#    .. dropdown:: Answer
#
#       The parts. Replace the model and its scale, and take away everything that names a part:
#
#       .. code-block:: python
#
#          plain = scenario.target[0].replace(model="craft_mm.stl", scale=0.001, part_materials={}, joint=())
#          print(next(rl.simulate(scenario.replace(target=(plain,)), frames=[0])).source.targets[0].parts)
#
# 3. Let the array follow the Sun.
#
#    .. dropdown:: Answer
#
#       ``angle = { type = "follow_sun", normal = [1, 0, 0] }`` turns the hinge so that the normal of the cells points
#       at the Sun as nearly as the axis allows.
#
#       .. code-block:: python
#
#          drive = scenario.target[0].joint[0].replace(angle=rl.motion.FollowSun(normal=(1, 0, 0)))
#          sunny = scenario.replace(target=(scenario.target[0].replace(joint=(drive,)),))
#          print(next(rl.simulate(sunny, frames=[0])).valid.sum())
#
# Go on with step 4: a detector of your own.
