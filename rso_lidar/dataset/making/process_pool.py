"""Shards made one by one here, or by worker processes."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path

from rso_lidar.dataset.drawing.plan import DatasetPlan
from rso_lidar.dataset.making.shard_making import make_shard
from rso_lidar.dataset.shards.manifest import ShardRecord
from rso_lidar.processes import Processes


def make_shards(plan: DatasetPlan, folder: Path, numbers: Sequence[int], workers: int) -> Iterator[ShardRecord]:
    """Make shards and yield the record of each when it is finished, in any order.

    Parameters
    ----------
    plan, folder : of the dataset
    numbers : of the shards
    workers : number of processes; 1 is this process
    """
    count = min(workers, len(numbers))
    if count < 2:
        for number in numbers:
            yield make_shard(plan, folder, plan.shard(number))
        return
    with Processes(count, partial(make_shard, plan, folder)) as processes:
        yield from processes.map_unordered(map(plan.shard, numbers))
