"""Verification of requirements on a scenario, a study or a recording."""

from __future__ import annotations

import math
from collections.abc import Callable
from collections.abc import Sequence as ListLike
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from rso_lidar.confidence_intervals import student_bounds
from rso_lidar.errors import RsoLidarError, ScenarioError, add_place, suppress_warnings
from rso_lidar.processes import check_workers, open_executor
from rso_lidar.records import Frame
from rso_lidar.scenario import Scenario
from rso_lidar.study.trades.definition import Study
from rso_lidar.study.trades.execution import Trade, trade
from rso_lidar.study.trades.merits import MERITS, Run, list_evaluated, measure_tracker_error_m
from rso_lidar.study.trades.run_sums import RunSums
from rso_lidar.study.verification.evidence import Evidence, bound_merit, bound_series
from rso_lidar.study.verification.figures import ComputedFigures
from rso_lidar.study.verification.flown_frames import (
    FlownFrames,
    RecordedFrames,
    SimulatedFrames,
    follows_frames,
    needs_poses,
)
from rso_lidar.study.verification.matrix import RequirementResult, Verdict, VerificationMatrix, judge
from rso_lidar.study.verification.quantities import STATISTICS
from rso_lidar.study.verification.requirements_file import Requirement, Requirements

Progress = Callable[[int, int], None]


def verify(
    requirements: Requirements | str | Path,
    subject: Scenario | Study | Trade | ListLike[Frame],
    *,
    folder: Path | None = None,
    threads: int | None = None,
    workers: int | None = None,
    executor: Executor | None = None,
    on_step: Progress | None = None,
    trust_code: bool = False,
    trust_fmu: bool = False,
) -> VerificationMatrix:
    """Verify requirements on a scenario, a trade study or a recording.

    Of a scenario, the frames that requirements need are simulated, each once. Of a study, a requirement is met if it is
    met at every point; its seeds are the sample. Of a recording, the recorded frames count.

    Parameters
    ----------
    requirements : the requirements, or their TOML file
    subject : a scenario, a study (which is run), a finished study, or a recording
    folder : folder of the mesh files that a recording names (None: the working folder)
    threads : of a simulation (None: one for each core); the result does not depend on it
    workers : number of processes that run a study or simulate frames, instead of threads; the result does not depend on it
    executor : in the manner of `concurrent.futures`, in place of `workers`; as for `simulate`
    on_step : called with the number of finished frames or runs and that of all, at the start and after each
    trust_code, trust_fmu : whether Python code, and the native code of FMUs, may run that the scenario of a study names. A
        scenario has its own trust

    Returns
    -------
    VerificationMatrix

    Raises
    ------
    ScenarioError
        For requirements that are not valid, and for quantities or targets that the subject does not have.
    RecordingError
        For a recording without the frames that are asked for.
    """
    asked = requirements if isinstance(requirements, Requirements) else Requirements.load(requirements)
    tell = on_step or (lambda done, count: None)
    check_workers(workers, executor)
    if isinstance(subject, Study | Trade):
        how: Any = {"workers": workers, "executor": executor, "trust_code": trust_code, "trust_fmu": trust_fmu}
        return _verify_study(asked, subject, threads, tell, **how)
    if isinstance(subject, Scenario):
        with suppress_warnings(), open_executor(workers, executor=executor) as opened:
            return _verify_frames(
                asked, lambda ready: SimulatedFrames(subject, asked.target, ready, asked.seeds, threads, opened), tell
            )
    if not isinstance(subject, ListLike) or isinstance(subject, str):
        raise ScenarioError(
            f"requirements: need a Scenario, a Study, a Trade or a recording, not {subject!r:.60}; load it from its file"
        )
    with suppress_warnings():
        return _verify_frames(asked, lambda ready: RecordedFrames(subject, asked.target, ready, folder), tell)


# ------------------------------------------------------------------------------------------ scenarios and recordings


def _verify_frames(
    asked: Requirements, make: Callable[[Callable[[], None]], FlownFrames], tell: Progress
) -> VerificationMatrix:
    """Verify requirements on frames of one scenario, simulated or recorded."""
    done = [0, 0]

    def ready() -> None:
        done[0] += 1
        tell(min(done[0], done[1]), done[1])

    flown = make(ready)
    figures = ComputedFigures(flown.scenario, flown.number)
    _check(asked, figures)
    done[1] = flown.count(asked.requirement)
    tell(0, done[1])
    flown.prepare(asked.requirement)
    results = []
    for number, requirement in enumerate(asked.requirement):
        with add_place(_name_place(asked, number)):
            results.append(_verify_one(requirement, flown, figures))
    source, runs = flown.scenario.source, f", {flown.n_runs} runs" if flown.n_runs > 1 else ""
    name = flown.scenario.target[flown.number].name
    kind = "recording of" if isinstance(flown, RecordedFrames) else "scenario"
    subject = f"{kind} '{source.title}', target {name}, seed {source.seed}{runs}"
    return VerificationMatrix(asked.name, subject, tuple(results), source.versions)


