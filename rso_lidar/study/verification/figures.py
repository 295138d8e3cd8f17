"""Figures that are computed from a scenario without noise: link budget, finding, timeline, parameters and truth."""

from __future__ import annotations

import math
from functools import cached_property
from typing import Any

import numpy as np

from rso_lidar.errors import ScenarioError, did_you_mean, suppress_warnings
from rso_lidar.mission_analysis import Budget, ParameterTable, Timeline, budget, find_range, list_parameters, timeline
from rso_lidar.scenario import Scenario
from rso_lidar.study.trades.merits import evaluate
from rso_lidar.study.verification.quantities import STATISTICS
from rso_lidar.study.verification.requirements_file import Requirement

_NEAR = 1e-3  # relative distance of the ranges beside the one at which a budget is evaluated


class ComputedFigures:
    """Figures of one scenario, each computed once.

    `number` is the index of the target.
    """

    def __init__(self, scenario: Scenario, number: int, threads: int | None = None) -> None:
        """Start without figures."""
        self.scenario, self.number, self._threads = scenario, number, threads
        self._budgets: dict[Any, Budget] = {}
        self._found: dict[float, Any] = {}

    @cached_property
    def parameters(self) -> ParameterTable:
        """All parameters of the scenario."""
        return list_parameters(self.scenario)

    @cached_property
    def _timeline(self) -> Timeline:
        return timeline(self.scenario, self.scenario.target[self.number].name)

    def compute(self, requirement: Requirement, numbers: np.ndarray | None = None) -> float:
        """Return the value that counts for a requirement, NaN without one; of several curves, that of the worst.

        Raises
        ------
        ScenarioError
            For a column or a parameter that this scenario does not have.
        """
        kind = requirement.what.kind
        with suppress_warnings():
            if kind == "parameter":
                return self._find_parameter(requirement)
            if kind == "timeline":
                return self._summarize_column(requirement)
            if kind == "finding":
                return self._find_range_m(requirement)
            if kind == "merit":
                frames = np.arange(self.scenario.time.n_frames) if numbers is None else numbers
                return evaluate(self.scenario, [requirement.quantity], self.number, frames, threads=self._threads)[
                    requirement.quantity
                ]
            values = self._read_budget(requirement)
        return min(values, key=lambda value: requirement.margin(value, value))

    def unit(self, requirement: Requirement) -> str:
        """Return the unit of the quantity of a requirement."""
        what = requirement.what
        return self.parameters.find(what.name).unit if what.kind == "parameter" else what.unit

    def _find_parameter(self, requirement: Requirement) -> float:
        parameter = self.parameters.find(requirement.quantity)
        if not parameter.is_number:
            said = "is not set" if parameter.value is None else f"is {str(parameter.value)!r:.60}"
            raise ScenarioError(f"'{requirement.quantity}': {said}, not a number; bound another parameter")
        return float(parameter.value)

    def _summarize_column(self, requirement: Requirement) -> float:
        table, column = self._timeline.table, requirement.what.column
        known = [name for name, values in table.items() if values.dtype.kind in "fib"]
        if column not in known:
            raise ScenarioError(
                f"'{requirement.quantity}': the timeline has no column '{column}'{did_you_mean(column, known)} "
                f"(known: {', '.join(known)})"
            )
        values = table[column].astype(float)
        if requirement.between_m is not None:
            low, high = requirement.between_m
            range_m = table["range_m"]
            values = values[(range_m >= low) & (range_m <= high)]
            if not values.size:
                raise ScenarioError(
                    f"between_m: the target is never at {low:g} to {high:g} m, but at {range_m.min():.1f} to "
                    f"{range_m.max():.1f} m"
                )
        assert requirement.statistic is not None
        known_values = values[np.isfinite(values)]
        return STATISTICS[requirement.statistic](known_values) if known_values.size else math.nan

    def _find_range_m(self, requirement: Requirement) -> float:
        wanted = requirement.probability
        assert wanted is not None
        if wanted not in self._found:
            name = self.scenario.target[self.number].name
            self._found[wanted] = find_range(self.scenario, name, finding=self.scenario.finding, probability=wanted)
        range_m = float(getattr(self._found[wanted], requirement.what.column))
        return 0.0 if math.isnan(range_m) else range_m  # at no range with that probability

    def _read_budget(self, requirement: Requirement) -> list[float]:
        """Return the values of all curves of a link budget."""
        at_m, wanted = requirement.range_m, requirement.probability
        key = at_m, wanted, requirement.material, requirement.tilt_deg
        if key not in self._budgets:
            ranges = None if at_m is None else [at_m * (1.0 - _NEAR), at_m, at_m * (1.0 + _NEAR)]
            self._budgets[key] = budget(
                self.scenario,
                range_m=ranges,
                materials=None if requirement.material is None else [requirement.material],
                tilt_deg=requirement.tilt_deg,
                probability=0.95 if wanted is None else wanted,
            )
        values = []
        for curve in self._budgets[key].curves:
            column = getattr(curve, requirement.what.column)
            value = float(column if at_m is None else column[1])
            values.append(0.0 if at_m is None and math.isnan(value) else value)  # at no range with that probability
        return values
