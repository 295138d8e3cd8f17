"""A follower with thrusters holds its position behind a rocket stage, from the readings of its lidar alone.

The motion is the user's own: `relative_motion` below is f of x' = f(t, x, u) (Fuller et al., eq. 6), integrated with the
other motions. The controller passes u through `Command.inputs`.
"""

import datetime
from pathlib import Path

import numpy as np

import rso_lidar as rl

start_utc = datetime.datetime(2024, 9, 17, 12, tzinfo=datetime.UTC)
N = (rl.units.EARTH_GM_M3_S2 / 6_928_137.0**3) ** 0.5  # mean motion of the stage [rad/s]
STRONGEST_M_S2 = 0.02
HOLD_M = 80.0


def relative_motion(t, x, u):
    """Return the rates of position and velocity in the stage's rtn axes: Clohessy and Wiltshire, with thrust."""
    thrust = np.clip(u, -STRONGEST_M_S2, STRONGEST_M_S2)
    gravity = (3 * N**2 * x[0] + 2 * N * x[4], -2 * N * x[3], -(N**2) * x[2])
    return np.concatenate([x[3:], thrust + gravity])


scenario = rl.Scenario(
    version=1,
    name="Thrusters in the loop, 80 m behind a rocket stage",
    seed=6,
    time=rl.Time(start_utc=start_utc, duration_s=600, frame_rate_hz=1),
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
        motion=rl.motion.StateSpace(
            dynamics="thrusters.py:relative_motion",  # or the function itself; with a name, a recording can be flown again
            axes="rtn",
            relative_to="stage",
            initial_state=[3, -120, -2, 0.02, -0.15, 0.01],
            inputs=[0, 0, 0],
        ),
        attitude=rl.Rtn(euler_zyx_deg=[90, 0, 90]),  # body +x along-track, +y along the orbit normal, +z radially out
    ),
    lidar=rl.Lidar(
        laser=rl.Laser(wavelength_nm=1064, energy_mj=10, pulse_fwhm_ns=8, divergence_deg=12),
        receiver=rl.Receiver(fov_deg=12, f_number=2.8, transmission=0.67, rays_per_pixel=4, min_rays_per_target=1024),
        detector=rl.Empirical(armed_to_m=500),
    ),
)


class Hold:
    """Holds `HOLD_M` behind what is seen: place and speed from smoothed centroids, and a spring with a damper."""

    GAIN, STIFFNESS, DAMPING = 0.25, 0.0016, 0.08  # share a frame; 1/s2: 160 s; 1/s: critical

    def __init__(self):
        self.place, self.speed, self.last_s = None, np.zeros(3), 0.0

    def __call__(self, observation):
        """Return the acceleration to fly with until the next flash."""
        reading = observation.reading
        seen = np.isfinite(reading.range_m)
        if seen.sum() < 20:
            return None
        points_m = (reading.range_m[..., None] * observation.line_of_sight)[seen]
        right, down, ahead = np.median(points_m, axis=0)  # false triggers do not move a median
        measured = np.array([down, -ahead, right])  # the follower from the stage, in rtn axes
        if self.place is None:
            self.place = measured
        step_s, self.last_s = observation.time_s - self.last_s, observation.time_s
        self.place = self.place + self.speed * step_s
        miss = measured - self.place
        self.place = self.place + self.GAIN * miss
        if step_s > 0:
            self.speed = self.speed + self.GAIN**2 / 2 * miss / step_s
        off = self.place - np.array([0.0, -HOLD_M, 0.0])
        return rl.Command(inputs={"follower": -self.STIFFNESS * off - self.DAMPING * self.speed})


if __name__ == "__main__":
    flown = rl.Scenario.load(
        Path(__file__).with_suffix(".toml"), trust_code=True
    )  # its dynamics are those of this file
    for title, controller in (("drifting", None), ("holding", Hold())):
        print(f"\n{title}:")
        for frame in rl.simulate(flown, controller):
            if frame.index % 60 == 59:
                out, along, across = frame.truth.pose("stage.rtn", "follower").translation
                seen = (frame.labels.target >= 0).sum()
                print(f"{frame.time_s:5.0f} s  {out:7.1f} {along:7.1f} {across:7.1f} m in rtn, on {seen:5d} pixels")
