"""The Sun passes behind a satellite: ghosts and glare of the lens, and full pixels that spill charge."""

import datetime

import numpy as np

import rso_lidar as rl

scenario = rl.Scenario(
    version=1,
    name="Ghosts and glare: the Sun passes behind a satellite",
    seed=16,
    time=rl.Time(
        start_utc=datetime.datetime(2024, 9, 17, 8, 25, tzinfo=datetime.UTC),
        duration_s=1440,
        frame_rate_hz=0.025,
    ),
    target=[
        rl.Target(
            name="tdrs",
            model="tdrs",
            motion=rl.Tle(file="tle/tdrs.tle"),
            attitude=rl.Rtn(euler_zyx_deg=[0, 0, -65]),
        )
    ],
    follower=rl.Follower(  # behind on the V-bar and above the orbit, so that the Sun passes behind the satellite
        motion=rl.Hill(relative_to="tdrs", position_m=[0, -250, 9.4], velocity_m_s=[0, 0, 0]),
        attitude=rl.LookAt(at="tdrs"),
    ),
    lidar=rl.Lidar(
        laser=rl.Laser(divergence_deg=5),
        receiver=rl.Receiver(
            fov_deg=5,
            f_number=1.8,
            filter_width_nm=1,
            psf=rl.optics.GaussianPsf(sigma_um=30, halo_fraction=0.02, halo_radius_um=200),
            ghosts=[
                rl.optics.Ghost(fraction=0.01, defocus_um=150, extra_path_m=0.02),  # turned about the axis
                rl.optics.Ghost(fraction=0.002, offset_pixels=[9.5, 4]),  # an upright copy
            ],
            glare=rl.optics.Glare(surfaces=8, baffle=rl.optics.Baffle(length_mm=320, diameter_mm=125)),
        ),
        detector=rl.Gsfl(bloom=rl.detector.Bloom()),
    ),
)

if __name__ == "__main__":
    print(scenario.describe())
    for frame in rl.simulate(scenario, frames=range(0, 36, 5), keep=["photons"]):
        sky = frame.kept["photons"].background_photons_per_s
        blind = frame.valid & (sky > 1e12)
        print(
            f"{frame.time_s:5.0f} s  {frame.valid.sum():5d} pixels report; the Sun blinds {blind.sum():3d}, and the median "
            f"pixel gets {np.median(sky) / 1e6:4.0f} photons of stray light a microsecond"
        )
