"""Remakes the golden frames beside this file: ``python -m tests.golden.remake``, and look at the difference before.

Geometry is that of one frame; of its noise, what 2000 draws of the detector come to, pixel by pixel.
"""

import datetime
import tempfile
from pathlib import Path

import numpy as np

import rso_lidar as rl
from rso_lidar import detector
from tests.detector.returns_for_tests import STATED
from tests.optics.bench_for_tests import box, plate, sphere, write_stl

FOLDER = Path(__file__).parent
START = datetime.datetime(2024, 9, 17, 12, tzinfo=datetime.UTC)
GEOMETRY = (
    "range_m",
    "first_range_m",
    "cluster_count",
    "target",
    "part",
    "facet",
    "cos_incidence",
    "photons",
    "filled_fraction",
)
DRAWS = 2000


def satellite():
    """Return the triangles of a bus, two wings and a dish."""
    wing = plate(1.5, 5.0, n=3)
    return np.concatenate(
        [
            box(2.0, 1.5, 1.8),
            wing + np.array([0, 3.6, 0.2]),
            wing - [0, 3.6, -0.2],
            sphere(0.8, 2) + np.array([0.9, 0, 1.5]),
        ]
    )


def bench(folder):
    """Return a satellite before a tilted wall on a bench, bright enough to saturate and dim enough to miss."""
    write_stl(folder / "sat.stl", satellite())
    write_stl(folder / "wall.stl", plate(60.0, n=4))
    com = {"center_of_mass_m": (0.0, 0.0, 0.0)}
    return rl.Scenario(
        version=1,
        name="golden bench",
        seed=1,
        world=rl.World(axes="local"),
        time=rl.Time(start_utc=START, duration_s=1.0, frame_rate_hz=1.0),
        target=(
            rl.Target(
                name="sat",
                model=str(folder / "sat.stl"),
                motion=rl.Fixed(position_m=(700.0, 1.0, -0.5)),
                attitude=rl.FixedAttitude(euler_zyx_deg=(30.0, 20.0, 10.0)),
                material=rl.Phong(diffuse=0.10, specular=0.50, exponent=30.0),
                **com,
            ),
            rl.Target(
                name="wall",
                model=str(folder / "wall.stl"),
                motion=rl.Fixed(position_m=(760.0, 20.0, 5.0)),
                attitude=rl.FixedAttitude(euler_zyx_deg=(20.0, 60.0, 0.0)),
                material=rl.Lambertian(reflectance=0.02),
                **com,
            ),
        ),
        follower=rl.Follower(motion=rl.Fixed(position_m=(0.0, 0.0, 0.0))),
        lidar=rl.Lidar(
            laser=rl.Laser(divergence_deg=1.5, footprint="gaussian"),
            receiver=rl.Receiver(fov_deg=1.5, aperture_mm=60.0, n_rows=32, n_cols=32),
            detector=rl.Empirical(**STATED, false_alarms_per_s=0.0),
        ),
    )


def orbit(folder):
    """Return a satellite in geosynchronous orbit seen from 400 m behind it, through a PTU that tracks it."""
    write_stl(folder / "sat.stl", satellite())
    return rl.Scenario(
        version=1,
        name="golden orbit",
        seed=2,
        time=rl.Time(start_utc=START, duration_s=200.0, frame_rate_hz=0.1),
        target=(
            rl.Target(
                name="sat",
                model=str(folder / "sat.stl"),
                center_of_mass_m=(0.1, 0.0, 0.2),
                motion=rl.Kepler(
                    epoch_utc=START,
                    semi_major_axis_km=42_164.0,
                    eccentricity=0.001,
                    inclination_deg=3.0,
                    raan_deg=40.0,
                    argument_of_perigee_deg=10.0,
                    true_anomaly_deg=70.0,
                ),
                attitude=rl.Spin(axis=(0.2, 0.1, 1.0), rate_deg_s=1.0),
            ),
        ),
        follower=rl.Follower(
            motion=rl.Hill(relative_to="sat", position_m=(10.0, -400.0, 5.0), velocity_m_s=(0.0, 0.3, 0.0)),
            attitude=rl.Rtn(euler_zyx_deg=(90.0, 0.0, 0.0)),
        ),
        ptu=rl.Ptu(mount=rl.Mount(position_m=(0.0, 0.0, 0.5)), point=rl.TrackPoint(at="sat"), response=rl.Ideal()),
        lidar=rl.Lidar(
            laser=rl.Laser(divergence_deg=2.0, energy_mj=2.5),
            receiver=rl.Receiver(fov_deg=2.0, f_number=4.0, n_rows=32, n_cols=32, rays_per_pixel=9),
            detector=rl.Empirical(**STATED, false_alarms_per_s=0.0),
        ),
    )


SCENES = {"bench": (bench, 0), "orbit": (orbit, 13)}


def made(name):
    """Return the labels of a golden scene's frame by name, and that frame with its photons and its detector."""
    build, number = SCENES[name]
    with tempfile.TemporaryDirectory() as folder:
        scenario = build(Path(folder))
        frame = next(iter(rl.simulate(scenario, frames=[number], keep=["photons"])))
    return {field: getattr(frame.labels, field) for field in GEOMETRY}, frame, scenario.lidar.detector


def noise(frame, part, draws, seed):
    """Return, pixel by pixel, how many draws reported a return, and sums of range error and of counts, and of squares."""
    rng = np.random.default_rng(seed)
    shape = frame.labels.range_m.shape
    sums = {name: np.zeros(shape) for name in ("found", "saturated", "range", "range2", "counts", "counts2")}
    reference = np.nan_to_num(frame.labels.first_range_m)
    for _ in range(draws):
        reading, _ = detector.detect(frame.kept["photons"], part, rng)
        valid = np.isfinite(reading.range_m)
        off = np.where(valid, reading.range_m.astype(float) - reference, 0.0)
        counts = reading.intensity_counts.astype(float)
        for total, value in zip(sums.values(), (valid, reading.saturated, off, off**2, counts, counts**2), strict=True):
            total += value
    return sums


def main():
    for name in SCENES:
        geometry, frame, part = made(name)
        sums = noise(frame, part, DRAWS, seed=20240917)
        np.savez_compressed(
            FOLDER / f"{name}.npz", draws=DRAWS, **geometry, **{f"noise_{k}": v for k, v in sums.items()}
        )
        lit = int(np.sum(geometry["target"] >= 0))
        print(f"{name}.npz: {lit} pixels on a target, {np.sum(sums['found']) / DRAWS:.1f} found on the mean")


if __name__ == "__main__":
    main()
