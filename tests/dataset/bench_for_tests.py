"""A dataset that is cheap to make: small bodies before a sensor of 16 x 16 pixels with the fast detector."""

from pathlib import Path

import numpy as np

from rso_lidar.dataset import DatasetSpec
from rso_lidar.dataset.drawing.plan import DatasetPlan

SCENARIO = """
version = 1
name = "bodies on a bench"
world = { axes = "local" }
time = { start_utc = 2024-09-17T12:00:00Z, duration_s = 2, frame_rate_hz = 5 }
follower = { motion = { type = "fixed", position_m = [0, 0, 0] } }
[[target]]
name = "body"
model = "plate"
motion = { type = "fixed", position_m = [300, 0, 0] }
[lidar]
preset = "gsfl_1064"
detector = { type = "empirical" }
receiver = { n_rows = 16, n_cols = 16, fov_deg = 2.0, rays_per_pixel = 4 }
"""
CAMERA = (
    'camera=[{name="nav",mount={position_m=[0,0.1,0]},lens={fov_deg=2.4,f_number=2,n_rows=24,n_cols=32,'
    "rays_per_pixel=16},auto_exposure={}}]"
)
SUN = "world.sun_direction=[-1, 0.2, 0.1]"
EYE = '{name="eye",bands="rgb",start_ms=0.5,lens={fov_deg=2,f_number=4,n_rows=6,n_cols=8}}'  # in three bands
SPEC = """
version = 1
name = "two bodies"
scenario = "bench.toml"
seed = 11
draws = 2
shard_frames = 6
split = { type = "random", test = 0.4 }
view = { range_m = { type = "log_uniform", low = 50, high = 400 } }
variable = [{ field = "lidar.laser.energy_mj", law = { type = "uniform", low = 10, high = 60 } }]
classes = [
  { name = "plate", models = ["plate"], samples = 6 },
  { name = "round", models = ["sphere", "capsule"], samples = 6 },
  { name = "empty", empty = true, samples = 3 },
]
"""


def make_spec(folder: Path, text: str = SPEC, **changes) -> DatasetSpec:
    """Return a specification, with its base scenario written to a folder."""
    (folder / "bench.toml").write_text(SCENARIO, encoding="utf-8")
    (folder / "spec.toml").write_text(text, encoding="utf-8")
    spec = DatasetSpec.load(folder / "spec.toml")
    return spec.replace(**changes) if changes else spec


def find_sample(plan: DatasetPlan, k: int, number: int) -> int:
    """Return the number in the dataset of a sample of a class, by its number in the class."""
    classes, numbers, _ = plan.membership
    return int(np.flatnonzero((classes == k) & (numbers == number))[0])
