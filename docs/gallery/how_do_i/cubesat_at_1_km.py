"""
How do I see a CubeSat at 1 km?
===============================

A 3U CubeSat is 0.34 m long and a pixel of 0.34 mrad is as wide at 1 km. Small targets get finer rays, so that none
falls between them; whether they are found is a question of light, attitude and luck with the pixel grid.
"""

import datetime

import rso_lidar as rl

scenario = rl.Scenario(
    version=1,
    name="3U CubeSat at 1 km",
    time=rl.Time(start_utc=datetime.datetime(2024, 9, 17, tzinfo=datetime.UTC), duration_s=20, frame_rate_hz=1),
    world=rl.World(axes="local"),
    target=[
        rl.Target(
            name="cubesat",
            model="cubesat_3u",
            motion=rl.Fixed(position_m=(1000.0, 0.0, 0.0)),
            attitude=rl.Spin(axis=(0.2, 1.0, 0.3), rate_deg_s=11.0),
        )
    ],
    follower=rl.Follower(motion=rl.Fixed(position_m=(0.0, 0.0, 0.0))),
    lidar=rl.Lidar(preset="gsfl_1064"),
)
frames = list(rl.simulate(scenario))
for frame in frames[:8]:
    on = frame.valid & (frame.labels.target >= 0)
    light = frame.labels.photons[frame.labels.target >= 0].max()
    print(f"{frame.time_s:3.0f} s  {light:6.0f} photons in the brightest pixel, {on.sum()} of its pixels report")

# %%
# The closed question, over all attitudes: how far is it found with a probability of 90 %?
camera = rl.Lidar(preset="gsfl_1064", receiver={"rays_per_pixel": 64})
found = rl.study.find_range(camera, "cubesat_3u", probability=0.9, attitudes=24, range_m=(400.0, 2500.0))
print(found.table())

# %%
found.figure()

# %%
# For more: a narrower beam and field (`long_range_1064`), a gate that averages pulses
# (:doc:`/auto_gallery/missions/gated_search`), several flashes (`flashes` of `[finding]`). Method: :doc:`/studies`.
