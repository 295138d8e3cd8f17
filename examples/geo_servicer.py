"""A servicer comes to a geostationary satellite, 20 km to 12 m: its plan, its flight, and what each range shows."""

import datetime

import rso_lidar as rl
from rso_lidar import rpo

start_utc = datetime.datetime(2024, 9, 17, 12, tzinfo=datetime.UTC)
plan = rpo.Sequence(
    relative_to="client",
    keep_out_m=100,
    corridor_axis=[0, -1, 0],  # behind the satellite, through the keep-out sphere
    corridor_half_angle_deg=10,
    legs=[
        rpo.HopLeg(from_m=[0, -20000, 0], to_m=[0, -3000, 0], duration_s=43200),
        rpo.PerchLeg(along_track_m=-3000, until=rpo.AfterTime(at_s=50400)),
        rpo.HopLeg(to_m=[0, -400, 0], duration_s=28800),
        rpo.HoldLeg(until=rpo.AtSunAngle(at_least_deg=60)),  # not against the Sun
        rpo.VBarLeg(to_m=-50, speed_m_s=0.1),
        rpo.HoldLeg(until=rpo.AfterTime(duration_s=1800)),
        rpo.VBarLeg(to_m=-12, speed_m_s=0.03),
        rpo.HoldLeg(),
    ],
)
scenario = rl.Scenario(
    version=1,
    name="A servicer comes to a geostationary satellite",
    seed=36,
    time=rl.Time(start_utc=start_utc, duration_s=90000, frame_rate_hz=0.004),
    target=[
        rl.Target(
            name="client",
            model="comsat",
            motion=rl.Kepler(
                epoch_utc=start_utc,
                semi_major_axis_km=42164.17,
                eccentricity=0.0003,
                inclination_deg=0.05,
                raan_deg=80,
                argument_of_perigee_deg=0,
                true_anomaly_deg=120,
            ),
            attitude=rl.motion.LvlhCcsds(euler_zyx_deg=[-90, 0, 0]),  # the arrays (body x) north and south
        )
    ],
    follower=rl.Follower(
        motion=rpo.Flown(
            plan=plan,
            forces=rl.orbit.Forces(zonal_degree=3, sun=True, moon=True),
            thrusters=rpo.Thrusters(magnitude_sigma_fraction=0.01, pointing_sigma_deg=0.5),
            guidance=rpo.TwoImpulseGuidance(every_s=1500, horizon_s=6000, forces=rl.orbit.Forces(zonal_degree=2)),
            navigation=rpo.RelativeFilter(  # all of its numbers are assumed
                every_s=100,
                position_sigma_m=[100, 400, 100],  # of an orbit by ground stations
                velocity_sigma_m_s=[0.02, 0.01, 0.01],
                acceleration_m_s2_sqrt_hz=1e-7,
                sensors=[
                    rpo.NavigationCamera(
                        bearing_sigma_deg=0.01,
                        origin_sigma_m=0.5,
                        least_range_m=100,
                        fov_deg=15,
                        sun_exclusion_deg=30,
                    ),
                    rpo.NavigationLidar(
                        bearing_sigma_deg=0.045,
                        origin_sigma_m=0.1,
                        most_range_m=1900,
                        fov_deg=5,
                        sun_exclusion_deg=10,
                        range_noise=rpo.RangeNoise(  # the budget's range noise at 14 hours
                            range_m=[300, 1100, 1900], sigma_m=[0.051, 0.060, 0.097]
                        ),
                    ),
                ],
            ),
        ),
        attitude=rl.LookAt(at="client"),  # the craft itself points: no PTU
    ),
    lidar=rl.Lidar(
        preset="gsfl_1064",
        detector={"armed_to_m": 25000},
        schedule=rl.Schedule(  # the lens zooms out, and the energy falls
            interpolation="step",
            time_s=[0, 50400, 79200, 82700, 84500],
            focal_length_mm=[293.3, 146.6, 91.5, 36.3, 36.3],
            divergence_deg=[2.5, 5, 8, 20, 20],
            energy_mj=[50, 50, 20, 4, 0.5],
        ),
    ),
    dispersion=rl.Dispersion(
        position_sigma_m=[200, 800, 200],
        velocity_sigma_m_s=[0.02, 0.01, 0.01],
        pointing_sigma_deg=0.2,
        hard_body_radius_m=5,  # the body, with the servicer; the arrays reach 18 m north and south
    ),
)

if __name__ == "__main__":
    flight = scenario.follower.motion.fly(start_utc, scenario.target[0].motion)
    print(flight.plan.describe())
    print(flight.describe())
    for frame in rl.simulate(scenario, frames=[0, 100, 200, 280, 316, 330, 340, 359]):
        range_m = float((frame.truth.pose("lidar", "client").translation ** 2).sum() ** 0.5)
        print(f"{frame.time_s / 3600:5.1f} h  {range_m:8.1f} m  {frame.valid.sum():5d} returns")
