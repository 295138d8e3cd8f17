"""
Step 2: own orbit
=================

You put a rocket stage on an orbit of your own choice, let an inspector drift beside it, fly a planned operation around it,
and learn what the package warns of.
"""

import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from PIL import Image

import rso_lidar as rl
from rso_lidar import picture

work = Path(tempfile.mkdtemp(prefix="tutorial-"))


def shell(command):
    """Run a command of the package in the folder, and print what it prints."""
    words = [sys.executable, "-m", "rso_lidar", *command.split()[1:]]
    done = subprocess.run(words, cwd=work, capture_output=True, text=True, check=True)
    print(f"$ {command}", done.stdout.rstrip(), sep="\n")


# %%
# An orbit for the target
# -----------------------
#
# The motion of a body about the Earth may be an **element set** (TLE or OMM, propagated by SGP4), osculating elements
# (``kepler``), mean elements with the Earth's flattening (``j2``), a numerical integration with forces, or a table from
# another tool (OEM, CSV). Take the element set of your satellite from any catalogue. This one is synthetic: a rocket
# stage at 550 km.

(work / "stage.tle").write_text(
    "ROCKET STAGE (SYNTHETIC)\n"
    "1 99002U 24002B   24261.50000000  .00000000  00000-0  00000+0 0    11\n"
    "2 99002  97.6000  35.0000 0010000  90.0000 270.0000 15.06000000    14\n"
)
shell("rso-lidar catalog stage.tle")

# %%
# An inspector beside it
# ----------------------
#
# An element set is good to about a kilometre. That is useless between two bodies 200 m apart, so the inspector is given
# *relative* to the stage. The axes are **rtn**: x radially out, y along-track (forward), z along the orbit normal. They
# turn with the orbit. ``hill`` is the motion by Clohessy and Wiltshire.
#
# This is a whole scenario. ``look_at`` turns the body of the inspector so that its +x, along which the lidar looks,
# points at the stage. ``preset`` takes a shipped camera, here with a wider field and less energy.

(work / "inspection.toml").write_text("""\
version = 1
name    = "Inspection of a rocket stage"
seed    = 2

[time]
start_utc     = 2024-09-17T12:00:00Z
duration_s    = 5740                    # one revolution
frame_rate_hz = 0.025                   # every 40 s

[[target]]
name     = "stage"
model    = "rocket_body"                # shipped; `rso-lidar models` lists all
motion   = { type = "tle", file = "stage.tle" }
attitude = { type = "tumble", inertia_kg_m2 = [3986, 38130, 38082], body_rate_deg_s = [0.6, 1.0, 0.4] }

[follower]
motion   = { type = "hill", relative_to = "stage", position_m = [0, -200, 0], velocity_m_s = [0, 0, 0] }
attitude = { type = "look_at", at = "stage" }

[lidar]
preset = "gsfl_1064"
laser    = { energy_mj = 5, divergence_deg = 8 }
receiver = { fov_deg = 8 }
""")
scenario = rl.Scenario.load(work / "inspection.toml")

# %%
# Small errors of velocity matter more than small errors of position. Three inspectors start 200 m behind the stage: one
# at rest, one with a radial speed of n·y/2 (n is the mean motion), and one at rest but for 1 cm/s along-track.

n_rad_s = 2.0 * np.pi / 5745.0
starts = {
    "at rest": (0.0, 0.0, 0.0),
    "radial speed n·y/2": (0.5 * n_rad_s * -200.0, 0.0, 0.0),
    "1 cm/s forward": (0.0, 0.01, 0.0),
}


def fly(motion):
    """Return the scenario with another motion of the follower."""
    return scenario.replace(follower=scenario.follower.replace(motion=motion))


def place(flown):
    """Return the follower's position (time, xyz) in the stage's rtn axes [m], without rendering any frame."""
    truth = rl.motion.truth(flown.bodies, flown.epochs(range(flown.time.n_frames)))
    stage, follower = truth.states["stage"], truth.states["follower"]
    inertial_from_rtn, _ = rl.rpo.rtn_axes(stage.position_m, stage.velocity_m_s)
    return inertial_from_rtn.inv().apply(follower.position_m - stage.position_m)


figure = Figure(figsize=(8, 4), layout="constrained")
axes = figure.subplots()
for name, velocity_m_s in starts.items():
    x, y, z = place(fly(rl.Hill(relative_to="stage", position_m=(0, -200, 0), velocity_m_s=velocity_m_s))).T
    axes.plot(y, x, ".", ms=12 if name == "at rest" else 4, label=name)
    print(f"{name:20s} ends at x {x[-1]:+7.1f} m, y {y[-1]:+7.1f} m")
axes.plot(0, 0, "+", color="C5", ms=12)
axes.set_xlabel("along-track y [m]")
axes.set_ylabel("radial x [m]")
axes.set_aspect("equal")
axes.legend()
figure

# %%
# The first stays where it is: two bodies on the same orbit keep their distance. The second flies an ellipse about the
# stage, twice as long as high, and needs no thrust. The third *accelerates forward and falls behind*: a faster orbit is
# a higher and slower one. In one revolution T it drifts by 3 T · 1 cm/s = 172 m. This is why relative navigation lives
# on velocity.
#
# A planned operation
# -------------------
#
# An ellipse in the orbit's plane crosses the track of the stage, so a small drift can end in a collision. A **safety
# ellipse** also swings across the track, such that it surrounds it. Operations of ``rl.rpo`` are motions like any
# other. They also make a plan: impulses, delta-v, nearest distance, and *passive safety*, which is the nearest distance
# if thrust stops for good at the worst instant.

