"""A photon-counting camera on a bench: Geiger-mode pixels, a plate at 150 m, 50 nJ and 100 pulses a frame."""

import datetime

import numpy as np

import rso_lidar as rl

scenario = rl.Scenario(
    version=1,
    name="Bench, photon counting",
    seed=150,
    world=rl.World(axes="local"),  # root axes without an Earth: x ahead, y left, z up
    time=rl.Time(
        start_utc=datetime.datetime(2024, 9, 17, 12, tzinfo=datetime.UTC),
        duration_s=2,
        frame_rate_hz=10,
    ),
    target=[
        rl.Target(
            name="plate",
            model="plate",  # 4 m x 4 m, Lambertian 0.30
            motion=rl.Fixed(position_m=[150, 0, 0]),
            attitude=rl.LookAt(at="follower"),
        )
    ],
    follower=rl.Follower(motion=rl.Fixed(position_m=[0, 0, 0])),  # looks along +x
    lidar=rl.Lidar(
        laser=rl.Laser(wavelength_nm=1064, energy_mj=0.00005, pulse_fwhm_ns=1, divergence_deg=2.5),
        receiver=rl.Receiver(n_rows=32, n_cols=32, pixel_pitch_um=100, fov_deg=2.5, f_number=2.8, transmission=0.67),
        detector=rl.GeigerArray(gate_from_m=50, gate_to_m=350, pulses=100),
    ),
)

if __name__ == "__main__":
    print(scenario.describe())
    for frame in rl.simulate(scenario, frames=range(3)):
        on = frame.labels.filled_fraction > 0.999
        error_m = frame.range_m[on] - frame.labels.range_m[on]
        print(
            f"{frame.labels.photons[on].mean():.2f} photons a pulse: {np.isfinite(error_m).mean():.1%} found, "
            f"{np.nanmean(error_m):+.3f} m +- {np.nanstd(error_m):.3f} m, {frame.intensity_counts[on].mean():.1f} counts"
        )
