"""Clients of dask: of a cluster that runs already, or of processes of this machine that are started for it."""

from __future__ import annotations

import importlib
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from typing import Any

from rso_lidar.errors import RsoLidarError, ScenarioError, did_you_mean

LOCAL = "local"
_LOST_WORKERS = 16  # workers that may be killed under one task, before the task is taken for their cause
_CONNECT_S = "20s"


def choose_scheduler(engine: str, scheduler: str | None, error: type[RsoLidarError] = ScenarioError) -> str | None:
    """Return the scheduler that the options of a command choose; None for a pool of processes without dask.

    Parameters
    ----------
    engine, scheduler : values of --engine and --scheduler
    error : raised for values that do not fit
    """
    if engine not in ("pool", "dask"):
        raise error(f"--engine {engine}: is not an engine{did_you_mean(engine, ('pool', 'dask'))}; take pool or dask")
    if scheduler is not None and engine != "dask":
        raise error(f"--scheduler {scheduler}: is for --engine dask; add it, or leave out --scheduler")
    return (scheduler or LOCAL) if engine == "dask" else None


@contextmanager
def open_dask_client(scheduler: str, workers: int, error: type[RsoLidarError] = ScenarioError) -> Iterator[Any]:
    """Yield a client of dask.

    Parameters
    ----------
    scheduler : address of a running scheduler, such as ``tcp://10.0.0.1:8786``, or ``local``
    workers : number of processes of a local cluster
    error : raised if dask is not installed, or no scheduler answers
    """
    try:
        dask: Any = importlib.import_module("dask")
        distributed: Any = importlib.import_module("distributed")
    except ImportError:
        raise error('--engine dask: needs dask; install the extra: pip install "rso-lidar[dask]"') from None
    with ExitStack() as stack:
        stack.enter_context(dask.config.set({"distributed.scheduler.allowed-failures": _LOST_WORKERS}))
        try:
            if scheduler == LOCAL:
                options: dict[str, Any] = {"threads_per_worker": 1, "processes": True, "dashboard_address": None}
                cluster = stack.enter_context(distributed.LocalCluster(n_workers=workers, **options))
                client = stack.enter_context(distributed.Client(cluster))
            else:
                client = stack.enter_context(distributed.Client(scheduler, timeout=_CONNECT_S))
        except (OSError, ValueError) as problem:
            said = " ".join(str(problem).split())
            raise error(
                f"--scheduler {scheduler}: no scheduler answers ({said:.120}); start one, or take local"
            ) from None
        yield client
