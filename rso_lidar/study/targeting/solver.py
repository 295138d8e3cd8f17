"""Solution of targeting problems: differential corrector and sequential quadratic programming."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rso_lidar.errors import ScenarioError
from rso_lidar.study.targeting.problem import Flights, Row, TargetingProblem

_STEP = 1e-4  # of the width between bounds: above the noise of the integrator (1e-13), and small beside curvature
_STOP = 0.1  # of the tolerances, at which the corrector stops
_PENALTY = 1e3  # of a point that cannot be flown, in scaled units of which the whole width moves a row by about one
_RADIUS = 0.2  # of the width between bounds: half the first box of a run of SLSQP
_LEAST_RADIUS = 1e-3
_RUN = 25  # iterations of SLSQP in one box
_COST_CHANGE = 1e-7  # of the scaled cost: a smaller gain ends a run
_CORRECTION = 0.3  # of the width between bounds: the longest first step of the corrector
_LEAST_CORRECTION = 1e-9
_SHORTEST = 1e-7  # weight of a step's length beside the goals
_LEAST_SLOPE = 1e-12


@dataclass(frozen=True, eq=False)
class Search:
    """Where a search ended: the scaled point (variable,), its flown values, iterations and flights."""

    point: np.ndarray
    values: np.ndarray
    start_values: np.ndarray
    iterations: int
    flights: int


class _ScaledProblem:
    """Rows of a problem in scaled units, of which a step across the bounds of all variables moves each by about one."""

    def __init__(self, flights: Flights) -> None:
        self.flights, self.problem = flights, flights.problem
        low, width = self.problem.spans
        self.start = (np.array(self.problem.start) - low) / width
        values = flights.fly(self.start)
        if values is None:
            raise ScenarioError(f"{self.problem.targeter.where}: cannot be flown at the start: {flights.last_failure}")
        self.start_values = values
        slopes = self.differentiate(self.start)
        self.units = np.linalg.norm(slopes, axis=1)
        for row, unit, value in zip(self.problem.rows, self.units, values, strict=False):
            if unit < _LEAST_SLOPE and row.is_goal and not row.is_met(float(value)):
                raise ScenarioError(
                    f"{self.problem.targeter.where}: {row.place}: no variable changes '{row.quantity}', which is "
                    f"{value:.6g} {row.unit}; add a variable that does, or leave the goal out"
                )
        self.units[self.units < _LEAST_SLOPE] = 1.0

    @property
    def goals(self) -> list[int]:
        """Numbers of the rows that are equalities."""
        return [k for k, row in enumerate(self.problem.rows) if row.is_goal]

    @property
    def limits(self) -> list[int]:
        """Numbers of the rows that are inequalities."""
        return [k for k, row in enumerate(self.problem.rows) if not row.is_goal]

    def differentiate(self, point: np.ndarray, *, one_sided: bool = False) -> np.ndarray:
        """Return the derivatives (value, variable) at a scaled point by differences of flights within the bounds.

        Central differences fly two points for each variable, one-sided ones fly one.
        """
        low, high = np.tile(point, (2, len(point), 1))
        np.fill_diagonal(high, np.where(point + _STEP <= 1.0, point + _STEP, point - _STEP))
        if not one_sided:
            np.fill_diagonal(low, np.clip(point - _STEP, 0.0, 1.0))
            np.fill_diagonal(high, np.clip(point + _STEP, 0.0, 1.0))
        outcomes = self.flights.fly_all(np.concatenate([low, high, point[None]]))
        middle = outcomes.pop()
        columns = []
        for k, (before, after) in enumerate(zip(outcomes[: len(point)], outcomes[len(point) :], strict=True)):
            first, last = low[k, k], high[k, k]
            if before is None:  # the edge of what can be flown
                before, first = middle, point[k]
            if after is None:
                after, last = middle, point[k]
            if before is None or after is None or first == last:
                columns.append(np.zeros_like(self.start_values))
            else:
                columns.append((after - before) / (last - first))
        return np.stack(columns, axis=1)

    def residuals(self, point: np.ndarray) -> np.ndarray:
        """Return the scaled errors (goal,) of the goals; large where the point cannot be flown."""
        values = self.flights.fly(point)
        if values is None:
            return np.full(len(self.goals), _PENALTY)
        errors = [(values[k] - self.problem.rows[k].low) / self.units[k] for k in self.goals]
        return np.array(errors)

    def residual_slopes(self, point: np.ndarray) -> np.ndarray:
        """Return the derivatives (goal, variable) of `residuals`."""
        slopes: np.ndarray = (self.differentiate(point) / self.units[:, None])[self.goals]
        return slopes

    def margins(self, point: np.ndarray) -> np.ndarray:
        """Return the scaled margins (limit,), negative beyond a limit."""
        values = self.flights.fly(point)
        if values is None:
            return np.full(len(self.limits), -_PENALTY)
        margins = [-self.problem.rows[k].error(float(values[k])) / self.units[k] for k in self.limits]
        return np.array(margins)

    def margin_slopes(self, point: np.ndarray) -> np.ndarray:
        """Return the derivatives (limit, variable) of `margins`."""
        signs = np.array([1.0 if np.isfinite(self.problem.rows[k].low) else -1.0 for k in self.limits])
        slopes: np.ndarray = signs[:, None] * (self.differentiate(point) / self.units[:, None])[self.limits]
        return slopes

    def cost(self, point: np.ndarray) -> float:
        """Return the scaled minimised quantity, or half the squared distance from the start without one."""
        if self.problem.targeter.minimize is None:
            return 0.5 * float(np.sum((point - self.start) ** 2))
        values = self.flights.fly(point)
        return _PENALTY if values is None else float(values[-1] / self.units[-1])

    def cost_slopes(self, point: np.ndarray) -> np.ndarray:
        """Return the derivatives (variable,) of `cost`."""
        if self.problem.targeter.minimize is None:
            return np.asarray(point - self.start)
        slopes: np.ndarray = self.differentiate(point)[-1] / self.units[-1]
        return slopes

    def merit(self, point: np.ndarray) -> tuple[float, float]:
        """Return by how much goals and limits are missed beyond their tolerances, and the cost: less is better, in order."""
        values = self.flights.fly(point)
        if values is None:
            return np.inf, np.inf
        rows = zip(self.problem.rows, values.tolist(), self.units.tolist(), strict=False)
        missed = sum((row.error(value) - row.tolerance) / unit for row, value, unit in rows if not row.is_met(value))
        return float(missed), self.cost(point)


def search(flights: Flights) -> Search:
    """Search for the point that meets all goals and limits; raise `ScenarioError` where none is reached."""
    problem, scaled = flights.problem, _ScaledProblem(flights)
    point, iterations = _correct(scaled, scaled.start)  # SLSQP is fragile far from its equalities
    if problem.targeter.chosen_method != "corrector":
        point, more = _descend(scaled, point)
        iterations += more
    values = scaled.flights.fly(point)
    assert values is not None
    _check(scaled, point, values, iterations)
    return Search(point, values, scaled.start_values, iterations, scaled.flights.count)


def _correct(scaled: _ScaledProblem, start: np.ndarray) -> tuple[np.ndarray, int]:
    """Return the point at which goals and limits are met or nearest to it, and the number of iterations.

    A limit that is kept has no error. Each step is that of Gauss and Newton, the shortest of those that meet the
    linearised rows, within the bounds and a box, by bounded linear least squares (Stark and Parker 1995). The box
    shrinks where a step makes the errors worse.
    """
    from scipy.optimize import lsq_linear

    n, rows = len(start), scaled.problem.rows
    tolerances = np.array([row.tolerance for row in rows])

    def find_errors(point: np.ndarray) -> np.ndarray | None:
        """Return the errors (row,) beyond the bounds, in tolerances, with their signs."""
        values = scaled.flights.fly(point)
        if values is None:
            return None
        values = values[: len(rows)]
        misses: np.ndarray = (
            values - np.clip(values, [row.low for row in rows], [row.high for row in rows])
        ) / tolerances
        return misses

    point, errors, radius, iterations = start, find_errors(start), _CORRECTION, 0
    slopes: np.ndarray | None = None
    goals = np.array([row.is_goal for row in rows])
    while errors is not None and np.abs(errors).max() > _STOP and radius > _LEAST_CORRECTION:
        if iterations == scaled.problem.targeter.max_iterations:
            break
        iterations += 1
        if slopes is None:
            slopes = scaled.differentiate(point, one_sided=True)[: len(rows)] / tolerances[:, None]
            slopes[(errors == 0.0) & ~goals] = 0.0  # a limit that is kept
        short = _SHORTEST * np.linalg.norm(slopes) * np.eye(n)  # of steps that do the same, the shortest
        # Strictly ordered bounds: a variable at its bound keeps a sliver of room.
        low, high = np.maximum(-radius, -point) - 1e-15, np.minimum(radius, 1.0 - point) + 1e-15
        step = lsq_linear(np.vstack([slopes, short]), np.concatenate([-errors, np.zeros(n)]), (low, high), "bvls").x
        reached = np.clip(point + step, 0.0, 1.0)
        reached_errors = find_errors(reached)
        if reached_errors is None or not np.linalg.norm(reached_errors) < np.linalg.norm(errors):
            radius = 0.25 * min(radius, float(np.abs(step).max()))
            continue
        point, errors, radius, slopes = reached, reached_errors, min(2.0 * radius, 1.0), None
    return point, iterations


def _descend(scaled: _ScaledProblem, start: np.ndarray) -> tuple[np.ndarray, int]:
    """Return the point of least cost near a start that keeps goals and limits, and the number of iterations.

    Each run of SLSQP is kept within a box about the best point, and the goals are met again after it: far from its start
    the linearised goals mislead. The box shrinks where a run gains nothing.
    """
    from scipy.optimize import minimize

    constraints = []
    if scaled.goals:
        constraints.append({"type": "eq", "fun": scaled.residuals, "jac": scaled.residual_slopes})
    if scaled.limits:
        constraints.append({"type": "ineq", "fun": scaled.margins, "jac": scaled.margin_slopes})
    point, merit, radius, iterations = start, scaled.merit(start), _RADIUS, 0
    while radius >= _LEAST_RADIUS and iterations < scaled.problem.targeter.max_iterations:
        low, high = np.clip([point - radius, point + radius], 0.0, 1.0)
        solution = minimize(
            scaled.cost,
            point,
            jac=scaled.cost_slopes,
            method="SLSQP",
            bounds=np.stack([low, high], axis=1),
            constraints=constraints,
            options={"maxiter": _RUN, "ftol": _COST_CHANGE},
        )
        iterations += int(solution.nit)
        reached = _choose_flown(scaled, solution.x) if np.isfinite(solution.x).all() else point
        reached, more = _correct(scaled, reached)
        iterations += more
        reached_merit = scaled.merit(reached)
        gained, moved = 0.0, float(np.abs(reached - point).max())
        if reached_merit < merit:
            gained = max(merit[0] - reached_merit[0], merit[1] - reached_merit[1])
            point, merit = reached, reached_merit
        if gained < 10.0 * _COST_CHANGE:
            if merit[0] == 0.0 and moved < 0.9 * radius:
                break
            radius /= 4.0
    return point, iterations


def _choose_flown(scaled: _ScaledProblem, point: np.ndarray) -> np.ndarray:
    """Return a point within the bounds that can be flown: the start where the given one cannot."""
    inside = np.clip(point, 0.0, 1.0)
    usable = bool(np.isfinite(inside).all()) and scaled.flights.fly(inside) is not None
    return np.asarray(inside if usable else scaled.start)


def _check(scaled: _ScaledProblem, point: np.ndarray, values: np.ndarray, iterations: int) -> None:
    """Raise `ScenarioError` that names the row that is farthest from met."""
    problem = scaled.problem
    pairs = list(zip(problem.rows, values.tolist(), strict=False))
    missed = [(row, value) for row, value in pairs if not row.is_met(value)]
    if not missed:
        return
    row, value = max(missed, key=lambda pair: pair[0].error(pair[1]) / pair[0].tolerance)
    stops = [
        f"'{variable.field}' is at its {'lower' if at < 0.5 else 'upper'} bound"
        for variable, at in zip(problem.targeter.variable, point.tolist(), strict=True)
        if min(at, 1.0 - at) < 1e-6
    ]
    cure = f"widen it ({'; '.join(stops[:2])})" if stops else _advise(problem, iterations)
    failed = f"; the last flight that failed: {scaled.flights.last_failure}" if scaled.flights.last_failure else ""
    raise ScenarioError(
        f"{problem.targeter.where}: {row.place}: '{row.quantity}' cannot be reached: {value:.6g} {row.unit} in place of "
        f"{row.wanted} after {iterations} iterations, with {len(missed)} of {len(problem.rows)} goals and limits missed; "
        f"{cure}{failed}"
    )


def _advise(problem: TargetingProblem, iterations: int) -> str:
    """Return a cure for a search that ended within all bounds."""
    if iterations >= problem.targeter.max_iterations:
        return "raise max_iterations, or start nearer"
    n_goals = sum(row.is_goal for row in problem.rows)
    if n_goals > len(problem.targeter.variable):
        return f"{n_goals} goals for {len(problem.targeter.variable)} variables: add variables, or relax a limit"
    return "start nearer (initial), or relax it"


def list_active(problem: TargetingProblem, values: np.ndarray) -> list[Row]:
    """List the limits that the values (row,) of a flight touch, within their tolerance."""
    pairs = zip(problem.rows, values.tolist(), strict=False)
    return [row for row, value in pairs if not row.is_goal and abs(row.error(value)) <= row.tolerance]
