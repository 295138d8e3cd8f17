"""A mission flown many times with errors: probabilities, spreads of the path, and what they come from."""

from __future__ import annotations

import copy
from collections.abc import Callable
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from rso_lidar.confidence_intervals import clopper_pearson_bounds
from rso_lidar.errors import ScenarioError
from rso_lidar.files import check_writable, write_columns
from rso_lidar.motion import get_chief_name
from rso_lidar.picture import SavedResult
from rso_lidar.processes import check_workers, map_unordered
from rso_lidar.scenario import Scenario, require_scenario
from rso_lidar.study.dispersions.dispersion_figure import dispersion_figure
from rso_lidar.study.dispersions.kept_runs import identify_runs, read_blocks, write_blocks
from rso_lidar.study.dispersions.linear_dispersion import SOURCES, TARGET
from rso_lidar.study.dispersions.mission_disperser import BLOCK, Block, MissionDisperser

_MOST_RUNS = 1_000_000
_CONFIDENCE = 0.95
PERCENTILES = (2.5, 50.0, 97.5)
_AXES = ("radial", "along", "cross")
KNOWLEDGE = ("knowledge_sigma", "linear_knowledge_sigma", "filter_sigma")  # by runs, linear, as the filters state it
_STATES = 6
_POINTED = {
    "target": "ideally, at the target",
    "navigation": "where navigation takes the target to be",
    "plan": "where the plan has the target",
}
_APART = 1.25  # ratio of standard deviations by linear covariance and by runs above which the former does not hold


