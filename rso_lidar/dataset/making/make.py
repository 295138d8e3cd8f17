"""Datasets made by one call: begun or continued, shard by shard, and finished.

Shard i depends on the plan and on i only. Workers of dask write shards into the folder, which all of them must see under
one path, and return only the record of each. A task of theirs may run twice, as when a worker is lost: it writes the same
bytes to a file of its own and renames it.
"""

from __future__ import annotations

import importlib.metadata
import json
import os
import re
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path

from rso_lidar.dataset.drawing.plan import DatasetPlan, ShardPlace, make_plan
from rso_lidar.dataset.drawing.sample import draw_sample, list_ends
from rso_lidar.dataset.making.flight import fly_sample, list_names
from rso_lidar.dataset.making.folder_setup import begin_folder, remove_drafts
from rso_lidar.dataset.reading.random_access import Dataset
from rso_lidar.dataset.shards.manifest import ShardRecord, append_record, read_manifest
from rso_lidar.dataset.shards.shard_file import hash_file, write_shard
from rso_lidar.dataset.specification.spec import DatasetSpec
from rso_lidar.errors import DatasetError, suppress_warnings
from rso_lidar.files import convert_path, hold_lock
from rso_lidar.processes import map_unordered, open_executor

_TRIED = 40  # samples that are drawn before the first shard, so that a wrong law is found at once
_LIBRARIES = ("rso-lidar", "numpy", "scipy", "numba", "embreex")


def make(
    spec: DatasetSpec | str | Path,
    folder: str | os.PathLike[str],
    *,
    workers: int | None = None,
    scheduler: str | None = None,
    shards: str | None = None,
    resume: bool = False,
    on_shard: Callable[[int, int], None] | None = None,
    trust_code: bool = False,
    trust_fmu: bool = False,
) -> Dataset:
    """Make a dataset in a folder. Every shard is written completely or not at all, so that a killed run loses one at most.

    Parameters
    ----------
    spec : the specification, or its TOML file
    folder : of the dataset, new unless it is continued
    workers : number of processes (None: one per core; 1: this process). The bytes do not depend on it. A script that uses
        workers keeps its own code under ``if __name__ == "__main__":``
    scheduler : address of a dask scheduler whose workers make the shards, or ``local`` for a cluster of `workers` processes
        that is started here (None: a pool of processes, without dask). Needs the extra ``dask``
    shards : which shards to make: ``a:b``, or ``i/n`` for the i-th of n equal parts, from 0. Runs may share a folder
    resume : whether to continue a folder that was begun before
    on_shard : called with the number of finished shards and that of all, at the start and after each shard
    trust_code, trust_fmu : whether Python code, and the native code of FMUs, may run that the scenario names, here and in
        the workers

    Returns
    -------
    Dataset
        What the folder holds now.

    Raises
    ------
    ScenarioError, DatasetError
        For a specification that is not valid, for a folder that holds something else, and for a scheduler that does not
        answer.
    RunError
        If writing fails, or a worker ends early.
    """
    if workers is not None and (not isinstance(workers, int) or isinstance(workers, bool) or workers < 1):
        raise DatasetError(f"workers: needs a whole number from 1, not {workers!r}; or leave it out")
    place = convert_path(folder, DatasetError)
    plan = make_plan(spec, trust_code=trust_code, trust_fmu=trust_fmu)
    chosen = choose_shards(shards, plan.n_shards)
    check_samples(plan)
    begin_folder(plan, place, join=resume or shards is not None)
    held = place / f".make{'' if shards is None else re.sub(r'[^0-9]', '-', '-' + shards)}.lock"
    busy = f"{place}: another run is making these shards; wait for it, or divide the work by --shards"
    with hold_lock(held, busy=busy):
        _make_shards(plan, place, chosen, workers or os.cpu_count() or 1, scheduler, on_shard)
    return Dataset(place)


