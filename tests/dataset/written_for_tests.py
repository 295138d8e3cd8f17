"""A dataset of a few small frames, made of numbers with a meaning and without a simulator."""

import json

import numpy as np

from rso_lidar.dataset import DatasetSpec
from rso_lidar.dataset.shards.layout import LabelledFrame
from rso_lidar.dataset.shards.manifest import ShardRecord, append_record
from rso_lidar.dataset.shards.sensor_file import Constants, write_constants
from rso_lidar.dataset.shards.shard_file import hash_file, write_shard

SPEC = """
version  = 1
name     = "Two craft, \\"near\\" & far"
scenario = "bench_plate.toml"
seed     = 7
draws    = 2

[[classes]]
name    = "relay"
samples = 3
models  = ["tdrs"]

[[classes]]
name    = "cube"
samples = 3
models  = ["cubesat_3u", "cubesat_6u"]

[[classes]]
name    = "nothing"
samples = 2
empty   = true

[view]
range_m = { type = "log_uniform", low = 100, high = 900 }

[[variable]]
field = "lidar.laser.energy_mj"
law   = { type = "uniform", low = 20, high = 50 }
"""
SHA256 = "5e" * 32
CLASSES, MODELS = ("relay", "cube"), ("tdrs", "cubesat_3u", "cubesat_6u")
PART_CLASSES = ("bus", "solar_array", "antenna", "other")
N_ROWS, N_COLS = 6, 8
SHARDS = {"train": (4, 2), "test": (4,)}  # frames of each
LIDAR = {"laser": {"wavelength_nm": 1064.0, "energy_mj": 50.0}, "receiver": {"fov_deg": 2.5, "n_rows": 6, "n_cols": 8}}


def make_frame(number):
    """Return frame `number` of a dataset: every fourth has no target, and a target is a block of 3 x 2 pixels."""
    present = number % 4 != 3
    first_row, first_col = number % 3, number % 5
    block = (slice(first_row, first_row + 3), slice(first_col, first_col + 2))
    image = np.zeros((N_ROWS, N_COLS))
    distance_m = 100.0 * (number + 1)
    true_range_m, range_m = np.full(image.shape, np.nan), np.full(image.shape, np.nan)
    photons, counts, target, part_class = image.copy(), image.copy(), image - 1, image - 1
    if present:
        true_range_m[block] = distance_m + 0.25
        range_m[block] = distance_m + np.array([[0.3, 0.2], [0.25, np.nan], [0.26, 0.24]])
        photons[block] = np.array([[900.0, 0.4], [50.0, 3.0], [2.0, 1.0]])
        counts[block] = np.array([[40000, 30], [500, 0], [60, 41]])
        target[block], part_class[block] = 0, np.array([[0, 0], [1, 1], [2, 3]])
    range_m[5, 7], counts[5, 7] = 8000.0, 12  # a false return
    lit = (target == 0) & (photons >= 1.0)
    rows, cols = np.nonzero(lit)
    nothing = np.full(3, np.nan)
    return LabelledFrame(
        range_m=range_m,
        intensity_counts=counts,
        saturated=counts > 30000,
        true_range_m=true_range_m,
        photons=photons,
        target=target,
        part=part_class,
        part_class_id=part_class,
        sample=np.array(number // 2),
        step=np.array(0),
        draw=np.array(number % 2),
        seed=np.array(2**53 + number),
        frame_number=np.array(number),
        time_s=np.array(0.2 * number),
        class_id=np.array(number % 2 if present else -1),
        model_id=np.array(2 * (number % 2) if present else -1),
        sensor_id=np.array(0),
        present=np.array(present),
        position_m=np.array([1.0, -2.0, distance_m]) if present else nothing,
        quaternion_xyzw=np.array([0.5, -0.5, 0.5, 0.5]) if present else np.full(4, np.nan),
        range_to_target_m=np.array(np.hypot(np.hypot(1.0, 2.0), distance_m) if present else np.nan),
        lit_pixels=np.array(len(rows)),
        reporting_pixels=np.array(5 if present else 0),
        total_photons=np.array(photons.sum()),
        box_px=np.array([rows.min(), cols.min(), rows.max(), cols.max()] if present else [-1] * 4),
        intrinsics_px=np.array([180.0, 180.0, 3.5, 2.5]),
        sun_direction=nothing,
        part_light_fraction=np.array([0.9, 0.05, 0.03, 0.02]) if present else np.full(4, np.nan),
    )


def make_dataset(folder, shards=SHARDS, make_frame=make_frame):
    """Write a dataset, of ten frames in three shards if not said otherwise, and return its folder."""
    folder.mkdir()
    spec = DatasetSpec.loads(SPEC)
    (folder / "dataset.toml").write_text(spec.dumps(), encoding="utf-8")
    (folder / "scenario.toml").write_text('version = 1\nname = "base"\n[[target]]\nname = "craft"\n', encoding="utf-8")
    sight = np.dstack([np.zeros((N_ROWS, N_COLS, 2)), np.ones((N_ROWS, N_COLS))])
    names = {
        "classes": CLASSES,
        "models": MODELS,
        "sensors": ("sensor",),
        "part_classes": PART_CLASSES,
        "splits": tuple(shards),
    }
    constants = Constants(
        sha256=SHA256,
        title=spec.name,
        **names,
        model_parts=dict.fromkeys(MODELS, ("body",)),
        symmetries=dict.fromkeys(MODELS),
        line_of_sight={"sensor": sight},
        lidars={"sensor": json.dumps(LIDAR)},
    )
    write_constants(folder, constants)
    number = 0
    for split, sizes in shards.items():
        (folder / split).mkdir()
        for shard, size in enumerate(sizes):
            place = folder / split / f"{shard:06d}.h5"
            frames = [(make_frame(k), {"lidar.laser.energy_mj": 20.0 + k}) for k in range(number, number + size)]
            write_shard(place, frames, ("lidar.laser.energy_mj",), dataset=SHA256)
            record = ShardRecord(
                path=f"{split}/{shard:06d}.h5",
                frames=size,
                samples=size // 2,
                size_bytes=place.stat().st_size,
                sha256=hash_file(place),
                versions=json.dumps({"rso-lidar": "0.1.0", "numpy": "2.4.6"}),
            )
            append_record(folder, record, SHA256)
            number += size
    return folder
