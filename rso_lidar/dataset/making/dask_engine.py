"""Shards made by dask: on a cluster that runs already, or on processes of this machine that are started for it.

Workers write shards into the folder, which all of them must see under one path, and return only the record of each. A task
may run twice, as when a worker is lost: it writes the same bytes to a file of its own and renames it.
"""

from __future__ import annotations

import importlib
from collections.abc import Iterator, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Any

from rso_lidar.dataset.drawing.plan import DatasetPlan
from rso_lidar.dataset.making.shard_making import make_shard
from rso_lidar.dataset.shards.manifest import ShardRecord
from rso_lidar.errors import DatasetError, RsoLidarError, RunError

LOCAL = "local"
_LOST_WORKERS = 16  # workers that may be killed under one shard, before the shard is taken for their cause
_WAITING = 4  # tasks for each worker that are known to the scheduler: memory stays flat for any number of shards
_CONNECT_S = "20s"


def make_shards_by_dask(
    plan: DatasetPlan, folder: Path, numbers: Sequence[int], workers: int, scheduler: str
) -> Iterator[ShardRecord]:
    """Make shards on a cluster of dask and yield the record of each when it is finished, in any order.

    Parameters
    ----------
    plan, folder : of the dataset.
    numbers : of the shards.
    workers : number of processes of a local cluster.
    scheduler : address of a running scheduler, such as ``tcp://10.0.0.1:8786``, or ``local``.

    Raises
    ------
    DatasetError
        If dask is not installed, or no scheduler answers.
    RunError
        If a shard fails, or is lost with one worker after another.
    """
    try:
        dask: Any = importlib.import_module("dask")
        distributed: Any = importlib.import_module("distributed")
    except ImportError:
        raise DatasetError('--engine dask: needs dask; install the extra: pip install "rso-lidar[dask]"') from None
    with ExitStack() as stack:
        stack.enter_context(dask.config.set({"distributed.scheduler.allowed-failures": _LOST_WORKERS}))
        try:
            if scheduler == LOCAL:
                options: dict[str, Any] = {"threads_per_worker": 1, "processes": True, "dashboard_address": None}
                cluster = stack.enter_context(distributed.LocalCluster(n_workers=workers, **options))
                client = stack.enter_context(distributed.Client(cluster))
            else:
                client = stack.enter_context(distributed.Client(scheduler, timeout=_CONNECT_S))
        except (OSError, ValueError) as error:
            said = " ".join(str(error).split())
            problem = f"--scheduler {scheduler}: no scheduler answers ({said:.120})"
            raise DatasetError(f"{problem}; start one, or take local") from None
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
