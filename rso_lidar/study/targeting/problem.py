"""A targeting problem: values of the variables in, flown values of goals, limits and the minimised quantity out."""

from __future__ import annotations

from collections.abc import Sequence
from copy import deepcopy
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from rso_lidar.errors import RsoLidarError, RunError, ScenarioError, SettingError, add_place, suppress_warnings
from rso_lidar.part import parse_toml
from rso_lidar.processes import SentFunction
from rso_lidar.scenario import Scenario, apply_setting, get_field, read_toml
from rso_lidar.study.targeting.flight_quantities import QUANTITIES, TargetedFlight
from rso_lidar.study.targeting.targeter_file import Goal, Instant, Limit, Targeter

_COMPONENTS = ("radial", "along-track", "cross-track")


@dataclass(frozen=True)
class Row:
    """One number that the flight has to meet.

    Parameters
    ----------
    place : key in the file, such as ``goal[0]``
    quantity, unit : its name, with the component of a vector, and its unit
    low, high : bounds; equal for a goal, infinite where there is none
    tolerance : greatest error that counts as met
    """

    place: str
    quantity: str
    unit: str
    low: float
    high: float
    tolerance: float

    @property
    def is_goal(self) -> bool:
        """Whether the number is an equality."""
        return self.low == self.high

    def error(self, value: float) -> float:
        """Return the distance of a value beyond the bounds; negative inside a limit."""
        return abs(value - self.low) if self.is_goal else max(self.low - value, value - self.high)

    def is_met(self, value: float) -> bool:
        """Return whether a value is within the tolerance."""
        return self.error(value) <= self.tolerance

    @property
    def wanted(self) -> str:
        """The bounds in words."""
        if self.is_goal:
            return f"= {self.low:g}"
        ends = [f">= {self.low:g}"] if np.isfinite(self.low) else []
        return " and ".join([*ends, *([f"<= {self.high:g}"] if np.isfinite(self.high) else [])])


