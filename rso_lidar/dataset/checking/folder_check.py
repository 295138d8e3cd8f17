"""The check of a folder: compare every shard with its hash, and make random samples again bit for bit."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from rso_lidar.dataset.checking.field_leaks import has_forest, search_fields
from rso_lidar.dataset.checking.order_leaks import find_order_leaks
from rso_lidar.dataset.checking.statistics import LabelStatistics, list_columns
from rso_lidar.dataset.drawing.plan import DatasetPlan, make_plan
from rso_lidar.dataset.drawing.sample import draw_sample
from rso_lidar.dataset.making.flight import fly_sample, list_names
from rso_lidar.dataset.reading.random_access import SPEC_FILE, Dataset, Split
from rso_lidar.dataset.shards.layout import VARIABLE_PREFIX, LabelledFrame, list_entries
from rso_lidar.dataset.shards.shard_file import hash_file, list_drafts
from rso_lidar.dataset.specification.spec import DatasetSpec
from rso_lidar.errors import DatasetError, RsoLidarError, suppress_warnings
from rso_lidar.scenario import list_dynamics


@dataclass(frozen=True, eq=False)
class FolderCheck:
    """Result of the check of a folder: damaged and missing shards, frames that differ when made again, and statistics.

    `n_shards` is None where the specification is not the one that made the folder. `is_quick` is whether sizes of shards
    were compared in place of their hashes. `field_leaks` is None where fields were not tested: in a quick check, and without
    scikit-learn.
    """

    dataset: Dataset
    n_shards: int | None
    problems: tuple[str, ...]
    remade: int
    statistics: LabelStatistics | None
    order_leaks: tuple[str, ...] = ()
    field_leaks: tuple[str, ...] | None = None
    is_quick: bool = False

    def describe(self) -> str:
        """Return shards, frames, remade frames, balance, warnings and problems as text."""
        records = self.dataset.records
        of_all = "" if self.n_shards is None else f" of {self.n_shards:,}"
        lines = [
            f"{self.dataset.constants.title}: {len(records):,}{of_all} shards, "
            f"{sum(record.frames for record in records):,} frames, "
            f"{sum(record.size_bytes for record in records) / 1e6:,.1f} MB",
            "quick: sizes of shards were compared, not their hashes, and no frame was made again"
            if self.is_quick
            else f"{self.remade:,} frames were made again and compared bit for bit"
            + (": all are the same" if self.remade and not self.problems else ""),
        ]
        if drafts := list_drafts(self.dataset.folder):
            lines.append(
                f"ignored: temporary files of running or killed runs: {len(drafts):,}, such as {drafts[0]}; make with "
                "--resume removes them"
            )
        if self.statistics is not None:
            lines += ["", *self.statistics.tabulate()]
            leaks = (*self.order_leaks, *(self.field_leaks or ()), *self.statistics.warn())
            lines += [f"warning: {line}" for line in leaks]
            if self.field_leaks is None and not self.is_quick:
                lines.append(
                    'not tested: whether a forest predicts labels from fields and files; pip install "rso-lidar[learn]"'
                )
        return "\n".join([*lines, *(f"problem: {line}" for line in self.problems)])


def check_folder(
    folder: str | Path,
    *,
    samples: int = 4,
    quick: bool = False,
    files: Path | None = None,
    seed: int = 0,
    on_shard: Callable[[int, int], None] | None = None,
    trust_code: bool = False,
    trust_fmu: bool = False,
) -> FolderCheck:
    """Check a dataset: hash every shard, make random samples again, and look for leaks.

    A dataset that this version of rso_lidar cannot make again, such as one whose meshes are not here, has that as a problem
    and is searched for leaks nevertheless.

    Parameters
    ----------
    folder : of the dataset
    samples : number of samples that are made again
    quick : whether to compare sizes of shards in place of their hashes, and to make no sample again
    files : folder in which relative paths of meshes and orbit files start (None: the dataset's folder)
    seed : random seed of the choice of these samples
    on_shard : called after each shard with the number of hashed shards and the number of all shards
    trust_code, trust_fmu : whether Python code, and the native code of FMUs, that its scenario names may run

    Returns
    -------
    FolderCheck

    Raises
    ------
    DatasetError
        If the folder is no dataset, or its scenario names code that is not run.
    """
    dataset = Dataset(folder, verify=not quick)
    samples = 0 if quick else samples
    problems: list[str] = []
    plan = None
    is_contest = dataset.labelled_splits != dataset.splits  # it cannot be made again without its seed
    try:
        plan = None if is_contest else load_plan(dataset, files, trust_code=trust_code, trust_fmu=trust_fmu)
    except RsoLidarError as error:
        problems.append(str(error))
    tell = on_shard or (lambda done, count: None)
    for done, record in enumerate(dataset.records, 1):
        path = dataset.folder / record.path
        if not path.is_file():
            problems.append(f"{path}: is missing; make with --resume")
        elif path.stat().st_size != record.size_bytes:
            problems.append(f"{path}: differs from its size in the manifest; delete it, and make with --resume")
        elif not quick and hash_file(path) != record.sha256:
            problems.append(f"{path}: differs from its hash in the manifest; delete it, and make with --resume")
        tell(done, len(dataset.records))
    is_readable = len(problems) == (plan is None and not is_contest)
    if plan is not None and plan.n_shards > len(dataset.records):
        missing = plan.n_shards - len(dataset.records)
        problems.append(f"{dataset.folder}: {missing:,} of {plan.n_shards:,} shards are not made; make with --resume")
    if plan is not None and samples and (code := _find_code(plan)):
        raise DatasetError(
            f"{dataset.folder}: its scenario names the Python code '{code}', which runs only where it is trusted; give "
            "--trust-code, with --files for its folder, or take --samples 0"
        )
    n_shards = None if plan is None else plan.n_shards
    if not is_readable:
        return FolderCheck(dataset, n_shards, tuple(problems), 0, None, is_quick=quick)
    remade, unlike = (0, []) if plan is None else _make_again(dataset, plan, samples, np.random.default_rng(seed))
    return FolderCheck(
        dataset,
        n_shards,
        (*problems, *unlike),
        remade,
        collect_statistics(dataset),
        _find_order_leaks(dataset),
        tuple(search_fields(dataset)) if has_forest() and not quick else None,
        quick,
    )


def load_plan(
    dataset: Dataset, files: Path | None = None, *, trust_code: bool = False, trust_fmu: bool = False
) -> DatasetPlan:
    """Load the plan of a dataset in a folder.

    Parameters
    ----------
    files : folder in which relative paths start (None: the dataset's). Without it, files other than meshes are not
        compared with their hash
    trust_code, trust_fmu : whether Python code and FMUs that its scenario names may run

    Raises
    ------
    DatasetError
        If the shards were made from other inputs, such as another mesh of the same name.
    """
    plan = make_plan(
        DatasetSpec.load(dataset.folder / SPEC_FILE), files=files, trust_code=trust_code, trust_fmu=trust_fmu
    )
    if (
        files is None
    ):  # files other than meshes may be absent; a sample that is made again shows whether they are the same
        plan = replace(plan, file_sha256=dict(dataset.constants.file_sha256))
    if plan.sha256 != dataset.constants.sha256:
        raise DatasetError(
            f"{dataset.folder}: its {SPEC_FILE}, its scenario or a file that they name is not the one that made its shards, "
            "or an earlier version of rso_lidar ordered them otherwise; restore it, or make the dataset in another folder"
        )
    return plan


def _find_code(plan: DatasetPlan) -> str:
    """Return the name of the first Python code in a plan's scenario if it may not run, or an empty text."""
    if plan.trust_code:
        return ""
    base = plan.scenario()
    parts = (*base.target, base.follower, base.ptu)
    return next((name for part in parts for name in list_dynamics(part)), "")


def collect_statistics(dataset: Dataset) -> LabelStatistics | None:
    """Collect the labels of all frames for statistics; None for a dataset without frames."""
    splits = [dataset.split(name) for name in dataset.labelled_splits]
    if not splits:
        return None
    drawn = [name for name in splits[0].names if name.startswith(VARIABLE_PREFIX)]
    chosen = (*list_columns(splits[0].names), *drawn)
    columns = {name: np.concatenate([split.column(name) for split in splits]) for name in chosen}
    return LabelStatistics(
        {name.removeprefix(VARIABLE_PREFIX): values for name, values in columns.items()}, dataset.classes
    )


def _find_order_leaks(dataset: Dataset) -> tuple[str, ...]:
    """Return a line for each order of the samples that tells their class: their numbers, and their places in each split."""
    splits = [dataset.split(name) for name in dataset.labelled_splits]
    columns = [{name: split.column(name) for name in ("sample", "class_id", "step", "draw")} for split in splits]
    chosen = [(table["step"] == 0) & (table["draw"] == 0) for table in columns]  # one frame of each sample
    sizes = [int(rows.sum()) for rows in chosen]
    if not sum(sizes):
        return ()
    group = np.concatenate([table["class_id"][rows] for table, rows in zip(columns, chosen, strict=True)])
    sample = np.concatenate([table["sample"][rows] for table, rows in zip(columns, chosen, strict=True)])
    orders = {"the number of a sample": sample}
    for number, split in enumerate(splits):
        places = [np.arange(size) if k == number else np.full(size, -1) for k, size in enumerate(sizes)]
        orders[f"the place of a sample in {split.name}"] = np.concatenate(places)
    return tuple(find_order_leaks(orders, group.astype(np.int64) + 1))  # class -1 has no target, and is a class here


def _make_again(dataset: Dataset, plan: DatasetPlan, count: int, rng: np.random.Generator) -> tuple[int, list[str]]:
    """Make `count` random samples again; return the number of compared frames, and a line for each that differs."""
    frames, problems = 0, []
    names = list_names(plan)
    splits = [dataset.split(name) for name in dataset.labelled_splits]
    samples = [split.column("sample") for split in splits]
    for _ in range(count if splits else 0):
        place = int(rng.integers(len(splits)))
        split, sample = splits[place], samples[place]
        index = int(sample[int(rng.integers(len(split)))])
        rows = np.flatnonzero(sample == index)
        with suppress_warnings():
            for row, (frame, drawn) in zip(rows.tolist(), fly_sample(plan, draw_sample(plan, index)), strict=True):
                frames += 1
                unlike = _compare(split, row, frame, [drawn.get(name, np.nan) for name in names], names)
                if unlike:
                    problems.append(
                        f"sample {index}, made again, differs in {', '.join(unlike)}; other versions of libraries or "
                        "another processor made it (see manifest.jsonl), or the shard or a file of the scenario was changed"
                    )
    return frames, problems


def _compare(split: Split, row: int, frame: LabelledFrame, drawn: list[float], names: tuple[str, ...]) -> list[str]:
    """Return the names of the arrays in which a frame differs from the one in its shard."""
    stored = split[row]
    arrays: dict[str, Any] = {**list_entries(frame)}
    arrays |= {VARIABLE_PREFIX + name: value for name, value in zip(names, drawn, strict=True)}
    return [
        name
        for name, value in arrays.items()
        if np.asarray(value, stored[name].dtype).tobytes() != np.asarray(stored[name]).tobytes()
    ]
