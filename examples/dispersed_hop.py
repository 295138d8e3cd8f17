"""A hop with the errors that a real one has: what may happen in a thousand flights, and with which probability."""

import datetime

import rso_lidar as rl
from rso_lidar import rpo

start_utc = datetime.datetime(2024, 9, 17, 12, tzinfo=datetime.UTC)
scenario = rl.Scenario(
    version=1,
    name="Dispersed hop from 3 km to 200 m",
    seed=5,
    time=rl.Time(start_utc=start_utc, duration_s=7200, frame_rate_hz=0.1),
    target=[
        rl.Target(
            name="stage",
            model="rocket_body",
            motion=rl.Kepler(
                epoch_utc=start_utc,
                semi_major_axis_km=6928.137,
                eccentricity=0.0005,
                inclination_deg=97.6,
                raan_deg=35,
                argument_of_perigee_deg=0,
                true_anomaly_deg=0,
            ),
        )
    ],
    follower=rl.Follower(
        motion=rpo.Flown(
            plan=rpo.Hop(relative_to="stage", from_m=[0, -3000, 0], to_m=[0, -200, 0], duration_s=5400, keep_out_m=60),
            forces=rl.orbit.Forces(zonal_degree=4),
            thrusters=rpo.Thrusters(magnitude_sigma_fraction=0.01, pointing_sigma_deg=0.5),
            guidance=rpo.TwoImpulseGuidance(at_s=[1800, 4000]),
            navigation=rpo.NavigationErrors(position_sigma_m=2, velocity_sigma_m_s=0.003),
        ),
        attitude=rl.LookAt(at="stage"),
    ),
    lidar=rl.Lidar(
        preset="gsfl_1064",
        schedule=rl.Schedule(  # near the stage the lens zooms out, and the beam with it
            interpolation="step",
            time_s=[0, 4000],
            focal_length_mm=[293.3, 104],
            divergence_deg=[2.5, 7],
            energy_mj=[50, 8],
        ),
    ),
    dispersion=rl.Dispersion(
        position_sigma_m=[20, 60, 15],  # radial, along-track, cross-track
        velocity_sigma_m_s=[0.05, 0.02, 0.02],
        pointing_sigma_deg=0.3,
        energy_sigma_fraction=0.05,
    ),
)

if __name__ == "__main__":
    made = rl.study.disperse(scenario, 1000)
    print(made.describe())
    worst = made.table["nearest_m"].argmin()
    print(
        f"run {worst} comes nearest: {made.table['nearest_m'][worst]:.1f} m at {made.table['nearest_s'][worst]:.0f} s"
    )
