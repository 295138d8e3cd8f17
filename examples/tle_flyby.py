"""Two objects in low Earth orbit, each by its own two-line element set, pass at 1.5 km and 25 m/s (SYNTHETIC sets)."""

import datetime

import numpy as np

import rso_lidar as rl

scenario = rl.Scenario(
    version=1,
    name="TLE flyby, 1.5 km at 25 m/s",
    seed=99002,
    time=rl.Time(
        start_utc=datetime.datetime(2024, 9, 17, 11, 58, 30, tzinfo=datetime.UTC),  # 90 s before the closest approach
        duration_s=180,
        frame_rate_hz=1,
    ),
    target=[
        rl.Target(
            name="stage",
            model="rocket_body",
            motion=rl.Tle(file="tle/flyby.tle", norad_id=99002),  # the file holds both: choose by norad_id or name
            attitude=rl.Spin(axis=[0, 0, 1], rate_deg_s=2.0),  # end over end: +x is the long axis
        )
    ],
    follower=rl.Follower(
        motion=rl.Tle(file="tle/flyby.tle", norad_id=99003),
        attitude=rl.Rtn(euler_zyx_deg=[90, 0, 0]),  # body +x along-track, where the stage is; +z the orbit normal
    ),
    ptu=rl.Ptu(
        point=rl.TrackPoint(at="stage"),
        response=rl.SecondOrder(natural_hz=4.0, damping=0.7, max_rate_deg_s=30),
    ),
    lidar=rl.Lidar(
        laser=rl.Laser(wavelength_nm=1064, energy_mj=50, pulse_fwhm_ns=8, divergence_deg=1.0),
        receiver=rl.Receiver(fov_deg=1.0, aperture_mm=100, transmission=0.67),
        detector=rl.Gsfl(armed_from_m=1000, armed_to_m=3000),
    ),
)

if __name__ == "__main__":
    print(scenario.describe())
    for frame in rl.simulate(scenario, frames=slice(None, None, 10)):
        away_m = np.linalg.norm(frame.truth.pose("lidar", "stage").translation)
        _, tilt_rad = frame.observation.pan_tilt_rad
        print(f"{frame.time_s:4.0f} s  {away_m:7.1f} m  tilt {tilt_rad:6.3f} rad  {frame.valid.sum():4d} returns")
