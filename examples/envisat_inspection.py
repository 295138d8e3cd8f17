"""A servicing craft inspects a dead satellite for two days: its plan, and what the flight under real forces adds to it."""

import datetime

import rso_lidar as rl
from rso_lidar import rpo

start_utc = datetime.datetime(2024, 9, 17, 12, tzinfo=datetime.UTC)


def wait(duration_s):
    """Return the end of a leg after some time."""
    return rpo.AfterTime(duration_s=duration_s)


plan = rpo.Sequence(
    relative_to="envisat",
    keep_out_m=45,
    legs=[
        rpo.CoEllipticLeg(radial_m=-800, from_m=-25000, to_m=-6000),  # 7.5 km nearer each revolution
        rpo.HopLeg(to_m=[0, -2000, 0], duration_s=5400),
        rpo.PerchLeg(along_track_m=-2000, until=rpo.AfterTime(at_s=28800)),  # wait on the ground's word
        rpo.SafetyEllipseLeg(
            radial_m=200, cross_track_m=200, center_along_track_m=-1000, drift_m=100, until=wait(54000)
        ),
        rpo.CircumnavigationLeg(radial_m=120, cross_track_m=120, until=wait(54000)),
        rpo.HopLeg(to_m=[0, -250, 0], duration_s=2400),
        rpo.HoldLeg(until=rpo.InSunlight()),
        rpo.VBarLeg(to_m=-80, speed_m_s=0.1),
        rpo.HoldLeg(until=wait(3000)),  # 22 turns of the satellite
        rpo.VBarLeg(to_m=-300, speed_m_s=0.2),
        rpo.CoEllipticLeg(radial_m=60, to_m=-5000, transfer_s=2000),  # above: it falls behind
    ],
)


def forces(area_m2, mass_kg):
    """Return the forces on a craft. Sunlight is left out: both have the same area per mass, so that it moves both alike."""
    drag = rl.orbit.Drag(area_m2=area_m2, mass_kg=mass_kg)
    return rl.orbit.Forces(zonal_degree=6, sun=True, moon=True, drag=drag)


scenario = rl.Scenario(
    version=1,
    name="Inspection of a dead satellite, two days",
    seed=2002,
    time=rl.Time(start_utc=start_utc, duration_s=172800, frame_rate_hz=0.002),
    target=[
        rl.Target(
            name="envisat",
            model="envisat",
            motion=rl.Tle(file="tle/envisat.tle"),
            attitude=rl.Spin(preset="envisat_2013"),  # measured by laser ranging: once in 135 s, inertially
        )
    ],
    follower=rl.Follower(
        motion=rpo.Flown(
            plan=plan,
            forces=forces(6, 800),
            chief_forces=forces(60, 7800),
            thrusters=rpo.Thrusters(acceleration_m_s2=0.02, magnitude_sigma_fraction=0.01, pointing_sigma_deg=0.5),
            guidance=rpo.TwoImpulseGuidance(every_s=1200, horizon_s=1480, forces=rl.orbit.Forces(zonal_degree=2)),
            navigation=rpo.NavigationErrors(position_sigma_m=0.5, velocity_sigma_m_s=0.001),
        ),
        attitude=rl.LookAt(at="envisat"),  # the craft itself points: no PTU
    ),
    lidar=rl.Lidar(
        preset="gsfl_1064",
        receiver={"f_number": 1.8},  # a fast lens, for short focal lengths
        detector={"armed_to_m": 6500},
        schedule=rl.Schedule(  # the lens zooms out, and the beam with it, as the satellite grows
            interpolation="step",
            time_s=[0, 28800, 86600, 145500, 152000],
            focal_length_mm=[293.3, 91.5, 52.1, 36.3, 91.5],
            divergence_deg=[2.5, 8, 14, 20, 8],
        ),
    ),
    dispersion=rl.Dispersion(
        position_sigma_m=[100, 400, 100],  # of the start, as an element set of the day and GNSS give it
        velocity_sigma_m_s=[0.2, 0.1, 0.1],
        pointing_sigma_deg=0.3,
        energy_sigma_fraction=0.05,
    ),
    constraints=rl.Constraints(sun_exclusion_deg=15, keep_out_m=45),
)

if __name__ == "__main__":
    target = scenario.target[0].motion
    flight = scenario.follower.motion.fly(start_utc, target)
    print(flight.plan.describe())
    print(flight.describe())
    for frame in rl.simulate(scenario, frames=range(60, 346, 10)):
        range_m = float((frame.truth.pose("lidar", "envisat").translation ** 2).sum() ** 0.5)
        print(f"{frame.time_s / 3600:5.1f} h  {range_m:7.1f} m  {frame.valid.sum():5d} returns")