@dataclass(frozen=True, eq=False)
class TargetingProblem:
    """The scenario's text with the variables of a targeter, each scaled to 0 at its lower and 1 at its upper bound.

    Values of a flight are a vector: those of `rows`, then the minimised quantity, if there is one.
    """

    targeter: Targeter
    text: str
    rows: tuple[Row, ...]
    start: tuple[float, ...]
    trust_code: bool = False

    @property
    def spans(self) -> tuple[np.ndarray, np.ndarray]:
        """Lower bound and width of each variable, in the units of their fields."""
        low = np.array([variable.low for variable in self.targeter.variable])
        return low, np.array([variable.high for variable in self.targeter.variable]) - low

    @cached_property
    def _tree(self) -> dict[str, object]:
        """The scenario's text as a tree."""
        return parse_toml(self.text, self.targeter.where, ScenarioError)

    def find_values(self, point: np.ndarray) -> tuple[float, ...]:
        """Return the values of the fields at a scaled point (variable,)."""
        low, width = self.spans
        return tuple((low + width * np.clip(point, 0.0, 1.0)).tolist())

    def list_settings(self, values: Sequence[float]) -> tuple[str, ...]:
        """List the settings of values (variable,) in the units of their fields, as `--set` takes them."""
        return tuple(
            f"{variable.field}={value!r}" for variable, value in zip(self.targeter.variable, values, strict=True)
        )

    def load(self, values: Sequence[float]) -> Scenario:
        """Load the scenario at values (variable,) in the units of their fields."""
        path = self.targeter.scenario_file()
        settings = (*self.targeter.set, *self.list_settings(values))
        return Scenario.loads(
            self.text, folder=path.parent, where=path.name, settings=settings, trust_code=self.trust_code
        )

    def fly(self, values: Sequence[float]) -> np.ndarray:
        """Fly the scenario at values (variable,), and return those of the rows and of the minimised quantity."""
        with suppress_warnings():
            scenario = self.load(values)
            flight = TargetedFlight(scenario, self.targeter.find_target_name(scenario))
            tree = deepcopy(self._tree)
            for setting in (*self.targeter.set, *self.list_settings(values)):
                apply_setting(tree, setting)
            flown = self._find_rows(flight, tree, scenario.time.duration_s)
            if self.targeter.minimize is not None:
                flown.append(float(getattr(flight, self.targeter.minimize)))
        values_of_flight = np.array(flown)
        if not np.isfinite(values_of_flight).all():
            raise ScenarioError("the flight has no finite value here; narrow the bounds")
        return values_of_flight

    def try_fly(self, values: tuple[float, ...]) -> np.ndarray | str:
        """Fly the scenario, and return the reason in place of values where it cannot be flown."""
        try:
            return self.fly(values)
        except RunError:
            raise
        except RsoLidarError as error:
            return " ".join(str(error).split())

    def _find_rows(self, flight: TargetedFlight, tree: dict[str, object], end_s: float) -> list[float]:
        """Return the values of the rows; the instants of all rows are flown at once."""
        conditions: list[tuple[str, Goal | Limit]] = [(f"goal[{k}]", goal) for k, goal in enumerate(self.targeter.goal)]
        conditions += [(f"limit[{k}]", limit) for k, limit in enumerate(self.targeter.limit)]
        instants_s = []
        for place, condition in conditions:
            with add_place(f"{self.targeter.where}: {place}"):
                instants_s.append(self._list_instants_s(condition, tree, end_s))
        times_s, places = np.unique(np.concatenate(instants_s), return_inverse=True)
        states = flight.find_states(times_s)
        ends = np.cumsum([len(times) for times in instants_s])
        flown: list[float] = []
        for (_, condition), times, end in zip(conditions, instants_s, ends, strict=True):
            find_values = QUANTITIES[condition.quantity].of_states
            if find_values is None:
                values = np.array([float(getattr(flight, condition.quantity))])
            else:
                values = find_values(states)[places[end - len(times) : end]]
            flown += np.ravel(values).tolist() if isinstance(condition, Goal) else _list_worst(condition, values)
        return flown

    def _list_instants_s(self, condition: Goal | Limit, tree: dict[str, object], end_s: float) -> np.ndarray:
        """Return the instants (time,) [s] at which a condition is evaluated; none for a quantity of the run."""
        if QUANTITIES[condition.quantity].of_states is None:
            return np.empty(0)
        if condition.at_s is not None:
            return np.array([_find_instant_s(condition.at_s, tree, "at_s", end_s)])
        if isinstance(condition, Goal):
            return np.array([end_s])
        first_s, last_s = (
            _find_instant_s(at_s, tree, "between_s", end_s) for at_s in condition.between_s or (0.0, end_s)
        )
        return np.linspace(first_s, max(first_s, last_s), self.targeter.samples)


class Flights:
    """Flights of a problem that are remembered, so that no point is flown twice; workers fly those of a batch at once."""

    def __init__(self, problem: TargetingProblem, sent: SentFunction | None = None) -> None:
        """Begin without flights; `sent` is `TargetingProblem.try_fly` in workers (None: this process flies)."""
        self.problem, self._sent = problem, sent
        self._known: dict[tuple[float, ...], np.ndarray | str] = {}
        self.last_failure = ""

    @property
    def count(self) -> int:
        """Number of flights."""
        return len(self._known)

    def fly_all(self, points: np.ndarray) -> list[np.ndarray | None]:
        """Fly scaled points (point, variable); None in place of the values where one cannot be flown."""
        keys = [self.problem.find_values(point) for point in points]
        new = [key for key in dict.fromkeys(keys) if key not in self._known]
        if self._sent is None or len(new) < 2:
            flown = [self.problem.try_fly(key) for key in new]
        else:
            flown = [self._sent.result(future) for future in [self._sent.submit(key) for key in new]]
        for key, outcome in zip(new, flown, strict=True):
            self._known[key] = outcome
            if isinstance(outcome, str):
                self.last_failure = outcome
        outcomes = (self._known[key] for key in keys)
        return [None if isinstance(outcome, str) else outcome for outcome in outcomes]

    def fly(self, point: np.ndarray) -> np.ndarray | None:
        """Fly one scaled point (variable,); None where it cannot be flown."""
        return self.fly_all(point[None])[0]


