"""The plan of a trade study: its points, and settings and evaluation of each row, checked before the first run."""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from rso_lidar.errors import FieldError, RsoLidarError, RunError, ScenarioError, SettingError, suppress_warnings
from rso_lidar.scenario import Scenario, read_toml
from rso_lidar.study.trades.definition import Grid, Random, Study
from rso_lidar.study.trades.merits import evaluate

_TRIED = 300  # greatest number of points that are checked before the first run
_OF_AN_AXIS = 50  # greatest number of values of one axis that are checked alone
Row = dict[str, Any]


@dataclass(frozen=True, eq=False)
class TradePlan:
    """All inputs of the rows, which worker processes receive; `trust_code` and `trust_fmu` are permissions to run code."""

    study: Study
    points: tuple[tuple[Any, ...], ...]
    text: str
    folder: Path
    where: str
    seed: int
    threads: int | None = None
    trust_code: bool = False
    trust_fmu: bool = False

    def scenario(self, row: int) -> Scenario:
        """Load the scenario of a row, or raise `ScenarioError`."""
        changes = tuple(f"{field}={text}" for field, text in self.settings(row).items())
        scenario = Scenario.loads(
            self.text,
            folder=self.folder,
            where=self.where,
            settings=(*self.study.set, *changes),
            trust_code=self.trust_code,
        )
        return scenario.with_trusted_fmus() if self.trust_fmu else scenario

    def settings(self, row: int) -> dict[str, str]:
        """Return the TOML text of each field that a row sets."""
        chosen = list_settings(self.study, self.points[row // self.study.seeds])
        return chosen | ({"seed": str(self.seed + row % self.study.seeds)} if self.study.seeds > 1 else {})

    def row(self, number: int) -> Row:
        """Run one row: its figures of merit, or the reason for their absence."""
        study, merits = self.study, dict.fromkeys(self.study.judged_by, float("nan"))
        seed, why = self.seed, ""
        with suppress_warnings():
            try:
                scenario = self.scenario(number)
                seed = scenario.seed
                which, frames = study.number(scenario), study.numbers(scenario)
                merits = evaluate(scenario, study.judged_by, which, frames, folder=self.folder, threads=self.threads)
            except RunError:
                raise
            except RsoLidarError as error:
                why = " ".join(str(error).split())
        return {"row": number, "seed": seed, "merits": merits, "error": why}


def make_trade_plan(
    study: Study, threads: int | None = None, *, trust_code: bool = False, trust_fmu: bool = False
) -> tuple[TradePlan, Scenario]:
    """Make the plan of a study and load its scenario, after a check of every field that changes."""
    base, path = study.base(trust_code=trust_code, trust_fmu=trust_fmu), study.scenario_file()
    text, points = read_toml(path), tuple(list_points(study))
    plan = TradePlan(study, points, text, path.parent, path.name, base.seed, threads, trust_code, trust_fmu)
    with suppress_warnings():
        _check_fields(plan)
        _check_points(plan)
    return plan, base


def _check_fields(plan: TradePlan) -> None:
    """Raise `ScenarioError` for an axis that names no field of the scenario, or has values of another type."""
    for k, axis in enumerate(plan.study.axis):
        tried = {repr(point[k]): point[k] for point in plan.points}
        for value in list(tried.values())[:_OF_AN_AXIS]:
            for field, text in axis.settings(value).items():
                _check_field(plan, f"{plan.study.where}: axis[{k}]", field, text)


def _check_field(plan: TradePlan, place: str, field: str, text: str) -> None:
    """Check a value of one axis in the scenario."""
    changed = (*plan.study.set, f"{field}={text}")
    try:
        Scenario.loads(plan.text, folder=plan.folder, where=plan.where, settings=changed)
    except ScenarioError as error:
        key, misfit = _find_misfit(error, field)
        if misfit:
            said = str(error).removeprefix(f"--set {field}={text}: ")
            named = "" if field in said else f"{field}: "
            raise ScenarioError(f"{place}.{key}: {named}{said}") from None


def _find_misfit(error: ScenarioError, field: str) -> tuple[str, bool]:
    """Return the key of an axis that is wrong at every point, and whether there is one: no such field, or another type."""
    if isinstance(error, SettingError):
        return "field", True
    steps = field.replace("[", ".").replace("]", "").split(".")
    for place, kind in error.problems if isinstance(error, FieldError) else ():
        last = str(place[-1]) if place else ""
        if kind == "extra_forbidden" and last in steps:
            return "field", True
        if last == steps[-1] and (kind.endswith("_type") or kind == "int_from_float"):
            return "values", True
    return "field", False


def _check_points(plan: TradePlan) -> None:
    """Raise `ScenarioError` where no point is a valid scenario."""
    n = len(plan.points)
    first = None
    for point in dict.fromkeys(np.linspace(0, n - 1, min(n, _TRIED)).round().astype(int).tolist()):
        try:
            plan.scenario(point * plan.study.seeds)
        except ScenarioError as error:
            first = first or error
        else:
            return
    raise ScenarioError(f"{plan.study.where}: no point can be flown; the first: {first}")


def list_points(study: Study) -> list[tuple[Any, ...]]:
    """List the points of a study, each with one value per axis; random points depend on the study's seed alone."""
    if isinstance(study.sampling, Grid):
        return list(itertools.product(*(axis.grid() for axis in study.axis)))
    share = draw_shares(study)
    return list(zip(*(axis.at(column) for axis, column in zip(study.axis, share.T, strict=True)), strict=True))


def draw_shares(study: Study) -> np.ndarray:
    """Draw the relative positions (point, axis) of random points along each axis, from 0 to below 1."""
    assert not isinstance(study.sampling, Grid)
    rng = np.random.Generator(np.random.Philox(np.random.SeedSequence(study.seed)))
    n, dimensions = study.sampling.points, len(study.axis)
    if isinstance(study.sampling, Random):
        return rng.random((n, dimensions))
    from scipy.stats import qmc

    drawn: np.ndarray = qmc.LatinHypercube(dimensions, rng=rng).random(n)
    return drawn


def list_settings(study: Study, point: tuple[Any, ...]) -> dict[str, str]:
    """List the TOML text of each field at a point."""
    return {
        field: text
        for axis, value in zip(study.axis, point, strict=True)
        for field, text in axis.settings(value).items()
    }