@dataclass(frozen=True, eq=False)
class DispersedMission(SavedResult):
    """Runs of a mission with errors.

    Parameters
    ----------
    title, target : of the scenario, and name of the target
    table : columns (run) by name: nearest approach, collision, keep-out, field, detection and delta-v of each run
    tubes : columns (time) by name: the flight without errors, standard deviations by runs and by linear covariance with
        their shares by source, percentiles, and the probability that the target was detected by then; with a filter, the
        standard deviations of its error by runs, by linear covariance and as it states them, and its mean NEES
    hard_body_radius_m, keep_out_m : distances that count as a collision and as a violation [m]
    omits : what the runs leave out, in sentences
    sources : names of the sources of errors, of which `tubes` has the shares
    pointing : by what the lidar was pointed, "target", "navigation" or "plan"
    kept : file in which the finished runs are kept, None without one
    """

    title: str
    target: str
    table: dict[str, np.ndarray]
    tubes: dict[str, np.ndarray]
    hard_body_radius_m: float
    keep_out_m: float
    omits: tuple[str, ...] = ()
    sources: tuple[str, ...] = SOURCES
    pointing: str = "target"
    kept: Path | None = None

    @property
    def n_runs(self) -> int:
        """Number of runs."""
        return len(self.table["run"])

    def probability(self, column: str) -> tuple[float, float, float]:
        """Return the share of runs with an event, and the bounds of its 95 % confidence interval.

        Parameters
        ----------
        column : of `table` with 0 or 1 for each run, such as ``collision``
        """
        share = float(np.mean(self.table[column]))
        one_sided = 0.5 + 0.5 * _CONFIDENCE
        low, high = clopper_pearson_bounds(share, self.n_runs, one_sided)
        return share, low, high

    def describe(self) -> str:
        """Describe probabilities and spreads in lines of text."""
        last = {key: float(values[-1]) for key, values in self.tubes.items()}
        rows = [
            ("collision", "collision", f"nearer than {self.hard_body_radius_m:.3g} m"),
            ("collision, no burn made", "collision_without_burns", "the first burn and all after it fail"),
        ]
        if self.keep_out_m > 0.0:
            rows.append(("keep-out entered", "keep_out", f"{self.keep_out_m:g} m"))
        aimed = f"in every sample; pointed {_POINTED[self.pointing]}"
        rows += [("origin held in the field", "held_always", aimed), ("whole body held", "whole_held_always", aimed)]
        lines = [f"{self.title}: {self.n_runs:,} runs about {self.target}"]
        for word, column, about in rows:
            share, low, high = self.probability(column)
            lines.append(f"  P({word}) {share:.4g}  (95 %: {low:.4g} to {high:.4g}; {about})")
        origin, whole = (float(np.mean(self.table[column])) for column in ("held_fraction", "whole_held_fraction"))
        lines.append(f"  in the field      origin {origin:.1%}, whole body {whole:.1%} of the samples")
        lines.append(f"  P(detected by the end) {last['detected_probability']:.4g}")
        for word, column, form, unit in (
            ("nearest approach", "nearest_m", ",.1f", "m"),
            ("delta-v of burns", "delta_v_m_s", ",.4f", "m/s"),
        ):
            levels = " / ".join(f"{level:{form}}" for level in np.percentile(self.table[column], PERCENTILES))
            lines.append(f"  {word}  {levels} {unit} (2.5, 50, 97.5 %)")
        lines.append("  at the end            runs    linear  " + "".join(f"{name:>12}" for name in self.sources))
        for axis in _AXES:
            shares = "".join(f"{100.0 * last[f'{axis}_{name}_share']:10.1f} %" for name in self.sources)
            lines.append(
                f"    {axis:6} sigma {last[f'{axis}_sigma_m']:11.3f} {last[f'{axis}_linear_sigma_m']:9.3f} m{shares}"
            )
        lines += self._describe_filter(last) if "nees" in last else []
        if "body_x_sigma_m" in last:
            lines.append("  in the target's axes  runs    linear")
            lines += [
                f"    {axis:6} sigma {last[f'body_{axis}_sigma_m']:11.3f} {last[f'body_{axis}_linear_sigma_m']:9.3f} m"
                for axis in "xyz"
            ]
        return "\n".join([*lines, *(f"  {line}" for line in self.omits)])

    def _describe_filter(self, last: dict[str, float]) -> list[str]:
        """Describe what the filters know at the end, and whether they know how well."""
        lines = ["  error of the filter     runs    linear      stated by the filters"]
        for axis in _AXES:
            runs, linear, stated = (last[f"{axis}_{word}_m"] for word in KNOWLEDGE)
            lines.append(f"    {axis:6} sigma {runs:11.3f} {linear:9.3f} {stated:11.3f} m")
        low, high = nees_bounds(self.n_runs)
        nees = self.tubes["nees"]
        ratios = np.array(
            [self.tubes[f"{axis}_{KNOWLEDGE[1]}_m"] / self.tubes[f"{axis}_{KNOWLEDGE[0]}_m"] for axis in _AXES]
        )
        if max(ratios.max(), 1.0 / ratios.min()) > _APART + 5.0 / np.sqrt(2.0 * self.n_runs):
            lines.append(
                f"    the linear covariance does not hold on the way, with {ratios.min():.2g} to {ratios.max():.2g} times "
                "the sigma of the runs: range from directions alone, and limits of sensors, are not linear"
            )
        return [
            *lines,
            f"  mean NEES {last['nees']:.2f} at the end, {nees.min():.2f} to {nees.max():.2f} on the way  (consistent: 6; "
            f"95 %: {low:.2f} to {high:.2f} at one instant)",
        ]

    def figure(self) -> Any:
        """Return a matplotlib Figure: the tubes of the path, the range, and the probability of detection over time."""
        return dispersion_figure(
            self.tubes, self.table, self.target, self.title, self.keep_out_m, self.hard_body_radius_m
        )

    def columns(self) -> dict[str, np.ndarray]:
        """Return the columns of the table by name."""
        return self.table

    def save_tubes(self, path: str | Path) -> Path:
        """Write the table of spreads over time; an existing file is replaced.

        Parameters
        ----------
        path : of the output, .csv

        Returns
        -------
        Path
            of the file

        Raises
        ------
        RecordingError
            For another suffix, or a path that cannot be written.
        """
        return write_columns(check_writable(path, (".csv",), overwrite=True), self.tubes)