def _list_worst(limit: Limit, values: np.ndarray) -> list[float]:
    """Return the worst of values (time,) for each bound of a limit."""
    least = [float(np.min(values))] if limit.at_least is not None else []
    return [*least, *([float(np.max(values))] if limit.at_most is not None else [])]


def make_problem(targeter: Targeter, *, trust_code: bool = False) -> TargetingProblem:
    """Make the problem of a targeter, after a check of every field that it names."""
    path = targeter.scenario_file()
    text = read_toml(path)
    with add_place(targeter.where):
        base = Scenario.load(path, targeter.set, trust_code=trust_code)
        tree = parse_toml(text, path.name, ScenarioError)
        for setting in targeter.set:
            apply_setting(tree, setting)
        start = tuple(_find_start(tree, targeter, k) for k in range(len(targeter.variable)))
    targeter.find_target_name(base)
    return TargetingProblem(targeter, text, tuple(_list_rows(targeter)), start, trust_code)


def _find_start(tree: dict[str, object], targeter: Targeter, number: int) -> float:
    """Return the value of a variable at the start, in the unit of its field."""
    variable = targeter.variable[number]
    with add_place(f"variable[{number}]"):
        try:
            value = get_field(tree, variable.field, f"field: {variable.field}")
        except SettingError as error:
            raise ScenarioError(f"{error}") from None
        if variable.initial is not None:
            value = variable.initial
        if isinstance(value, bool) or not isinstance(value, int | float):
            what = "the scenario does not state it" if value is None else f"it is {value!r:.40}, not a number"
            raise ScenarioError(
                f"field: '{variable.field}': {what}; name a number that the scenario states, or give initial"
            )
        if not variable.low <= value <= variable.high:
            raise ScenarioError(
                f"field: '{variable.field}' is {value:g} in the scenario, outside {variable.low:g} to {variable.high:g}; "
                "widen the bounds, or give initial"
            )
    return float(value)


def _list_rows(targeter: Targeter) -> list[Row]:
    rows: list[Row] = []
    for k, goal in enumerate(targeter.goal):
        unit, place = QUANTITIES[goal.quantity].unit, f"goal[{k}]"
        if isinstance(goal.equals, tuple):
            rows += [
                Row(place, f"{goal.quantity} {name}", unit, value, value, goal.greatest_error)
                for name, value in zip(_COMPONENTS, goal.equals, strict=True)
            ]
        else:
            rows.append(Row(place, goal.quantity, unit, goal.equals, goal.equals, goal.greatest_error))
    for k, limit in enumerate(targeter.limit):
        unit, place = QUANTITIES[limit.quantity].unit, f"limit[{k}]"
        if limit.at_least is not None:
            rows.append(Row(place, limit.quantity, unit, limit.at_least, np.inf, limit.greatest_error))
        if limit.at_most is not None:
            rows.append(Row(place, limit.quantity, unit, -np.inf, limit.at_most, limit.greatest_error))
    return rows


def _find_instant_s(instant: Instant, tree: dict[str, object], key: str, end_s: float) -> float:
    """Return an instant [s] that is given as a number or as the place of a field; it must be within the run."""
    value = get_field(tree, instant, f"{key}: {instant}") if isinstance(instant, str) else instant
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise ScenarioError(f"{key}: '{instant}' is no number of the scenario; give seconds, or the place of a number")
    if not 0.0 <= value <= end_s:
        raise ScenarioError(
            f"{key}: {value:g} s is outside the run of {end_s:g} s; give an instant within, or extend the run"
        )
    return float(value)
