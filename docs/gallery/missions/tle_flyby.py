"""
Flyby of two objects on their element sets
==========================================

Two objects in low Earth orbit, each on its own two-line element set, pass at 1.5 km and 25 m/s. The pan-tilt unit
(PTU) follows the true direction of the rocket stage. The element sets are synthetic; name real ones to fly a real
encounter.
"""

import tempfile
from pathlib import Path

from PIL import Image

import rso_lidar as rl
from rso_lidar import picture

folder = Path(tempfile.mkdtemp())

# %%
# First the encounter as a timeline, without a single flash: range and range rate, the rates that the PTU must follow,
# the Sun, photons and the probability of detection. At closest approach the direction turns by one degree per second.
scenario = rl.Scenario.load("examples/tle_flyby.toml")
timeline = rl.timeline(scenario, every_s=2.0)
timeline.figure()

# %%
# The numbers of the figure are columns with their units in their names.
table = timeline.table
nearest = table["range_m"].argmin()
print(f"closest approach {table['range_m'][nearest]:.1f} m at {table['time_s'][nearest]:.0f} s")
print(f"greatest image rate {abs(table['image_rate_rad_s']).max() * 1e3:.3f} mrad/s over the focal plane")

# %%
# Now the frames. The stage is in a flat spin, end over end, and shows its side, its nozzle and its side again.
frames = list(rl.simulate(scenario, frames=range(0, 180, 5)))
Image.open(picture.contact_sheet(frames, folder / "sheet.png", columns=4, rows=3))

# %%
# The same frames as a film.
Image.open(picture.animate(frames, folder / "flyby.gif", frame_rate_hz=6))

# %%
# **To try.** Slow the drive with ``ptu.response.max_rate_deg_s=0.8`` and look when the stage leaves the field. Put the
# element sets of two objects of your catalogue into a file and name it under `motion`. Find your own encounter first:
# :doc:`/auto_gallery/how_do_i/find_an_encounter`.
