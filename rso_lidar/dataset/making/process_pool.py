"""Shards made: one by one here, or by worker processes. Shard i depends on the plan and on i only."""

from __future__ import annotations

import importlib.metadata
import json
from collections.abc import Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, wait
from functools import partial
from pathlib import Path
from typing import Any

from rso_lidar.dataset.drawing.plan import DatasetPlan
from rso_lidar.dataset.drawing.sample import draw_sample
from rso_lidar.dataset.making.flight import fly_sample, list_names
from rso_lidar.dataset.shards.manifest import ShardRecord
from rso_lidar.dataset.shards.shard_file import hash_file, write_shard
from rso_lidar.errors import suppress_warnings
from rso_lidar.processes import Processes

_LIBRARIES = ("rso-lidar", "numpy", "scipy", "numba", "embreex")


def make_shard(plan: DatasetPlan, folder: Path, number: int) -> ShardRecord:
    """Make one shard and write it, completely or not at all.

    Parameters
    ----------
    plan, folder : of the dataset.
    number : of the shard.
    """
    place = plan.shard(number)
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


def make_shards(plan: DatasetPlan, folder: Path, numbers: Sequence[int], workers: int) -> Iterator[ShardRecord]:
    """Make shards and yield the record of each when it is finished, in any order.

    Parameters
    ----------
    plan, folder : of the dataset.
    numbers : of the shards.
    workers : number of processes; 1 is this process.
    """
    count = min(workers, len(numbers))
    if count < 2:
        for number in numbers:
            yield make_shard(plan, folder, number)
        return
    left = list(numbers)
    with Processes(count, partial(make_shard, plan, folder)) as processes:
        waiting: set[Future[Any]] = set()
        try:
            while left or waiting:
                while left and len(waiting) < 2 * count:
                    waiting.add(processes.submit(left.pop(0)))
                done, waiting = wait(waiting, return_when=FIRST_COMPLETED)
                for future in done:
                    yield processes.result(future)
        except BaseException:
            processes.abandon()
            raise
