"""A solved plan: values of the variables, what the flight reaches with them, and its scenario."""

from __future__ import annotations

import json
from concurrent.futures import Executor
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from rso_lidar.errors import ScenarioError
from rso_lidar.files import align_columns, check_writable, write_atomically, write_columns
from rso_lidar.picture import FIGURE_SUFFIXES, LIGHT, Scheme, save_figure
from rso_lidar.processes import check_workers, open_executor, send_function
from rso_lidar.scenario import Scenario
from rso_lidar.study.targeting.flight_quantities import QUANTITIES, TargetedFlight
from rso_lidar.study.targeting.problem import Flights, TargetingProblem, make_problem
from rso_lidar.study.targeting.solver import list_active, search
from rso_lidar.study.targeting.targeter_file import Targeter
from rso_lidar.study.targeting.targeting_figure import DrawnFlight, targeting_figure

_DRAWN = 721  # samples of a path in the figure
_ROUNDING = 1e-6  # of the units of goals: metres, degrees, seconds
_NAMES = {"corrector": "differential corrector", "gradient": "differential corrector and SLSQP"}


@dataclass(frozen=True, eq=False)
class SolvedPlan:
    """Values of the variables of a targeter at which the flight meets all goals and limits.

    Parameters
    ----------
    problem : what was solved
    values : of the variables, in the units of their fields
    start_flown, flown : values of goals, limits and the minimised quantity, before and after
    iterations, flights : of the search
    """

    SUFFIXES: ClassVar[tuple[str, ...]] = (".toml", ".csv", ".json", *FIGURE_SUFFIXES)

    problem: TargetingProblem
    values: tuple[float, ...]
    start_flown: np.ndarray
    flown: np.ndarray
    iterations: int
    flights: int

    @property
    def scenario(self) -> Scenario:
        """The scenario with the values set."""
        return self.problem.load(self.values)

    @property
    def settings(self) -> tuple[str, ...]:
        """The values as `--set` takes them."""
        return self.problem.list_settings(self.values)

    @property
    def active(self) -> tuple[str, ...]:
        """Limits that the flight touches, and variables at a bound."""
        limits = [f"{row.place} {row.quantity} {row.wanted}" for row in list_active(self.problem, self.flown)]
        low, width = self.problem.spans
        places = (np.array(self.values) - low) / width
        for variable, place in zip(self.problem.targeter.variable, places.tolist(), strict=True):
            if min(place, 1.0 - place) < 1e-6:
                limits.append(f"{variable.field} at its {'lower' if place < 0.5 else 'upper'} bound")
        return tuple(limits)

    def columns(self) -> dict[str, np.ndarray]:
        """Return the table of variables, goals, limits and the minimised quantity by columns."""
        rows: list[tuple[Any, ...]] = []
        targeter = self.problem.targeter
        for k, variable in enumerate(targeter.variable):
            rows.append(
                (
                    f"variable[{k}]",
                    variable.field,
                    variable.low,
                    variable.high,
                    self.problem.start[k],
                    self.values[k],
                    "",
                    "",
                )
            )
        for row, before, after in zip(self.problem.rows, self.start_flown.tolist(), self.flown.tolist(), strict=False):
            rows.append(
                (
                    row.place,
                    row.quantity,
                    row.low,
                    row.high,
                    before,
                    after,
                    row.unit,
                    after - row.low if row.is_goal else "",
                )
            )
        if targeter.minimize is not None:
            unit = QUANTITIES[targeter.minimize].unit
            rows.append(
                (
                    "minimize",
                    targeter.minimize,
                    -np.inf,
                    np.inf,
                    float(self.start_flown[-1]),
                    float(self.flown[-1]),
                    unit,
                    "",
                )
            )
        heads = ("key", "name", "low", "high", "before", "after", "unit", "residual")
        return {
            head: np.array(column, dtype=object) for head, column in zip(heads, zip(*rows, strict=True), strict=True)
        }

    def describe(self) -> str:
        """Describe the solution in lines of text, at most 80 characters wide where names allow it."""
        targeter = self.problem.targeter
        lines = [
            f"{targeter.name}",
            f"  {_NAMES[targeter.chosen_method]}: {self.iterations} iterations, {self.flights} flights",
        ]
        variables = [["variable", "before", "after"]] + [
            [variable.field.removeprefix("follower.motion."), f"{before:.7g}", f"{after:.7g}"]
            for variable, before, after in zip(targeter.variable, self.problem.start, self.values, strict=True)
        ]
        reached = [["goal or limit", "wanted", "before", "after", "unit"]]
        for row, before, after in zip(self.problem.rows, self.start_flown.tolist(), self.flown.tolist(), strict=False):
            reached.append([row.quantity, row.wanted, _format_value(before), _format_value(after), row.unit])
        if targeter.minimize is not None:
            before, after = float(self.start_flown[-1]), float(self.flown[-1])
            unit = QUANTITIES[targeter.minimize].unit
            reached.append([targeter.minimize, "least", _format_value(before), _format_value(after), unit])
        lines += [f"  {line}" for line in align_columns(variables, [0])]
        lines += [f"  {line}" for line in align_columns(reached, [0, 1, 4])]
        lines += [f"  active: {limit}" for limit in self.active]
        return "\n".join(lines)

    def figure(self) -> Any:
        """Return a matplotlib Figure: the path before and after, range, phase angle, and impulses over time."""
        before, after = self._draw(self.problem.start), self._draw(self.values)
        return targeting_figure(before, after, self.problem.targeter.name)

    def save(self, path: str | Path, scheme: Scheme = LIGHT) -> Path:
        """Write the solved scenario, the table or the picture; an existing file is replaced.

        Parameters
        ----------
        path : of the output: .toml (the scenario), .csv or .json (the table), .png, .pdf or .svg
        scheme : of a picture, `LIGHT` or `DARK`

        Returns
        -------
        Path

        Raises
        ------
        RecordingError
            For another suffix, or a path that cannot be written.
        """
        place = check_writable(path, self.SUFFIXES, overwrite=True)
        suffix = place.suffix.lower()
        if suffix == ".csv":
            return write_columns(place, self.columns())
        if suffix in FIGURE_SUFFIXES:
            return save_figure(self.figure(), place, scheme=scheme)
        text = self.scenario.dumps() if suffix == ".toml" else self._dump_json()
        with write_atomically(place) as draft:
            draft.write_text(text, encoding="utf-8")
        return place

    def _dump_json(self) -> str:
        table = self.columns()
        rows = [
            {
                key: None if isinstance(value, float) and not np.isfinite(value) else value
                for key, value in zip(table, row, strict=True)
                if value != ""
            }
            for row in zip(*(column.tolist() for column in table.values()), strict=True)
        ]
        targeter = self.problem.targeter
        tree = {
            "name": targeter.name,
            "method": targeter.chosen_method,
            "iterations": self.iterations,
            "flights": self.flights,
            "settings": self.settings,
            "active": self.active,
            "rows": rows,
        }
        return json.dumps(tree, indent=2) + "\n"

    def _draw(self, values: tuple[float, ...]) -> DrawnFlight:
        scenario = self.problem.load(values)
        flight = TargetedFlight(scenario, self.problem.targeter.find_target_name(scenario))
        times = np.unique(
            [*np.linspace(0.0, scenario.time.duration_s, _DRAWN), *(push.time_s for push in flight.pushes)]
        )
        states = flight.find_states(times)
        phase = QUANTITIES["phase_angle_deg"].of_states
        assert phase is not None
        pushes = np.array([[push.time_s, push.size_m_s] for push in flight.pushes]).reshape(-1, 2)
        return DrawnFlight(times, states.position_m, phase(states), pushes)


