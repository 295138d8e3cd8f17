"""A craft in gold foil turns on a bench, and light may meet two of its surfaces: how much that adds, and how late."""

import datetime

import numpy as np

import rso_lidar as rl

scenario = rl.Scenario(
    version=1,
    name="Foil-clad craft, two bounces",
    seed=16002,
    world=rl.World(axes="local"),  # root axes without an Earth: x ahead, y left, z up
    time=rl.Time(
        start_utc=datetime.datetime(2024, 9, 17, 12, tzinfo=datetime.UTC),
        duration_s=24,
        frame_rate_hz=0.5,  # a frame every 10 degrees of the turn
    ),
    target=[
        rl.Target(
            name="craft",
            model="envisat",
            material="mli_gold",
            motion=rl.Fixed(position_m=[320, 0, 0]),
            attitude=rl.Spin(axis=[0, 0, 1], rate_deg_s=5.0),
        )
    ],
    follower=rl.Follower(motion=rl.Fixed(position_m=[0, 0, 0])),  # looks along +x
    lidar=rl.Lidar(
        bounces=2,  # paths laser - surface - surface - lens as well
        laser=rl.Laser(wavelength_nm=1064, energy_mj=50, pulse_fwhm_ns=8, divergence_deg=8.0),
        receiver=rl.Receiver(fov_deg=8.0, f_number=4.0, transmission=0.67),
        detector=rl.Gsfl(),
    ),
)

if __name__ == "__main__":
    print(scenario.describe())
    alone = scenario.replace(lidar=scenario.lidar.replace(bounces=1))
    for once, twice in zip(rl.simulate(alone), rl.simulate(scenario), strict=True):
        first, both = once.labels, twice.labels
        more = both.photons.sum() / first.photons.sum() - 1.0
        on_both = (first.target >= 0) & (both.target >= 0)
        later_m = (both.range_m - first.range_m)[on_both]
        print(
            f"{once.time_s:4.0f} s: {more:+6.1%} of light; the brightest return of a pixel lies up to "
            f"{np.quantile(later_m, 0.99):.2f} m deeper (99 % of pixels)"
        )
