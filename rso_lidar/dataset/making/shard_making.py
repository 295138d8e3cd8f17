"""One shard made: its samples flown, labelled and written. Shard i depends on the plan and on i only."""

from __future__ import annotations

import importlib.metadata
import json
from pathlib import Path

from rso_lidar.dataset.drawing.plan import DatasetPlan, ShardPlace
from rso_lidar.dataset.drawing.sample import draw_sample
from rso_lidar.dataset.making.flight import fly_sample, list_names
from rso_lidar.dataset.shards.manifest import ShardRecord
from rso_lidar.dataset.shards.shard_file import hash_file, write_shard
from rso_lidar.errors import suppress_warnings

_LIBRARIES = ("rso-lidar", "numpy", "scipy", "numba", "embreex")


def make_shard(plan: DatasetPlan, folder: Path, place: ShardPlace) -> ShardRecord:
    """Make one shard and write it, completely or not at all.

    Parameters
    ----------
    place : of the shard, with the numbers of its samples, so that a worker need not assign all samples to splits
    """
    frames, drawn = [], []
    with suppress_warnings():
        for index in place.samples.tolist():
            for frame, numbers in fly_sample(plan, draw_sample(plan, index)):
                frames.append(frame)
                drawn.append(numbers)
    path = folder / place.path
    write_shard(path, frames, drawn, list_names(plan), dataset=plan.sha256)
    versions = json.dumps({name: importlib.metadata.version(name) for name in _LIBRARIES})
    return ShardRecord(place.path, len(frames), len(place.samples), path.stat().st_size, hash_file(path), versions)