def _make_shards(
    plan: DatasetPlan,
    place: Path,
    chosen: Sequence[int],
    workers: int,
    scheduler: str | None,
    on_shard: Callable[[int, int], None] | None,
) -> None:
    """Make those of some shards that are not finished, and keep the record of each."""
    finished = read_manifest(place, plan.sha256)
    left = [number for number in chosen if not _is_finished(plan, place, number, finished)]
    tell = on_shard or (lambda done, count: None)
    tell(len(chosen) - len(left), len(chosen))
    with open_executor(None if scheduler is None else workers, scheduler=scheduler) as executor:
        make_one = partial(make_shard, plan, place if executor is None else place.resolve())
        records = map_unordered(make_one, map(plan.shard, left), min(workers, len(left)), executor)
        for done, record in enumerate(records, len(chosen) - len(left) + 1):
            append_record(place, record, plan.sha256)
            tell(done, len(chosen))
    remove_drafts(place, read_manifest(place, plan.sha256))


def _is_finished(plan: DatasetPlan, folder: Path, number: int, finished: Mapping[str, ShardRecord]) -> bool:
    """Return whether a shard is in the manifest and in its place."""
    path = plan.shard(number).path
    return path in finished and (folder / path).is_file()


def choose_shards(text: str | None, count: int) -> Sequence[int]:
    """Return the numbers of the shards that a text chooses: ``a:b``, ``i/n``, or all.

    Parameters
    ----------
    text : the choice; None for all
    count : number of all shards

    Raises
    ------
    DatasetError
        For another text, or one that chooses none.

    >>> list(choose_shards("1/3", 8)), list(choose_shards("2:", 4))
    ([1, 4, 7], [2, 3])
    """
    if text is None:
        return range(count)
    if (part := re.fullmatch(r"(\d+)/(\d+)", text)) is not None:
        i, n = int(part[1]), int(part[2])
        if i >= n:
            raise DatasetError(
                f"--shards {text}: parts are numbered 0 to {n - 1}" if n else f"--shards {text}: needs parts"
            )
        return range(i, count, n)  # may be empty where there are more parts than shards
    if (span := re.fullmatch(r"(\d*):(\d*)", text)) is not None:
        chosen = range(count)[int(span[1]) if span[1] else None : int(span[2]) if span[2] else None]
        if not chosen:
            raise DatasetError(f"--shards {text}: chooses none of the shards 0 to {count - 1}; choose some of them")
        return chosen
    raise DatasetError(f"--shards {text}: needs a:b or i/n, such as 0:100 or 3/16; correct it")


def check_samples(plan: DatasetPlan) -> None:
    """Draw some samples of each class, and both ends of every law, so that a value that makes no
    valid scenario, or code that may not run, is found before the first flash.
    """
    owner = plan.membership.target_class
    with suppress_warnings():
        base = plan.scenario()
        _ = base.bodies, base.pan_tilt
        for k in range(len(plan.spec.classes)):
            mine = (owner == k).nonzero()[0]
            step = max(1, len(mine) * len(plan.spec.classes) // _TRIED)
            for index in mine[::step].tolist():
                draw_sample(plan, index)
            for forced in list_ends(plan.spec, k):
                draw_sample(plan, int(mine[0]), forced)


def make_shard(plan: DatasetPlan, folder: Path, place: ShardPlace) -> ShardRecord:
    """Make one shard and write it, completely or not at all.

    Parameters
    ----------
    place : of the shard, with the numbers of its samples, so that a worker need not assign all samples to splits
    """
    path = folder / place.path
    with suppress_warnings():
        flown = (pair for index in place.samples.tolist() for pair in fly_sample(plan, draw_sample(plan, index)))
        count = write_shard(path, flown, list_names(plan), dataset=plan.sha256)
    versions = json.dumps({name: importlib.metadata.version(name) for name in _LIBRARIES})
    return ShardRecord(place.path, count, len(place.samples), path.stat().st_size, hash_file(path), versions)
