"""A follower with an inertial unit, a star tracker and GNSS: its attitude, estimated from gyro and star tracker alone.

The samples of a frame are those that flight software received since the flash before. `Attitude` is a controller that gives
no commands: it integrates the gyro, and turns its estimate by a share of what the star tracker says.
"""

import datetime
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

import rso_lidar as rl

start_utc = datetime.datetime(2024, 9, 17, 12, tzinfo=datetime.UTC)
IMU = {"position_m": [0.2, 0.0, -0.1], "euler_zyx_deg": [0, 0, 180]}

scenario = rl.Scenario(
    version=1,
    name="Inertial unit, star tracker and GNSS beside the lidar",
    seed=18,
    time=rl.Time(start_utc=start_utc, duration_s=60, frame_rate_hz=1),
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
    follower=rl.Follower(
        motion=rl.Hill(relative_to="stage", position_m=[0, -60, 4], velocity_m_s=[0.02, -0.05, 0]),
        attitude=rl.LookAt(at="stage"),
    ),
    sensor=[
        rl.sensors.Gyro(name="gyro", preset="stim300_gyro", rate_hz=20, mount=IMU),
        rl.sensors.Accelerometer(name="accelerometer", preset="stim300_accelerometer", rate_hz=20, mount=IMU),
        rl.sensors.StarTracker(
            name="star_tracker", preset="nst", rate_hz=2, latency_s=0.2, mount={"euler_zyx_deg": [0, 0, 90]}
        ),
        rl.sensors.Gnss(
            name="gnss",
            preset="oem719",
            rate_hz=1,
            latency_s=0.1,
            antenna_m=[0.0, 0.0, 0.5],
            outages=[{"from_s": 30, "to_s": 40}],
        ),
        rl.sensors.RelativeGnss(name="relative_gnss", preset="carrier_phase", target="stage", rate_hz=1),
    ],
    lidar=rl.Lidar(
        laser=rl.Laser(wavelength_nm=1064, energy_mj=10, pulse_fwhm_ns=8, divergence_deg=16),
        receiver=rl.Receiver(
            n_rows=64,
            n_cols=64,
            fov_deg=16,
            f_number=2.8,
            transmission=0.67,
            rays_per_pixel=4,
            min_rays_per_target=1024,
        ),
        detector=rl.Empirical(armed_to_m=500),
    ),
)


class Attitude:
    """Attitude of the follower: the integral of the gyro, corrected by a share of each attitude of the star tracker."""

    GAIN = 0.1

    def __init__(self, body_from_gyro):
        self.body_from_gyro = body_from_gyro
        self.times, self.attitudes = [], []  # inertial_from_body after each sample of the gyro

    def __call__(self, observation):
        """Take the samples since the flash before; give no command."""
        gyro, tracker = observation.sensors["gyro"], observation.sensors["star_tracker"]
        for time_s, rate in zip(gyro.time_s, gyro.angular_velocity_rad_s, strict=True):
            if self.attitudes:
                turned = Rotation.from_rotvec(self.body_from_gyro.apply(rate.copy()) * (time_s - self.times[-1]))
                self.times.append(time_s)
                self.attitudes.append(self.attitudes[-1] * turned)
        for time_s, quaternion in zip(
            tracker.time_s[tracker.valid], tracker.quaternion_xyzw[tracker.valid], strict=True
        ):
            measured = Rotation.from_quat(quaternion)
            if not self.attitudes:
                self.times, self.attitudes = [time_s], [measured]
                continue
            then = (
                np.searchsorted(self.times, time_s + 1e-6) - 1
            )  # the attitude is old: compare what was estimated then
            miss = (self.attitudes[then].inv() * measured).as_rotvec()
            correction = Rotation.from_rotvec(self.GAIN * miss)
            self.attitudes[then:] = [attitude * correction for attitude in self.attitudes[then:]]


if __name__ == "__main__":
    flown = rl.Scenario.load(Path(__file__).with_suffix(".toml"))
    estimate = Attitude(flown.sensor[0].mount.rotation)
    for frame in rl.simulate(flown):  # rl.simulate(flown, estimate) calls it in the same way
        estimate(frame.observation)
        if frame.index % 10 == 9:
            true = frame.truth.pose("inertial", "follower").rotation
            miss_rad = (true.inv() * estimate.attitudes[-1]).magnitude()
            gnss = frame.observation.sensors["gnss"]
            fixes = f"{gnss.valid.sum()} valid of {len(gnss.valid)} GNSS"
            print(f"{frame.time_s:5.0f} s  attitude off by {miss_rad / rl.units.DEG:.4f} deg, {fixes}")
