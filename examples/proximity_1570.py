"""A wide camera close to a relay satellite in sunlight: blur, distortion, a laser beside the lens, several returns."""

import datetime

import numpy as np

import rso_lidar as rl

scenario = rl.Scenario(
    version=1,
    name="Proximity at 1570 nm, 65 m to 45 m",
    seed=1570,
    time=rl.Time(
        start_utc=datetime.datetime(2024, 9, 17, 12, tzinfo=datetime.UTC),
        duration_s=200,
        frame_rate_hz=0.2,
    ),
    target=[
        rl.Target(
            name="tdrs",
            model="tdrs",
            motion=rl.Tle(file="tle/tdrs.tle"),
            attitude=rl.Rtn(euler_zyx_deg=[0, 0, -65]),  # the dishes look 25 degrees past the follower
            smooth_parts=["antenna_single_access_east", "antenna_single_access_west"],
        )
    ],
    follower=rl.Follower(  # down the V-bar
        motion=rl.Hill(relative_to="tdrs", position_m=[0, 65, 0], velocity_m_s=[0, -0.1, 0]),
        attitude=rl.LookAt(at="tdrs"),
    ),
    lidar=rl.Lidar(
        preset="proximity_1570",
        laser={"energy_mj": 4, "offset_m": [0.08, 0, 0], "energy_jitter_fraction": 0.02},
        receiver={
            "psf": rl.optics.GaussianPsf(sigma_um=25),
            "distortion": rl.optics.BrownConrady(k1=-0.3),
        },
        detector={"returns": "first", "max_returns": 3, "speckle": rl.detector.Speckle()},
    ),
)

if __name__ == "__main__":
    print(scenario.describe())
    for frame in rl.simulate(scenario, frames=range(0, 40, 8), keep=["photons"]):
        several = np.isfinite(frame.observation.reading.return_range_m).sum(axis=2)
        sunlight = frame.kept["photons"].background_photons_per_s.max()
        print(
            f"{frame.time_s:5.0f} s  {frame.valid.sum():5d} pixels report, {(several > 1).sum():3d} of them more than one "
            f"return; the brightest gets {sunlight / 1e6:.0f} photons of sunlight a microsecond"
        )