def nees_bounds(runs: int, share: float = _CONFIDENCE) -> tuple[float, float]:
    """Return the two-sided bounds of the mean NEES of runs whose filters are consistent (chi-square distribution)."""
    from scipy.special import chdtri

    tail = 0.5 * (1.0 - share)
    low, high = (float(chdtri(_STATES * runs, over)) / runs for over in (1.0 - tail, tail))
    return low, high


_OMITS = "the change of drag, sunlight and tides over a deviation"


def disperse(
    scenario: Scenario,
    runs: int = 1000,
    *,
    target: str | None = None,
    workers: int | None = None,
    executor: Executor | None = None,
    working: str | Path | None = None,
    on_runs: Callable[[int, int], None] | None = None,
) -> DispersedMission:
    """Fly a mission many times with errors, and propagate its linear covariance beside.

    Each run draws its errors from the scenario's seed and its own number, so that runs do not depend on how many there are,
    nor on workers. All runs of a block are integrated together; deviations are not linearised.

    Parameters
    ----------
    scenario : with the table `dispersion`
    runs : number of runs, from 2
    target : name of the target (None: the body that the follower approaches, else the first target)
    workers : number of processes (None: this one alone)
    executor : in the manner of `concurrent.futures`, which flies blocks of runs in place of `workers`: a pool of threads or
        processes, or ``client.get_executor()`` of dask. It changes no result
    working : file in which finished runs are kept; an interrupted study, or one of fewer runs, continues from it. Its name
        is extended by eight hex digits that identify the scenario
    on_runs : called with the number of finished runs and that of all, at the start and after each block

    Returns
    -------
    DispersedMission
        Probabilities with their confidence, spreads over time, and one row for each run.

    Raises
    ------
    ScenarioError
        If the scenario has no `dispersion`, no orbit or no such target, or numbers are outside their limits.
    """
    require_scenario(scenario, "disperse")
    if not isinstance(runs, int) or isinstance(runs, bool) or not 2 <= runs <= _MOST_RUNS:
        raise ScenarioError(f"runs: needs a whole number from 2 to {_MOST_RUNS:,}, not {runs!r}")
    check_workers(workers, executor)
    mission_disperser = MissionDisperser(scenario, _find_target(scenario, target))
    kept = None if working is None else Path(f"{working}.{identify_runs(scenario, mission_disperser.target)}.npz")
    blocks = read_blocks(kept) if kept is not None else {}
    tell = on_runs or (lambda done, count: None)
    wanted = list(range(0, runs, BLOCK))
    tell(min(BLOCK * sum(begin in blocks for begin in wanted), runs), runs)
    left = [first_run for first_run in wanted if first_run not in blocks]
    fly = partial(_fly_block if executor is None else _fly_block_anew, mission_disperser)
    for begin, block in map_unordered(fly, left, min(workers or 1, len(left)), executor):
        blocks[begin] = block
        if kept is not None:
            write_blocks(kept, blocks)
        tell(min(BLOCK * sum(first_run in blocks for first_run in wanted), runs), runs)
    joined = {name: np.concatenate([blocks[begin][name] for begin in wanted])[:runs] for name in blocks[wanted[0]]}
    return replace(_join(mission_disperser, joined), kept=kept)


def _find_target(scenario: Scenario, target: str | None) -> str:
    if scenario.dispersion is None:
        raise ScenarioError("disperse: the scenario has no table dispersion; add [dispersion] with the errors")
    names = [candidate.name for candidate in scenario.target]
    chief = get_chief_name(scenario.bodies[-1].motion)
    name = target or (chief if chief in names else next(iter(names), ""))
    if name not in names:
        raise ScenarioError(f"target: no target '{name}' (known: {', '.join(names) or 'none'})")
    orbiting = {body.name for body in scenario.bodies if body.orbits}
    if scenario.is_local or not orbiting >= {name, scenario.bodies[-1].name}:
        raise ScenarioError("disperse: needs orbits about the Earth, of the follower and of the target")
    return name


