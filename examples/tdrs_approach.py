"""A follower hops from 3 km behind a relay satellite in geosynchronous orbit to 300 m behind it, in 45 minutes."""

import datetime

import rso_lidar as rl

scenario = rl.Scenario(
    version=1,
    name="TDRS hop, 3 km to 300 m",
    seed=20240917,  # all noise; frame k depends on (seed, k) only
    time=rl.Time(
        start_utc=datetime.datetime(2024, 9, 17, 12, tzinfo=datetime.UTC),
        duration_s=2700,
        frame_rate_hz=0.2,
    ),
    target=[
        rl.Target(
            name="tdrs",
            model="tdrs",
            material=rl.Lambertian(reflectance=0.30),
            motion=rl.Tle(file="tle/tdrs.tle"),
            attitude=rl.Spin(
                axis=[0, 0, 1],  # the way dishes and solar cells face, 35 degrees off the way to the follower
                rate_deg_s=0.5,
                quaternion_xyzw=[0.1743, 0.4429, 0.8184, 0.3221],
            ),
        )
    ],
    follower=rl.Follower(  # a two-impulse hop in the target's rtn axes
        motion=rl.Hill(relative_to="tdrs", position_m=[0, -3000, 0], velocity_m_s=[-0.19500, 0.98719, 0]),
        attitude=rl.Rtn(euler_zyx_deg=[90, 0, 0]),  # body +x along-track; the PTU does the pointing
    ),
    ptu=rl.Ptu(
        mount=rl.Mount(position_m=[0, 0, 0.5]),
        point=rl.TrackPoint(at="tdrs"),
        response=rl.SecondOrder(natural_hz=4.0, damping=0.7, max_rate_deg_s=30),
    ),
    lidar=rl.Lidar(
        laser=rl.Laser(wavelength_nm=1064, energy_mj=50, pulse_fwhm_ns=8, divergence_deg=2.5),
        receiver=rl.Receiver(fov_deg=2.5, f_number=2.8, transmission=0.67),
        detector=rl.Gsfl(),
    ),
)

if __name__ == "__main__":
    print(scenario.describe())
    for frame in rl.simulate(scenario, frames=slice(None, None, 60)):  # every five minutes
        print(f"{frame.time_s:6.0f} s  {frame.valid.sum():5d} returns")
