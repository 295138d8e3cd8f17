"""A day on a walking safety ellipse about a relay satellite whose arrays follow the Sun, and what the plan promises."""

import datetime

import rso_lidar as rl

start_utc = datetime.datetime(2024, 9, 17, 12, tzinfo=datetime.UTC)


def array(side):
    """Return the hinge of one array: the boom and what is on it turn the cells toward the Sun."""
    return rl.Joint(
        name=f"array_{side}",
        parts=[f"solar_array_{side}", f"solar_substrate_{side}", f"solar_yoke_{side}"],
        position_m=[0, -0.012, -0.128],
        axis=[1, 0, 0],
        angle=rl.motion.FollowSun(normal=[0, 0, 1]),
    )


scenario = rl.Scenario(
    version=1,
    name="Walking safety ellipse about a relay satellite",
    seed=20260507,
    time=rl.Time(start_utc=start_utc, duration_s=86160, frame_rate_hz=0.0005),
    target=[
        rl.Target(
            name="tdrs",
            model="tdrs",
            motion=rl.Tle(file="tle/tdrs.tle"),
            attitude=rl.motion.LvlhCcsds(euler_zyx_deg=[-90, 0, 0]),  # the boom north, antennas to the Earth
            joint=[array("north"), array("south")],
        )
    ],
    follower=rl.Follower(
        motion=rl.rpo.SafetyEllipse(
            relative_to="tdrs",
            radial_m=80,
            cross_track_m=100,
            drift_m=100,
            center_along_track_m=-50,
            keep_out_m=60,
        ),
        attitude=rl.LookAt(at="tdrs"),  # the craft itself points: no PTU
    ),
    lidar=rl.Lidar(
        laser=rl.Laser(wavelength_nm=1064, energy_mj=30, pulse_fwhm_ns=8, divergence_deg=14),
        receiver=rl.Receiver(fov_deg=14, f_number=2.8, transmission=0.67),
        detector=rl.Gsfl(armed_from_m=20, armed_to_m=600),
    ),
    constraints=rl.Constraints(sun_exclusion_deg=20, keep_out_m=60),
)

if __name__ == "__main__":
    print(scenario.describe())
    print()
    for frame in rl.simulate(scenario):
        hinge = frame.truth.pose("tdrs", "tdrs.array_north").rotation.as_rotvec(degrees=True)[0]
        print(f"{frame.time_s / 3600:5.1f} h  {frame.valid.sum():5d} returns, arrays at {hinge:7.1f} deg")
