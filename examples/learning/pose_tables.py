"""Compare poses by lidar, camera and both over range and Sun angle, with means and spreads over seeds.

`python examples/learning/pose_tables.py FOLDER --lidar lidar_?_before_icp.npz --camera camera_?_before_icp.npz` reads
predictions of pose.py, one file for each seed. Rotation errors are the least over the symmetry of the true model. A pose of
a wrong model counts with the error that it has, as in `rso-lidar dataset score`.
"""

from itertools import pairwise

import numpy as np
from arguments import run
from sensors import ANGLES_DEG, RANGES_M, begin_parser, find_sun_angle_deg, list_files
from study import COLUMNS, load_scores

import rso_lidar as rl
from rso_lidar.records import rotation_error_rad
from rso_lidar.units import DEG


def measure(path: str, truth: dict[str, np.ndarray], symmetries: tuple) -> dict[str, np.ndarray]:
    """Measure the errors of the poses of a file (frame): rotation [deg], position [m], and whether the class is right.

    Parameters
    ----------
    path : of the predictions.
    truth : columns of the test split.
    symmetries : of the models.
    """
    quaternion = load_scores(path, truth, "quaternion_xyzw")
    rotation = np.full(len(quaternion), np.nan)
    for k, symmetry in enumerate(symmetries):
        some = truth["model_id"] == k
        rotation[some] = rotation_error_rad(quaternion[some], truth["quaternion_xyzw"][some], symmetry) / DEG
    away = np.linalg.norm(load_scores(path, truth, "position_m") - truth["position_m"], axis=1)
    right = load_scores(path, truth).argmax(axis=1) == truth["class_id"]
    return {"rotation_deg": rotation, "position_m": away, "share": away / truth["range_to_target_m"], "right": right}


def summarise(errors: dict[str, np.ndarray], some: np.ndarray) -> list[float]:
    """Return the numbers of a row for one run.

    Parameters
    ----------
    errors : result of `measure`.
    some : (frame) which frames.
    """
    rotation = errors["rotation_deg"][some]
    return [
        float(np.median(rotation)),
        100.0 * float(np.mean(rotation < 5.0)),
        100.0 * float(np.mean(rotation < 15.0)),
        float(np.median(errors["position_m"][some])),
        100.0 * float(np.median(errors["share"][some])),
        100.0 * float(errors["right"][some].mean()),
    ]


def main() -> None:
    options = begin_parser(__doc__).parse_args()
    files = list_files(options)
    data = rl.dataset.open(options.dataset)
    split = data.split("test")
    columns = (*COLUMNS, "model_id", "range_to_target_m", "sun_direction", "position_m", "quaternion_xyzw")
    truth = {name: np.asarray(split.column(name)) for name in columns}
    craft = truth["present"] > 0
    angle = np.full(len(craft), np.nan)
    angle[craft] = find_sun_angle_deg(truth["sun_direction"][craft], truth["position_m"][craft])
    near = truth["reporting_pixels"] >= 100
    groups = {"all": craft, "100 reporting pixels or more": craft & near}
    for name, edges, values in (
        ("Range, m", RANGES_M, truth["range_to_target_m"]),
        ("Sun angle, deg", ANGLES_DEG, angle),
    ):
        groups |= {f"{name}: {a:.0f} to {b:.0f}": craft & (values >= a) & (values < b) for a, b in pairwise(edges)}
    for sensor, paths in files.items():
        runs = [measure(path, truth, data.symmetries) for path in paths]
        print(f"{sensor}, {len(runs)} runs\n{'':28} frames   rotation, deg   within 5 deg, %  within 15 deg, %", end="")
        print("     position, m   of the range, %    right class, %")
        for name, some in groups.items():
            if some.any():
                each = np.array([summarise(errors, some) for errors in runs])
                spread = each.std(axis=0, ddof=1) if len(each) > 1 else np.zeros(each.shape[1])
                words = [f"{a:10.2f} ± {b:5.2f}" for a, b in zip(each.mean(axis=0), spread, strict=True)]
                print(f"{name:28} {some.sum():6,}" + " ".join(words))


if __name__ == "__main__":
    run(main)
