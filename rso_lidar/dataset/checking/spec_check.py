"""The check of a specification: sizes, time, counts by class and split, balance and leaks, from samples that are flown."""

from __future__ import annotations

import os
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from rso_lidar.dataset.checking.statistics import LabelStatistics, find_leaks, list_columns
from rso_lidar.dataset.drawing.plan import DatasetPlan, make_plan
from rso_lidar.dataset.drawing.sample import draw_sample
from rso_lidar.dataset.making.flight import fly_sample, list_names, list_numbers
from rso_lidar.dataset.making.make import check_samples
from rso_lidar.dataset.shards.layout import LabelledFrame, list_entries
from rso_lidar.dataset.shards.shard_file import write_shard
from rso_lidar.dataset.specification.spec import DatasetSpec
from rso_lidar.dataset.specification.tables import SPLITS
from rso_lidar.errors import suppress_warnings
from rso_lidar.interruption import make_temporary_folder

_FLOWN = 64  # samples, of all classes together: a check of some seconds
_DRAWN = 1000  # samples whose drawn numbers are compared: no flight, so many more
_QUICK_SHARE = 8  # of these numbers a quick check takes one part


@dataclass(frozen=True, eq=False)
class SpecCheck:
    """Estimated size and time of a dataset, and what was found in the samples of a check.

    Parameters
    ----------
    plan : of the dataset
    statistics : of the frames that were flown
    drawn_warnings : leaks in drawn numbers, found without a flight
    frame_s : time that one process takes for a frame [s]
    frame_bytes : bytes of a frame on disk
    """

    plan: DatasetPlan
    statistics: LabelStatistics
    drawn_warnings: tuple[str, ...]
    frame_s: float
    frame_bytes: float

    @property
    def warnings(self) -> list[str]:
        """One line for each leak and finding."""
        return list(dict.fromkeys([*self.drawn_warnings, *self.statistics.warn()]))

    def describe(self) -> str:
        """Return sizes, time, counts, balance and warnings as text."""
        spec, plan = self.plan.spec, self.plan
        frames, cores = spec.n_samples * spec.frames_per_sample, os.cpu_count() or 1
        minutes = frames * self.frame_s / cores / 60.0
        counts = plan.count_samples()
        lines = [
            f"{spec.name}: {spec.n_samples:,} samples, {frames:,} frames, shards: {plan.n_shards:,}",
            f"about {frames * self.frame_bytes / 1e6:,.1f} MB, and {minutes:,.1f} min on {cores} cores "
            f"({self.frame_s * 1e3:.0f} ms and {self.frame_bytes / 1e3:.0f} kB for a frame, measured here)",
            "",
            f"{'samples':20} " + " ".join(f"{name:>8}" for name in SPLITS),
            *(
                f"{target_class.name:20} " + " ".join(f"{n:8,}" for n in row)
                for target_class, row in zip(spec.classes, counts.tolist(), strict=True)
            ),
            "",
            f"of {len(self.statistics.columns['draw']):,} frames that were flown for this check:",
            *self.statistics.tabulate(),
        ]
        remarks = [f"warning: {line}" for line in self.warnings] or [
            "no leak was found, and every frame with a target has returns"
        ]
        return "\n".join([*lines, *remarks])


def check_spec(
    spec: DatasetSpec | str | Path, *, quick: bool = False, trust_code: bool = False, trust_fmu: bool = False
) -> SpecCheck:
    """Check a specification: draw a thousand samples, fly 64 of them, and look for leaks.

    Parameters
    ----------
    spec : the specification, or its TOML file
    quick : whether to draw and fly an eighth of these samples only, at least one of each class
    trust_code, trust_fmu : whether Python code, and the native code of FMUs, that the scenario names may run

    Returns
    -------
    SpecCheck

    Raises
    ------
    ScenarioError, DatasetError
        For a specification that is not valid.
    """
    plan = make_plan(spec, trust_code=trust_code, trust_fmu=trust_fmu)
    check_samples(plan)
    part = _QUICK_SHARE if quick else 1
    flown: list[LabelledFrame] = []
    numbers: list[dict[str, float]] = []
    took_s: list[float] = []
    with suppress_warnings():
        for index in _choose(plan, _FLOWN // part):
            began_s = time.perf_counter()
            for frame, drawn in fly_sample(plan, draw_sample(plan, index)):
                flown.append(frame)
                numbers.append(drawn)
            took_s.append(time.perf_counter() - began_s)
    statistics = LabelStatistics(_collect(flown), plan.classes)
    with make_temporary_folder() as folder:
        file = Path(folder, "shard.h5")
        write_shard(file, zip(flown, numbers, strict=True), list_names(plan), dataset=plan.sha256)
        frame_bytes = file.stat().st_size / len(flown)
    per_frame = float(np.median(took_s)) / plan.spec.frames_per_sample
    return SpecCheck(plan, statistics, _compare_drawn(plan, _DRAWN // part), per_frame, frame_bytes)


def _choose(plan: DatasetPlan, count: int) -> list[int]:
    """Return the numbers of some samples, evenly from each class."""
    owner = plan.membership.target_class
    each = max(1, count // len(plan.spec.classes))
    chosen = []
    for k in range(len(plan.spec.classes)):
        mine = np.flatnonzero(owner == k)
        chosen += mine[np.unique(np.linspace(0, len(mine) - 1, min(each, len(mine))).astype(int))].tolist()
    return chosen


def _collect(frames: list[LabelledFrame]) -> dict[str, Any]:
    entries = [list_entries(frame) for frame in frames]
    return {name: np.array([entry[name] for entry in entries]) for name in list_columns(entries[0])}


def _compare_drawn(plan: DatasetPlan, count: int) -> tuple[str, ...]:
    """Draw some samples, and return one line for each drawn number that reveals the class."""
    rows, owner = [], []
    with suppress_warnings():
        for index in _choose(plan, count):
            sample = draw_sample(plan, index)
            if sample.class_id >= 0:
                rows.append(list_numbers(sample))
                owner.append(sample.class_id)
    names = dict.fromkeys(name for row in rows for name in row)
    columns = {name: np.array([row.get(name, np.nan) for row in rows]) for name in names}
    return tuple(find_leaks(columns, np.array(owner), plan.classes))