def _check(asked: Requirements, figures: ComputedFigures) -> None:
    """Compute cheap figures first, so that a wrong name is found before any frame is simulated."""
    for number, requirement in enumerate(asked.requirement):
        if requirement.what.kind == "parameter":
            with add_place(_name_place(asked, number)):
                figures.compute(requirement)


def _name_place(asked: Requirements, number: int) -> str:
    """Return the place of a requirement in its file."""
    return f"{asked.where}: requirement[{number}] ({asked.requirement[number].id})"


def _verify_one(requirement: Requirement, flown: FlownFrames, figures: ComputedFigures) -> RequirementResult:
    """Verify one requirement."""
    evidence = _find_evidence(requirement, flown, figures)
    margin = requirement.margin(evidence.low, evidence.high)
    verdict = judge(requirement, evidence.low, evidence.high)
    return RequirementResult(
        requirement,
        figures.unit(requirement),
        evidence.value,
        evidence.low,
        evidence.high,
        margin,
        verdict,
        evidence.sample,
        evidence.note,
    )


def _find_evidence(requirement: Requirement, flown: FlownFrames, figures: ComputedFigures) -> Evidence:
    """Return the value of a requirement's quantity with its bounds."""
    if not requirement.needs_frames:
        chosen = requirement.frames is not None or requirement.between_m is not None
        numbers = flown.select(requirement) if requirement.what.kind == "merit" and chosen else None
        value = figures.compute(requirement, numbers)
        return Evidence(value, value, value, "computed", "" if math.isfinite(value) else "has no value here")
    numbers = flown.select(requirement)
    if follows_frames(requirement):
        assert requirement.confidence is not None
        tables = flown.tables(numbers, poses=needs_poses(requirement))
        if requirement.what.kind == "tracking":
            assert requirement.statistic is not None
            return bound_series(
                [_column(requirement, table) for table in tables],
                STATISTICS[requirement.statistic],
                requirement.confidence,
                9,
            )
        errors = [measure_tracker_error_m(table) for table in tables]
        merit = MERITS[requirement.quantity]
        return bound_series(errors, STATISTICS["rms"], requirement.confidence, merit.decimals)
    run = Run(flown.scenario, flown.number, RunSums(0, 0.0), np.empty(0), numbers)
    sums, merit = flown.sums(numbers), MERITS[requirement.quantity]
    if requirement.confidence is None:
        for frame in sums:
            run.sums.include(frame)
        value = merit.of(run)
        return Evidence(
            value, value, value, f"{len(sums):,} frames", "" if math.isfinite(value) else "has no value here"
        )
    return bound_merit(merit, run, sums, requirement.confidence)


def _column(requirement: Requirement, table: dict[str, np.ndarray]) -> np.ndarray:
    """Return the column of the tracker's table that a requirement names; NaN where ICP found no pose in any frame."""
    column = requirement.what.column
    if column in table:
        return table[column].astype(float)
    if needs_poses(requirement) and column in ("icp_rms_m", "icp_error_m", "icp_error_rad", "icp_long_axis_error_rad"):
        return np.full(len(table["time_s"]), np.nan)
    raise ScenarioError(
        f"requirement {requirement.id}: quantity: the tracker's table has no column '{column}' (known: {', '.join(table)})"
    )


# --------------------------------------------------------------------------------------------------------- studies


@dataclass(frozen=True)
class _BoundedPoint:
    """One point of a study: value of a quantity with bounds, and with the wider bounds for a verdict `not met`."""

    evidence: Evidence
    wide_low: float
    wide_high: float


def _verify_study(
    asked: Requirements,
    study: Study | Trade,
    threads: int | None,
    tell: Progress,
    **how: Any,
) -> VerificationMatrix:
    """Verify requirements at each point of a study.

    Parameters
    ----------
    how : further arguments of `trade`, for a study that is not finished
    """
    definition = study.study if isinstance(study, Trade) else study
    needed = tuple(
        dict.fromkeys(requirement.quantity for requirement in asked.requirement if requirement.what.kind == "merit")
    )
    for number, requirement in enumerate(asked.requirement):
        with add_place(_name_place(asked, number)):
            _check_for_study(requirement, study)
    if asked.target is not None and asked.target != definition.target:
        if isinstance(study, Trade):
            raise ScenarioError(
                f"{asked.where}: target: the study evaluated another target; run it for '{asked.target}'"
            )
        definition = definition.replace(target=asked.target)
    if isinstance(study, Trade):
        finished_trade = study
    else:
        merits = needed or ("off_boresight_deg",)  # a study computes at least one figure, and this is the cheapest
        chosen = definition.replace(merits=merits)
        finished_trade = trade(chosen, on_row=tell, **how)
    results = []
    for number, requirement in enumerate(asked.requirement):
        with add_place(_name_place(asked, number)):
            results.append(_verify_points(requirement, finished_trade, threads))
    points, seeds = len(finished_trade.plan.points), definition.seeds
    subject = f"study '{definition.name}', {points} point{'s' * (points != 1)}, {seeds} run{'s' * (seeds != 1)} each"
    return VerificationMatrix(asked.name, subject, tuple(results), finished_trade.base.source.versions)


