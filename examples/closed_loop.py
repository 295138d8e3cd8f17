"""Past a rocket stage twice: with a boresight that stays where it was, and with a controller that follows what it sees.

The controller gets each frame's Observation, which is what the craft could know: the reading, with false triggers, and
the angles that the encoders measure. The pointing error is then computed from the truth.
"""

import datetime

import numpy as np

import rso_lidar as rl

start_utc = datetime.datetime(2024, 9, 17, 12, tzinfo=datetime.UTC)

scenario = rl.Scenario(
    version=1,
    name="Closed loop, 3 m/s past a rocket stage",
    seed=7,
    time=rl.Time(start_utc=start_utc, duration_s=300, frame_rate_hz=2),
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
            attitude=rl.Spin(axis=[0, 0, 1], rate_deg_s=1.0),
        )
    ],
    follower=rl.Follower(  # rtn axes of the stage: from below and behind, ahead and past it
        motion=rl.Hill(relative_to="stage", position_m=[-400, -400, 0], velocity_m_s=[0, 3.0, 0]),
        attitude=rl.Rtn(),
    ),
    ptu=rl.Ptu(
        point=rl.FixedPoint(pan_deg=45),  # at the stage only when the run begins
        response=rl.SecondOrder(natural_hz=2.0, damping=0.7, max_rate_deg_s=10),
        errors=rl.PointingErrors(jitter_deg=0.01, encoder_noise_deg=0.005, command_latency_s=0.05),
    ),
    lidar=rl.Lidar(
        laser=rl.Laser(wavelength_nm=1064, energy_mj=15, pulse_fwhm_ns=8, divergence_deg=3.0),
        receiver=rl.Receiver(fov_deg=3.0, f_number=2.8, transmission=0.67, rays_per_pixel=4, min_rays_per_target=1024),
        detector=rl.Empirical(armed_to_m=2000, false_alarms_per_s=300),
    ),
)


def controller():
    """Return a new controller. It has a state, so each run needs its own."""
    return rl.track.Pointing(
        gate_m=20.0,  # the stage is 14 m long
        lead_s=0.16,  # the drive lags by damping / (pi * natural_hz) = 0.11 s, and receives a command 0.05 s late
    )


def off_boresight(frame):
    """Return how far the stage's centre of mass truly is from the boresight, as a share of the field of view."""
    x, y, z = frame.truth.pose("lidar", "stage").translation
    return np.arctan2(np.hypot(x, y), z) / scenario.lidar.receiver.fov_rad


if __name__ == "__main__":
    print(scenario.describe())
    print("\nopen loop, the first 15 s:")
    for frame in rl.simulate(scenario, frames=slice(0, 30, 4)):
        seen = (frame.labels.target >= 0).sum()
        print(f"{frame.time_s:6.1f} s  {off_boresight(frame):5.3f} of the field off boresight, on {seen:4d} pixels")
    print("\nclosed loop:")
    worst = 0.0
    for frame in rl.simulate(scenario, controller()):
        worst = max(worst, off_boresight(frame))
        if frame.index % 60 == 0:
            seen = (frame.labels.target >= 0).sum()
            print(f"{frame.time_s:6.1f} s  {off_boresight(frame):5.3f} of the field off boresight, on {seen:4d} pixels")
    print(f"at worst {worst:.3f} of the field off boresight in {scenario.time.duration_s:g} s")