def _format_value(value: float) -> str:
    """Format a value of a flight to six digits.

    Below a millionth of its unit it is rounding, which is no distance that a craft could have.

    >>> [_format_value(value) for value in (1.83e-12, -1e-9, 0.0, 12.3456789, 2.5e6)]
    ['< 1e-6', '> -1e-6', '0', '12.3457', '2,500,000']
    """
    if 0.0 < abs(value) < _ROUNDING:
        return "< 1e-6" if value > 0.0 else "> -1e-6"
    return f"{value:,.0f}" if 1e6 <= abs(value) < 1e15 else f"{value + 0.0:.6g}"


def solve_targeter(
    targeter: Targeter | str | Path,
    *,
    workers: int | None = None,
    executor: Executor | None = None,
    trust_code: bool = False,
) -> SolvedPlan:
    """Solve a targeter: find values of a scenario's fields at which its flight meets goals and limits.

    Each point is one flight of the scenario by its own motion and forces. A differential corrector (Gauss-Newton steps
    within the bounds) meets goals and limits. For a minimised quantity, sequential quadratic programming (SLSQP; Kraft
    1988) goes on from there. Derivatives are differences of flights over 1e-4 of the width between bounds. A minimum is
    a local one.

    Parameters
    ----------
    targeter : the targeter, or the path of its file
    workers : number of processes that fly the flights of a difference at once; the result does not depend on it
    executor : in the manner of `concurrent.futures`, in place of `workers`; as for `simulate`
    trust_code : whether Python code that the scenario names may run

    Returns
    -------
    SolvedPlan
        Values, what the flight reaches before and after, and the scenario.

    Raises
    ------
    ScenarioError
        If a field, quantity or instant does not exist, the start cannot be flown, or a goal or limit cannot be reached;
        the message names it.
    """
    if isinstance(targeter, str | Path):
        targeter = Targeter.load(targeter)
    if not isinstance(targeter, Targeter):
        raise ScenarioError(f"targeter: needs a Targeter or the path of its file, not {type(targeter).__name__}")
    check_workers(workers, executor)
    problem = make_problem(targeter, trust_code=trust_code)
    with ExitStack() as stack:
        opened = stack.enter_context(open_executor(workers, executor=executor))
        sent = None if opened is None else stack.enter_context(send_function(problem.try_fly, opened))
        ending = search(Flights(problem, sent))
    values = problem.find_values(ending.point)
    return SolvedPlan(problem, values, ending.start_values, ending.values, ending.iterations, ending.flights)
