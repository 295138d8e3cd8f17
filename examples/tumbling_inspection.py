"""An inspector flies once around a tumbling rocket stage, 125 to 250 m from it, on an ellipse that needs no thrust."""

import datetime

import numpy as np

import rso_lidar as rl

start_utc = datetime.datetime(2024, 9, 17, 12, tzinfo=datetime.UTC)

scenario = rl.Scenario(
    version=1,
    name="Tumbling stage, one turn of a 2:1 ellipse",
    seed=125250,
    time=rl.Time(start_utc=start_utc, duration_s=5740, frame_rate_hz=0.1),  # one revolution about the Earth
    target=[
        rl.Target(
            name="stage",
            model="rocket_body",
            motion=rl.Kepler(
                epoch_utc=start_utc,
                semi_major_axis_km=6928.137,
                eccentricity=0.0,
                inclination_deg=97.6,
                raan_deg=35.0,
                argument_of_perigee_deg=0.0,
                true_anomaly_deg=0.0,
            ),
            attitude=rl.Tumble(
                inertia_kg_m2=[[3986, 126, -341], [126, 38130, -18], [-341, -18, 38082]],
                body_rate_deg_s=[0.6, 1.0, 0.4],
            ),
        )
    ],
    follower=rl.Follower(  # rtn axes of the stage; x' = n y / 2 closes the ellipse
        motion=rl.Hill(relative_to="stage", position_m=[0, -250, 0], velocity_m_s=[-0.136853, 0, 0]),
        attitude=rl.LookAt(at="stage"),
    ),
    lidar=rl.Lidar(
        laser=rl.Laser(wavelength_nm=1064, energy_mj=15, pulse_fwhm_ns=8, divergence_deg=8.0),
        receiver=rl.Receiver(fov_deg=8.0, f_number=2.8, transmission=0.67, rays_per_pixel=9),
        detector=rl.Gsfl(armed_to_m=500),
    ),
)

if __name__ == "__main__":
    print(scenario.describe())
    for frame in rl.simulate(scenario, frames=slice(None, None, 40)):
        away_m = np.linalg.norm(frame.truth.pose("lidar", "stage").translation)
        clipped = frame.observation.reading.saturated.sum()
        print(f"{frame.time_s:5.0f} s  {away_m:6.1f} m  {frame.valid.sum():4d} returns, {clipped} of them clipped")