def _check_for_study(requirement: Requirement, study: Study | Trade) -> None:
    """Raise `ScenarioError` for a requirement that a study cannot answer."""
    if requirement.what.kind == "tracking":
        raise ScenarioError(
            f"quantity: '{requirement.quantity}' needs a scenario or a recording; a study has tracker_error_m"
        )
    if requirement.what.kind == "merit" and (requirement.frames is not None or requirement.between_m is not None):
        name = "frames" if requirement.frames is not None else "between_m"
        raise ScenarioError(f"{name}: a study has its own frames; leave it out, and set frames in the study")
    if isinstance(study, Trade) and requirement.what.kind == "merit" and requirement.quantity not in study.table:
        known = ", ".join(list_evaluated(study.study.merits))
        raise ScenarioError(
            f"quantity: the study has no '{requirement.quantity}' (it has {known}); add it to its merits"
        )


def _verify_points(requirement: Requirement, finished_trade: Trade, threads: int | None) -> RequirementResult:
    """Verify a requirement at each point of a study, and return the result of the worst point."""
    seeds, n_points = finished_trade.study.seeds, len(finished_trade.plan.points)
    points, unit = [], requirement.what.unit
    for point in range(n_points):
        if requirement.what.kind == "merit":
            points.append(
                _bound_point(
                    requirement,
                    finished_trade.table[requirement.quantity][point * seeds : (point + 1) * seeds],
                    n_points,
                )
            )
            continue
        try:
            with suppress_warnings():
                scenario = finished_trade.plan.scenario(point * seeds)
            figures = ComputedFigures(scenario, finished_trade.study.number(scenario), threads)
            value, unit = figures.compute(requirement), figures.unit(requirement)
            points.append(_BoundedPoint(Evidence(value, value, value, "computed"), value, value))
        except RsoLidarError:
            if n_points == 1:
                raise
            points.append(_BoundedPoint(Evidence(math.nan, math.nan, math.nan, "computed"), math.nan, math.nan))
    verdicts = [judge(requirement, point.evidence.low, point.evidence.high) for point in points]
    failed = [judge(requirement, point.wide_low, point.wide_high) == "not met" for point in points]
    verdict: Verdict = "met" if all(each == "met" for each in verdicts) else "not met" if any(failed) else "not shown"
    margins = [requirement.margin(point.evidence.low, point.evidence.high) for point in points]
    order = [-math.inf if math.isnan(margin) else margin for margin in margins]
    candidates = [k for k in range(n_points) if failed[k] or verdict != "not met"]
    worst = min(candidates, key=lambda k: order[k])
    shown = points[worst].evidence
    met = sum(each == "met" for each in verdicts)
    note = f"met at {met:,} of {n_points:,} points; row {worst * seeds} is the worst: "
    note += _describe_point(finished_trade, worst)
    if why := str(finished_trade.table["error"][worst * seeds]):
        note += f"; it could not be flown: {why}"
    shown = replace(shown, note=f"{note}; {shown.note}" if shown.note else note)
    return RequirementResult(
        requirement, unit, shown.value, shown.low, shown.high, margins[worst], verdict, shown.sample, shown.note
    )


def _bound_point(requirement: Requirement, values: np.ndarray, n_points: int) -> _BoundedPoint:
    """Return the mean of a figure of merit over the seeds of a point, with bounds by Student's t.

    A verdict ``not met`` needs one point only, so its bounds have the confidence 1 − (1 − c) / points (Bonferroni).
    """
    mean = float(np.mean(values)) if np.isfinite(values).all() else math.nan
    sample = f"{len(values)} run{'s' * (len(values) != 1)}"
    if requirement.confidence is None:
        return _BoundedPoint(Evidence(mean, mean, mean, sample), mean, mean)
    low, high = student_bounds(values, requirement.confidence)
    wide = student_bounds(values, 1.0 - (1.0 - requirement.confidence) / n_points)
    note = "a bound needs two runs or more; set seeds in the study" if len(values) < 2 else ""
    return _BoundedPoint(Evidence(mean, low, high, sample, note), *wide)


def _describe_point(finished_trade: Trade, point: int) -> str:
    """Describe the settings of a point."""
    fields = [
        f"{place} = {finished_trade.table[place][point * finished_trade.study.seeds]}"
        for place in finished_trade.study.places
        if place != "seed"
    ]
    return ", ".join(fields) or f"point {point}"
