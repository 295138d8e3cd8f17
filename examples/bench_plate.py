"""A camera and a plate on a bench 3 km long: nothing moves, and a closed form exists (Fuller et al., sec. 5)."""

import datetime

import numpy as np

import rso_lidar as rl

scenario = rl.Scenario(
    version=1,
    name="Bench, plate at 3 km",
    seed=3000,
    world=rl.World(axes="local"),  # root axes without an Earth: x ahead, y left, z up
    time=rl.Time(
        start_utc=datetime.datetime(2024, 9, 17, 12, tzinfo=datetime.UTC),
        duration_s=30,
        frame_rate_hz=10,
    ),
    target=[
        rl.Target(
            name="plate",
            model="plate",  # 4 m x 4 m, Lambertian 0.30, its normal along body +x
            motion=rl.Fixed(position_m=[3000, 0, 0]),
            attitude=rl.LookAt(at="follower"),
        )
    ],
    follower=rl.Follower(motion=rl.Fixed(position_m=[0, 0, 0])),  # looks along +x
    lidar=rl.Lidar(
        laser=rl.Laser(wavelength_nm=1064, energy_mj=50, pulse_fwhm_ns=8, divergence_deg=2.5),
        receiver=rl.Receiver(fov_deg=2.5, f_number=2.8, transmission=0.67, rays_per_pixel=64),
        detector=rl.Empirical(),  # 95 % at 1000 photons
    ),
)

if __name__ == "__main__":
    print(scenario.describe())
    found, photons = [], []
    for frame in rl.simulate(scenario):
        filled = frame.labels.filled_fraction > 0.999  # the middle 2 x 2 pixels
        found.append(frame.valid[filled].mean())
        photons.append(frame.labels.photons[filled].mean())
    print(f"a filled pixel gets {np.mean(photons):.1f} photons and reports {np.mean(found):.1%} of the time")
