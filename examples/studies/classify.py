"""How far can the camera of Fuller et al. classify? Its network needs some 100 pixels on target (sec. 5, fig. 17).

The paper's seven spacecraft, as they are shipped; given a folder of meshes of the same names, those.
`python examples/studies/classify.py` prints the table; classify.md reads it.
"""

import datetime
import math
import sys
from pathlib import Path
from typing import Any

import numpy as np

import rso_lidar as rl
from rso_lidar.scene import load_mesh, model

SEVEN = ("dawn", "juno", "lro", "rosetta", "stardust", "suomi_npp", "tdrs")
NEEDED = 100.0  # pixels
ATTITUDES = 40
CAMERA = rl.Lidar(preset="gsfl_1064")


def craft(folder: str | None = None) -> dict[str, str]:
    """Return the models to ask about by name: names of the catalogue, or the mesh files of a folder."""
    return {name: name if folder is None else str(Path(folder) / f"{name}.stl") for name in SEVEN}


def scene_of(mesh: str, range_m: float, attitude: Any, seed: int = 1) -> rl.Scenario:
    """Return a target at a range, turned, before the camera of Fuller et al."""
    return rl.Scenario(
        version=1,
        name="classify",
        seed=seed,
        world=rl.World(axes="local"),
        time=rl.Time(start_utc=datetime.datetime(2024, 9, 17, tzinfo=datetime.UTC), duration_s=1, frame_rate_hz=1),
        target=[
            rl.Target(
                name="craft",
                model=mesh,
                center_of_mass_m=(0.0, 0.0, 0.0),
                material=rl.Lambertian(reflectance=0.30),
                motion=rl.Fixed(position_m=(range_m, 0.0, 0.0)),
                attitude=rl.FixedAttitude(quaternion_xyzw=tuple(attitude.as_quat(canonical=True).tolist())),
            )
        ],
        follower=rl.Follower(motion=rl.Fixed(position_m=(0.0, 0.0, 0.0))),
        ptu=rl.Ptu(point=rl.TrackPoint(at="craft")),
        lidar=CAMERA,
    )


def size_m(mesh: str) -> np.ndarray:
    """Return the three sides of a model [m]."""
    return np.array(load_mesh(Path(mesh) if "/" in mesh else model(mesh).path).size_m, dtype=float)


def silhouettes_m2(mesh: str, attitudes: Any) -> np.ndarray:
    """Return the areas [m²] that a camera sees of a craft, attitude by attitude: filled pixels times their size."""
    range_m = 1.2 * float(np.linalg.norm(size_m(mesh))) / (2 * math.tan(0.5 * CAMERA.receiver.fov_rad))
    pixel_m2 = (range_m * CAMERA.receiver.pixel_tangent) ** 2
    areas = []
    for attitude in attitudes:
        frame = next(rl.simulate(scene_of(mesh, range_m, attitude)))
        areas.append(float(frame.labels.filled_fraction.sum()) * pixel_m2)
    return np.array(areas)


def detected(mesh: str, range_m: float, attitudes: Any) -> np.ndarray:
    """Return how many pixels truly report the craft at a range, attitude by attitude, through the whole chain."""
    counts = []
    for number, attitude in enumerate(attitudes):
        frame = next(rl.simulate(scene_of(mesh, range_m, attitude, seed=number)))
        counts.append(int((frame.valid & (frame.labels.target >= 0)).sum()))
    return np.array(counts)


def study(models: dict[str, str], attitudes: int = ATTITUDES) -> list[dict[str, float | str]]:
    """Return one row for each craft: sizes [m], silhouettes [m²], ranges of 100 pixels [m], and what the chain detects."""
    from scipy.spatial.transform import Rotation

    turned = Rotation.random(attitudes, random_state=np.random.default_rng(7))
    rows = []
    for name, mesh in models.items():
        sides = size_m(mesh)
        area = silhouettes_m2(mesh, turned)
        box = rl.budget(CAMERA, target_m=sides.tolist(), range_m=[100.0, 1000.0])
        lowest, mean, highest = (
            rl.budget(CAMERA, target_m=math.sqrt(value), range_m=[100.0, 1000.0]).range_of_pixels(NEEDED)
            for value in (area.min(), area.mean(), area.max())
        )
        light_m = rl.budget(CAMERA, range_m=[100.0, 1000.0]).curves[0].max_range_m  # of a pixel that is filled
        rows.append(
            {
                "craft": name,
                "longest_m": float(sides.max()),
                "silhouette_m2": float(area.mean()),
                "box_m2": box.target_area_m2,
                "worst_m": lowest,
                "mean_m": mean,
                "best_m": highest,
                "box_range_m": box.range_of_pixels(NEEDED),
                "light_m": light_m,
                "detected": float(detected(mesh, min(mean, light_m), turned).mean()),
            }
        )
    return rows


if __name__ == "__main__":
    print("                     silhouette [m²]   range of 100 pixels [m]          light   pixels that")
    print("craft       size [m]   mean     box   worst    mean    best     box      [m]   report there")
    for row in study(craft(*sys.argv[1:2])):
        print(
            "{craft:<11}{longest_m:9.1f}{silhouette_m2:7.1f}{box_m2:8.1f}{worst_m:8.0f}{mean_m:8.0f}{best_m:8.0f}"
            "{box_range_m:8.0f}{light_m:9.0f}{detected:15.0f}".format(**row)
        )
