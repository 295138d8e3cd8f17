"""The targeter file: which fields of a scenario are free, which goals and limits they have to meet, and what is least."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import Annotated, ClassVar, Literal, Self

from pydantic import AfterValidator, Field, model_validator

from rso_lidar.errors import ScenarioError, add_place, did_you_mean
from rso_lidar.files import expand_user
from rso_lidar.part import Count, Name, NotNegative, Number, Part, Positive, Text, Vector
from rso_lidar.scenario import FilePart, Scenario, find_target
from rso_lidar.study.targeting.flight_quantities import QUANTITIES, VECTORS

MOST_VARIABLES = 50  # with as many impulses as plans have; a gradient needs two flights for each
_MOST_ROWS = 200
_TOLERANCES = {"m": 0.01, "m/s": 1e-4, "deg": 0.01, "km": 0.001, "s": 0.1, "": 1e-6}

Instant = NotNegative | Annotated[Text, Field(pattern=r"^[^=\s]+$")]


def _check_quantity(name: str) -> str:
    if name not in QUANTITIES:
        raise ValueError(f"no quantity '{name}'{did_you_mean(name, QUANTITIES)} (known: {', '.join(QUANTITIES)})")
    return name


QuantityName = Annotated[Text, AfterValidator(_check_quantity)]


class TargeterVariable(Part):
    """One free field of the scenario, with its bounds."""

    field: Annotated[Text, Field(pattern=r"^[^=\s]+$")] = Field(
        description="Place of a number in the scenario, as `--set` takes it; `.0` is the first entry of a list."
    )
    low: Number = Field(description="Lower bound, in the unit of the field.")
    high: Number = Field(description="Upper bound, in the unit of the field.")
    initial: Number | None = Field(
        default=None, description="Value at which the search starts. If omitted, that of the scenario."
    )

    @model_validator(mode="after")
    def _in_order(self) -> Self:
        if not self.low < self.high:
            raise ValueError(f"low ({self.low:g}) is not below high ({self.high:g}); exchange the two, or widen them")
        if self.initial is not None and not self.low <= self.initial <= self.high:
            raise ValueError(f"initial: {self.initial:g} is outside {self.low:g} to {self.high:g}; start within")
        return self


class _TargeterCondition(Part):
    """Base of goals and limits."""

    quantity: QuantityName = Field(description="Quantity of the flight.")
    at_s: Instant | None = Field(
        default=None,
        description=(
            "Instant since `start_utc` [s], or the place of a field that holds it. If omitted, the end of the run for "
            "a goal, and the whole run for a limit."
        ),
    )
    tolerance: Positive | None = Field(
        default=None,
        description=(
            "Greatest error that counts as met, in the unit of the quantity. If omitted, a choice by unit: 0.01 m, "
            "1e-4 m/s, 0.01 deg, 1 m of a radius, 0.1 s, 1e-6 of a ratio."
        ),
    )

    @model_validator(mode="after")
    def _fitting_instant(self) -> Self:
        if QUANTITIES[self.quantity].of_states is None:
            for name in ("at_s", "between_s"):
                if getattr(self, name, None) is not None:
                    raise ValueError(f"{name}: '{self.quantity}' is of the whole run; leave it out")
        return self

    @property
    def greatest_error(self) -> float:
        """Greatest error that counts as met, in the unit of the quantity."""
        return _TOLERANCES[QUANTITIES[self.quantity].unit] if self.tolerance is None else self.tolerance


class Goal(_TargeterCondition):
    """One equality that the flight has to reach."""

    equals: Number | Vector = Field(
        description="Value of the quantity; three numbers for `position_m` and `velocity_m_s`."
    )

    @model_validator(mode="after")
    def _fitting_value(self) -> Self:
        if isinstance(self.equals, tuple) != (self.quantity in VECTORS):
            kind = "three numbers" if self.quantity in VECTORS else "one number"
            raise ValueError(f"equals: '{self.quantity}' is {kind}; give as many")
        return self


class Limit(_TargeterCondition):
    """One bound that the flight has to keep, at an instant, between two, or all the time."""

    between_s: tuple[Instant, Instant] | None = Field(
        default=None,
        description="First and last instant since `start_utc` [s], or places of fields that hold them.",
    )
    at_least: Number | None = Field(default=None, description="Lower bound, in the unit of the quantity.")
    at_most: Number | None = Field(default=None, description="Upper bound, in the unit of the quantity.")

    @model_validator(mode="after")
    def _bounded(self) -> Self:
        if self.at_least is None and self.at_most is None:
            raise ValueError("has no bound; give at_least, at_most or both")
        if self.at_least is not None and self.at_most is not None and not self.at_least < self.at_most:
            raise ValueError(f"at_least ({self.at_least:g}) is not below at_most ({self.at_most:g}); exchange the two")
        if self.at_s is not None and self.between_s is not None:
            raise ValueError("has at_s and between_s; leave out one")
        if self.quantity in VECTORS:
            raise ValueError(f"quantity: '{self.quantity}' is three numbers; bound range_m, speed_m_s or a component")
        if self.between_s is not None:
            first_s, last_s = self.between_s
            if not isinstance(first_s, str) and not isinstance(last_s, str) and not first_s < last_s:
                raise ValueError(f"between_s: {first_s:g} is not before {last_s:g}; give the earlier one first")
        return self


class Targeter(FilePart):
    """A targeter, as its TOML file says it: variables, goals and limits of a scenario's flight, and what is minimised."""

    version: Literal[1] = Field(description="Version of the file format.")
    name: Text = Field(description="Title of the results.")
    scenario: Text = Field(description="Path of the scenario file, relative to the folder of this file.")
    set: tuple[Text, ...] = Field(default=(), description="Settings that override the scenario, as `--set` takes them.")
    target: Name | None = Field(
        default=None, description="Name of the target that quantities are about. If omitted, the first."
    )
    minimize: QuantityName | None = Field(
        default=None, description="Quantity of the run that is made least, such as `delta_v_m_s`. If omitted, none."
    )
    max_iterations: Annotated[Count, Field(le=10_000)] = Field(
        default=100, description="Greatest number of iterations. Default: a choice."
    )
    samples: Annotated[Count, Field(ge=3, le=100_000)] = Field(
        default=241,
        description=(
            "Number of instants at which a limit over an interval is evaluated. Default: a choice; between samples a "
            "limit is not checked."
        ),
    )
    variable: Annotated[tuple[TargeterVariable, ...], Field(min_length=1, max_length=MOST_VARIABLES)] = Field(
        description="Fields that may change."
    )
    goal: Annotated[tuple[Goal, ...], Field(max_length=_MOST_ROWS)] = Field(default=(), description="Equalities.")
    limit: Annotated[tuple[Limit, ...], Field(max_length=_MOST_ROWS)] = Field(default=(), description="Inequalities.")
    _KIND: ClassVar[str] = "targeter"

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        twice = [name for name, n in Counter(variable.field for variable in self.variable).items() if n > 1]
        if twice:
            raise ValueError(f"variable: '{twice[0]}' is given twice; name each field once")
        if not self.goal and not self.limit:
            raise ValueError("has nothing to reach; add [[goal]] or [[limit]]")
        if self.minimize is not None and QUANTITIES[self.minimize].of_states is not None:
            of_run = ", ".join(name for name, quantity in QUANTITIES.items() if quantity.of_states is None)
            raise ValueError(f"minimize: '{self.minimize}' is of an instant; give one of the run: {of_run}")
        return self

    @property
    def chosen_method(self) -> str:
        """The method that is used: `corrector` or `gradient`."""
        return "corrector" if self.minimize is None else "gradient"

    def scenario_file(self) -> Path:
        """Find the scenario file, or raise `ScenarioError`."""
        path = self.folder / expand_user(self.scenario)
        if not path.is_file():
            raise ScenarioError(
                f"{self.where}: scenario: no file '{self.scenario}' in {self.folder.resolve()}; give its path from this file"
            )
        return path

    def find_target_name(self, scenario: Scenario) -> str:
        """Return the name of the target that quantities are about, or raise `ScenarioError`.

        Parameters
        ----------
        scenario : whose targets are meant
        """
        with add_place(self.where):
            if scenario.is_local or not scenario.target:
                raise ScenarioError("scenario: a targeter needs orbits about the Earth, and a target")
            return scenario.target[find_target(scenario, self.target, "target")].name
