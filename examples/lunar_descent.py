"""A lander comes down to the Moon from 1 km to 30 m; examples/studies/lunar_descent.py makes maps of what it sees."""

import datetime
from pathlib import Path

import numpy as np

import rso_lidar as rl

scenario = rl.Scenario(
    version=1,
    name="Lunar descent, 1 km to 30 m",
    seed=11,
    world=rl.World(axes="local", sun_direction=[0.8, 0.3, 0.5]),  # x east, y north, z up; the Sun 30 degrees high
    time=rl.Time(
        start_utc=datetime.datetime(2024, 9, 17, 12, tzinfo=datetime.UTC),
        duration_s=60,
        frame_rate_hz=1,
    ),
    target=[
        rl.Target(
            name="site",
            terrain=rl.CratersAndBoulders(seed=3, size_m=256, cell_m=0.5, rock_fraction=0.05),
            material="regolith_highland",
            motion=rl.Fixed(position_m=[0, 0, 0]),
        )
    ],
    follower=rl.Follower(
        motion=rl.motion.Table(file="lunar_descent.csv"),
        attitude=rl.FixedAttitude(euler_zyx_deg=[0, 90, 0]),  # body +x, and the lidar with it, straight down
    ),
    lidar=rl.Lidar(
        laser=rl.Laser(wavelength_nm=1064, energy_mj=50, pulse_fwhm_ns=8, divergence_deg=30),
        receiver=rl.Receiver(fov_deg=30, f_number=1.2, transmission=0.67, filter_width_nm=1.0),
        detector=rl.Gsfl(
            preset="offset_limited",
            armed_from_m=10,
            armed_to_m=1500,
            trigger=rl.detector.Trigger(
                threshold_electrons=2500
            ),  # 7 times the noise: the ground is found from 1 km on
        ),
        schedule=rl.Schedule(time_s=[0, 30, 40, 50, 60], energy_mj=[50, 50, 16, 3.5, 0.5]),  # or the converter clips
    ),
)

if __name__ == "__main__":
    here = rl.Scenario.load(Path(__file__).with_suffix(".toml"))  # the same; its table is found beside it
    print(here.describe())
    for frame in rl.simulate(here, frames=slice(0, None, 10)):
        height_m = frame.truth.poses.place("site", "lidar")[0][2]
        apart = (frame.range_m - frame.labels.range_m)[frame.valid & (frame.labels.target >= 0)]
        error_cm = 100.0 * np.median(np.abs(apart))
        print(f"{height_m:7.1f} m up: {frame.valid.sum():6d} returns, median range error {error_cm:.1f} cm")
