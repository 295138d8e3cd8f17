"""
What time does a frame have?
============================

`time_s` is the emission of the flash, in seconds since `start_utc`. All pixels of a flash lidar share it. Inside,
time is TAI, so that a leap second is an ordinary second.
"""

import datetime

import rso_lidar as rl

scenario = rl.Scenario.load("examples/tdrs_approach.toml")
print("start:", scenario.time.start_utc, " frames per second:", scenario.time.frame_rate_hz)
frame = next(rl.simulate(scenario, frames=[100]))
print(
    "frame",
    frame.index,
    "at",
    frame.time_s,
    "s, that is",
    scenario.time.start_utc + datetime.timedelta(seconds=frame.time_s),
)

# %%
# The delay of a return follows from the range: two ways at the speed of light.
nearest_m = float(frame.labels.range_m[frame.labels.target >= 0].min())
print(f"light returns {2 * nearest_m / rl.units.SPEED_OF_LIGHT_M_S * 1e6:.3f} us after the flash")

# %%
# Samples of other sensors have two times: when they hold, and when flight software receives them.
sensors = rl.Scenario.load("examples/onboard_sensors.toml")
tracker = next(rl.simulate(sensors, frames=[5])).observation.sensors["star_tracker"]
print("holds at", tracker.time_s, "available at", tracker.available_s)

# %%
# A frame of many pulses, and one that takes time (`pulse_rate_hz`): :doc:`/instrument`. Epochs: :doc:`/orbits`.
