"""
On which side of a dead stage is the light?
===========================================

An inspector of 24 kg circles a spent stage on a safety ellipse. Two craft start half a turn apart: one sees the stage in
light, the other never does. The mission is `examples/studies/leo_week.toml`, its text `examples/studies/leo_week.md`,
and the script that draws its first day `examples/studies/leo_week.py`.
"""

import matplotlib.pyplot as plt
import numpy as np

import rso_lidar as rl

scenario = rl.Scenario.load("examples/studies/leo_week.toml")
start_utc, stage = scenario.time.start_utc, scenario.target[0].motion
flown = scenario.follower.motion
time_s = np.arange(0.0, 12_000.0, 60.0)
epochs = rl.orbit.Epochs(start_utc, time_s)
chief = stage.states(epochs)
inertial_from_rtn, _ = rl.orbit.rtn_axes(chief.position_m, chief.velocity_m_s)
sun_m = rl.orbit.sun_position_m(epochs)
toward_sun = inertial_from_rtn.inv().apply(sun_m - chief.position_m)
toward_sun /= np.linalg.norm(toward_sun, axis=1, keepdims=True)
lit = rl.orbit.sunlit_fraction(chief.position_m, sun_m) > 0.5

figure, axes = plt.subplots(figsize=(9.0, 4.0))
for phase_deg in (180.0, 0.0):
    motion = flown.replace(plan=flown.plan.replace(phase_deg=phase_deg))
    position_m, _ = motion.fly(start_utc, stage).relative(time_s)
    cosine = np.einsum("ti,ti->t", position_m, toward_sun) / np.linalg.norm(position_m, axis=1)
    angle_deg = np.arccos(cosine) / rl.units.DEG
    axes.plot(time_s / 3600.0, np.where(lit, angle_deg, np.nan), label=f"starts at {phase_deg:g} deg")
axes.set(xlabel="Time [h]", ylabel="Angle Sun, stage, lidar [deg]", ylim=(0.0, 180.0))
axes.axhline(90.0, color="0.6", lw=0.8)
axes.legend()

# %%
# The gaps are the Earth's shadow. Below 90 degrees the lidar looks at the lit side. Ellipse and direction to the Sun turn
# together in the axes of the stage, so that the angle stays where it starts.
#
# **To try.** Start at 90 degrees, and see in which part of each revolution the stage is lit from the lidar's side.
