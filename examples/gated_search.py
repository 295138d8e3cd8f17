"""A stage 6 km away, by tens of photons in a pixel: a range gate that moves with it, and 32 pulses averaged."""

import datetime

import numpy as np

import rso_lidar as rl

start_utc = datetime.datetime(2024, 9, 17, 12, tzinfo=datetime.UTC)

scenario = rl.Scenario(
    version=1,
    name="Gated search, 6 km to 4.2 km",
    seed=3032,
    time=rl.Time(start_utc=start_utc, duration_s=3600, frame_rate_hz=0.01),
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
            attitude=rl.Rtn(euler_zyx_deg=[0, -90, 0]),  # the long axis along the orbit normal
        )
    ],
    follower=rl.Follower(  # 300 m lower, and so faster
        motion=rl.Hill(relative_to="stage", position_m=[-300, -6000, 0], velocity_m_s=[0, 0.49266, 0]),
        attitude=rl.LookAt(at="stage"),
    ),
    lidar=rl.Lidar(
        preset="gsfl_1064_offset_limited",
        laser={"energy_mj": 6},  # a table overrides the preset's key by key; so does a part, rl.Laser(...)
        receiver={"focal_length_mm": 293.3, "n_rows": 32, "n_cols": 32},
        detector={
            "readout": rl.detector.Readout(electrons_per_count=20),  # 30 photons give a pulse of 10 counts instead of 1
            "gate": rl.detector.Gate(delay_ns=39978, width_ns=200, pulses=32, false_alarm_probability=1e-3),
        },
        schedule=rl.Schedule(time_s=[0, 3600], gate_delay_ns=[39978, 28167]),
    ),
)

if __name__ == "__main__":
    print(scenario.describe())
    for frame in rl.simulate(scenario, frames=range(0, 36, 5)):
        there = frame.labels.target >= 0
        photons = np.median(frame.labels.photons[there])
        found, false = (frame.valid & there).sum(), (frame.valid & ~there).sum()
        opens_m = frame.observation.settings["gate_delay_s"] * rl.units.RANGE_PER_DELAY_M_S
        print(
            f"{frame.time_s:6.0f} s  gate from {opens_m:6.1f} m  {photons:4.0f} photons on half of its pixels or more, "
            f"{found:2d} of {there.sum():2d} found, {false} false"
        )
