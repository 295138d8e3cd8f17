"""Shards made by dask: on a cluster that runs already, or on processes of this machine that are started for it.

Workers write shards into the folder, which all of them must see under one path, and return only the record of each. A task
may run twice, as when a worker is lost: it writes the same bytes to a file of its own and renames it.
"""

from __future__ import annotations

import importlib
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from rso_lidar.dataset.drawing.plan import DatasetPlan
from rso_lidar.dataset.making.shard_making import make_shard
from rso_lidar.dataset.shards.manifest import ShardRecord
from rso_lidar.errors import DatasetError, RsoLidarError, RunError
from rso_lidar.processes import open_dask_client

_WAITING = 4  # tasks for each worker that are known to the scheduler: memory stays flat for any number of shards


def make_shards_by_dask(
    plan: DatasetPlan, folder: Path, numbers: Sequence[int], workers: int, scheduler: str
) -> Iterator[ShardRecord]:
    """Make shards on a cluster of dask and yield the record of each when it is finished, in any order.

    Parameters
    ----------
    workers : number of processes of a local cluster
    scheduler : address of a running scheduler, such as ``tcp://10.0.0.1:8786``, or ``local``

    Raises
    ------
    DatasetError
        If dask is not installed, or no scheduler answers.
    RunError
        If a shard fails, or is lost with one worker after another.
    """
    with open_dask_client(scheduler, workers, DatasetError) as client:
        distributed: Any = importlib.import_module("distributed")
        left = list(numbers)
        place = folder.resolve()

        def submit() -> Any:
            number = left.pop(0)
            return client.submit(
                make_shard, plan, place, plan.shard(number), key=f"shard-{plan.sha256[:8]}-{number}", retries=2
            )

        count = max(1, len(client.scheduler_info()["workers"])) * _WAITING
        done = distributed.as_completed([submit() for _ in range(min(count, len(left)))])
        for future in done:
            if future.status == "error":
                failed = future.exception()
                if isinstance(failed, RsoLidarError):
                    raise failed
                raise RunError(f"dask: a shard failed ({type(failed).__name__}: {failed}); make with --resume")
            yield future.result()
            future.release()
            if left:
                done.add(submit())