around = rl.rpo.SafetyEllipse(relative_to="stage", radial_m=90, cross_track_m=100, keep_out_m=60)
stage_orbit = rl.orbit.Catalog.from_file(work / "stage.tle").trajectory(99002)
print(around.plan(scenario.time.start_utc, stage_orbit).describe())

# %%
# Compare it with a straight approach on the V-bar, the along-track axis, and with the same approach in hops.

for name, options in {"straight": {"speed_m_s": 0.1}, "hops": {"hops": 2}}.items():
    approach = rl.rpo.VBarApproach(relative_to="stage", from_m=-200, to_m=-60, **options)
    plan = approach.plan(scenario.time.start_utc, stage_orbit)
    print(
        f"{name:9s} {plan.duration_s:6.0f} s  {plan.delta_v_m_s:.3f} m/s  passive safety {plan.passive_safety_m():5.1f} m"
    )

# %%
# The straight line is fast, but costs fuel to hold against the orbit, and drifts as near as 30 m if the thruster stops.
# The hops take four times as long, need a seventh of the fuel, and never come nearer than planned.
#
# In the file, the operation is one line. ``check`` summarises the whole mission without rendering it: orbit, geometry,
# Sun, light, and warnings. The link budget at its end is made by casting rays at the stage as it stands.

text = (work / "inspection.toml").read_text()
hill = next(line for line in text.splitlines() if "hill" in line)
ellipse = (
    'motion = { type = "safety_ellipse", relative_to = "stage", radial_m = 90, cross_track_m = 100, keep_out_m = 60 }'
)
(work / "inspection.toml").write_text(text.replace(hill, ellipse))
shell("rso-lidar check inspection.toml")

# %%
# Read it from the top: the element set and its age, the range over the run, where Sun, Earth and Moon are seen from the
# boresight, the eclipses, and the plan. *Budget* says how much light comes back in the first and in the last frame, and
# with which probability a pixel reports. The rows begin with what they are about, so you can search for them.
#
# ``truth`` draws the motion:

shell("rso-lidar truth inspection.toml -o path.png --figure relative")
Image.open(work / "path.png")

# %%
# What warnings are for
# ---------------------
#
# Models have limits, and the package tells you when you leave one. Here the stage is put on an eccentric orbit.
# Clohessy and Wiltshire's equations take the orbit as circular.

eccentric = rl.Kepler(
    epoch_utc=scenario.time.start_utc, semi_major_axis_km=7200, eccentricity=0.03, inclination_deg=97.6,
    raan_deg=35, argument_of_perigee_deg=0, true_anomaly_deg=0,
)  # fmt: skip
warned = fly(around).replace(target=(scenario.target[0].replace(motion=eccentric),))
for line in warned.advice():
    print("-", line, end="\n\n")

# %%
# A warning names the key, says what is wrong and by how much, and what to do. Others are about light and pointing: a
# part of the stage outside the field, pixels that saturate, the Sun near the field. ``check`` prints them in
# its last lines; Python calls them ``advice``.
#
# The result
# ----------
#
# Fly the ellipse, with every ninth frame, and look.

flown = rl.Scenario.load(work / "inspection.toml")
frames = list(rl.simulate(flown, frames=slice(0, None, 9)))
Image.open(picture.contact_sheet(frames, work / "ellipse.png"))

# %%
# The stage is seen from all sides, because both bodies move: the inspector once around it in a revolution, and the
# stage end over end. You see its engine, its tanks and the white paint in turn. Bright spots are bare metal that faces
# the lidar: it sends its light back like a mirror. Dark ones are surfaces at a flat angle. **This is your mission: one
# element set, one operation, thirty lines of TOML.**
#
# Exercises
# ---------
#
# 1. By how much does an inspector at rest 50 m *above* the stage drift in one revolution? Predict, then fly it.
#
#    .. dropdown:: Answer
#
#       A higher orbit is slower. Left at rest in rtn axes at height x, the inspector drifts along-track by −12π x in a
#       revolution (−1.9 km), and swings up to 7 x on the way.
#
#       .. code-block:: python
#
#          above = rl.Hill(relative_to="stage", position_m=(50, 0, 0), velocity_m_s=(0, 0, 0))
#          print(place(fly(above))[-1].round(0))
#
# 2. Which along-track speed makes an inspector 50 m above the stage pass it on a straight line (a *co-elliptic* orbit)?
#
#    .. dropdown:: Answer
#
#       −3/2 n x = −0.082 m/s. ``rl.rpo.CoElliptic(relative_to="stage", radial_m=50, from_m=500, to_m=-500)`` plans it.
#
#       .. code-block:: python
#
#          past = rl.rpo.CoElliptic(relative_to="stage", radial_m=50, from_m=500, to_m=-500)
#          print(past.plan(scenario.time.start_utc, stage_orbit).describe())
#
# 3. What happens if you ask for a safety ellipse that is too small for its keep-out sphere?
#
#    .. dropdown:: Answer
#
#       The plan is refused, with the instant and the position at which it enters the sphere.
#
#       .. code-block:: python
#
#          try:
#              around.replace(radial_m=40).plan(scenario.time.start_utc, stage_orbit)
#          except rl.RsoLidarError as error:
#              print(error)
#
# Go on with step 3: a target of your own.
