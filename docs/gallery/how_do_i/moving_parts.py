"""
How do I move parts of a target?
================================

A joint turns named parts about an axis: at a fixed angle, at a rate, after a plan, or toward the Sun. Shipped models
list their hinges.
"""

import tempfile
from pathlib import Path

from PIL import Image

import rso_lidar as rl
from rso_lidar import picture

folder = Path(tempfile.mkdtemp())
scenario = rl.Scenario.load("examples/proximity_1570.toml")
craft = scenario.target[0]


def joint(name, side, angle_deg):
    """Return a joint of one solar array at an angle."""
    parts = tuple(f"solar_{part}_{name}" for part in ("array", "substrate", "yoke"))
    place, angle = (1.36 * side, 0.0, 0.0), {"type": "fixed", "angle_deg": angle_deg}
    return rl.Joint(name=f"array_{name}", parts=parts, position_m=place, axis=(1.0, 0.0, 0.0), angle=angle)


# %%
# The arrays at four angles about their boom. Edge-on they vanish.
frames = []
for angle_deg in (0.0, 30.0, 60.0, 85.0):
    turned = craft.replace(joint=(joint("north", 1, angle_deg), joint("south", -1, angle_deg)))
    frames.append(next(rl.simulate(scenario.replace(target=(turned,)), frames=[10])))
Image.open(picture.contact_sheet(frames, folder / "sheet.png", columns=2, rows=2))

# %%
# The truth knows the axes of a joint: `tdrs.array_north`.
print(frames[1].truth.pose("tdrs", "tdrs.array_north").rotation.as_euler("zyx") / rl.units.DEG)

# %%
# Arrays that follow the Sun: :doc:`/auto_gallery/missions/safety_ellipse`. Keys of a joint: :doc:`/scenario`.