def _fly_block(mission_disperser: MissionDisperser, begin: int) -> tuple[int, Block]:
    return begin, mission_disperser.fly(range(begin, begin + BLOCK))


def _fly_block_anew(mission_disperser: MissionDisperser, begin: int) -> tuple[int, Block]:
    """Fly a block of runs, whose flight is made anew so that the threads of a worker share none."""
    return _fly_block(copy.copy(mission_disperser), begin)


def _join(mission_disperser: MissionDisperser, block: Block) -> DispersedMission:
    """Return the result of all runs."""
    position = mission_disperser.nominal_m + block.pop("deviation_m")
    missed = block.pop("missed")
    error, stated, nees = (block.pop(name, None) for name in ("knowledge_error_m", "filter_sigma_m", "nees"))
    linear, attitude = mission_disperser.disperser.find_linear(), mission_disperser.attitude
    range_m = np.sqrt(np.sum(position**2, axis=2))
    tubes: dict[str, np.ndarray] = {"time_s": mission_disperser.sample_s}
    sigma = np.sqrt(np.diagonal(linear.covariance, axis1=1, axis2=2))
    total = np.maximum(sigma[:, :3] ** 2, 1e-300)
    for k, axis in enumerate(_AXES):
        tubes[f"{axis}_m"] = mission_disperser.nominal_m[:, k]
        tubes[f"{axis}_sigma_m"] = position[:, :, k].std(axis=0, ddof=1)
        tubes[f"{axis}_linear_sigma_m"] = sigma[:, k]
        for name in mission_disperser.disperser.sources:
            tubes[f"{axis}_{name}_share"] = linear.shares[name][:, k] / total[:, k]
        for level, row in zip(PERCENTILES, np.percentile(position[:, :, k], PERCENTILES, axis=0), strict=True):
            tubes[f"{axis}_p{level:g}_m"] = row
    for level, row in zip(PERCENTILES, np.percentile(range_m, PERCENTILES, axis=0), strict=True):
        tubes[f"range_p{level:g}_m"] = row
    if error is not None and stated is not None and nees is not None and linear.knowledge is not None:
        known = np.sqrt(np.diagonal(linear.knowledge, axis1=1, axis2=2))
        for k, axis in enumerate(_AXES):
            columns = error[:, :, k].std(axis=0, ddof=1), known[:, k], np.sqrt(np.mean(stated[:, :, k] ** 2, axis=0))
            tubes |= {f"{axis}_{word}_m": column for word, column in zip(KNOWLEDGE, columns, strict=True)}
        tubes["nees"] = nees.mean(axis=0)
    if attitude is not None:
        in_body, planned = block.pop("in_body_m"), attitude.place(mission_disperser.nominal_m)
        linear_m = attitude.find_linear_sigma_m(mission_disperser.nominal_m, linear.covariance[:, :3, :3])
        for k, axis in enumerate("xyz"):
            tubes[f"body_{axis}_m"] = planned[:, k]
            tubes[f"body_{axis}_sigma_m"] = in_body[:, :, k].std(axis=0, ddof=1)
            tubes[f"body_{axis}_linear_sigma_m"] = linear_m[:, k]
    tubes["detected_probability"] = 1.0 - missed.mean(axis=0)
    return DispersedMission(
        mission_disperser.scenario.name,
        mission_disperser.target,
        block,
        tubes,
        mission_disperser.hard_body_radius_m,
        mission_disperser.keep_out.radius_m,
        (_describe_omissions(mission_disperser),),
        mission_disperser.disperser.sources,
        mission_disperser.pointing,
    )


def _describe_omissions(mission_disperser: MissionDisperser) -> str:
    """Describe what the runs leave out."""
    missing = [
        word
        for word, has in (
            ("orbit", TARGET in mission_disperser.disperser.sources),
            ("attitude", mission_disperser.attitude),
        )
        if not has
    ]
    own = f"errors of the target's own {' and '.join(missing)}, and " if missing else ""
    return f"left out: {own}{_OMITS}"
