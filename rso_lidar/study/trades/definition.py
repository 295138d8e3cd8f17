"""The definition of a trade study: which fields of a scenario take which values, and how points are evaluated."""

from __future__ import annotations

import datetime
import json
import math
import re
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal, Self

import numpy as np
from pydantic import AfterValidator, BeforeValidator, Field, model_validator

from rso_lidar.errors import ScenarioError, add_place, did_you_mean
from rso_lidar.files import expand_user
from rso_lidar.part import Count, Name, Number, Part, Text, Whole
from rso_lidar.scenario import FilePart, Scenario, find_target
from rso_lidar.study.trades.merits import MERITS, list_evaluated

MOST_ROWS = 100_000  # of a table; its report holds them all
_MOST_SEEDS = 1000


def _as_fields(given: Any) -> Any:
    return (given,) if isinstance(given, str) else given


def _check_values(given: Any) -> Any:
    if given is None:
        return None
    if not isinstance(given, list | tuple):
        raise ValueError(f"needs a list of values, not {given!r:.60}")
    if not given:
        raise ValueError("is empty; give at least one value")
    for value in given:
        _check_finite(value)
    if any(value in given[:k] for k, value in enumerate(given)):
        raise ValueError("contains a value twice; give each value once")
    return tuple(given)


def _check_finite(value: Any) -> None:
    if isinstance(value, list | tuple | dict):
        for inner in value.values() if isinstance(value, dict) else value:
            _check_finite(inner)
    elif isinstance(value, float) and not math.isfinite(value):
        raise ValueError(f"{value} is not a finite number; give finite numbers")


def check_frames(given: Any) -> Any:
    """Check frames, given as text ``A:B:STEP`` or as indices."""
    if given is None or (isinstance(given, str) and re.fullmatch(r"\d*:\d*(:[1-9]\d*)?", given)):
        return given
    if isinstance(given, list | tuple) and given and all(type(frame) is int and frame >= 0 for frame in given):
        return tuple(given)
    raise ValueError(f"needs text such as '0:2700:100' (from, end, step), or a list of frames, not {given!r:.60}")


def _check_merits(names: tuple[str, ...]) -> tuple[str, ...]:
    for k, name in enumerate(names):
        if name not in MERITS:
            raise ValueError(
                f"no figure of merit '{name}'{did_you_mean(name, MERITS)} (known: {', '.join(sorted(MERITS))})"
            )
        if name in names[:k]:
            raise ValueError(f"'{name}' is given twice; name it once")
    return names


class Grid(Part):
    """Every combination of the values of all axes; the last axis runs fastest."""

    type: Literal["grid"] = "grid"


class Random(Part):
    """Points drawn at random, uniformly over the values or the span of each axis."""

    type: Literal["random"] = "random"
    points: Count = Field(description="Number of points.")


class LatinHypercube(Part):
    """Points of a Latin hypercube: each axis has n equal strata with one point each (McKay et al. 1979)."""

    type: Literal["latin_hypercube"] = "latin_hypercube"
    points: Count = Field(description="Number of points, and of strata along each axis.")


class Axis(Part):
    """One axis: a field of the scenario, or several that change together, and their values.

    An axis has either `values`, or `low` and `high`. A grid needs `count` with the latter.
    """

    field: Annotated[
        tuple[Annotated[Text, Field(pattern=r"^[^=\s]+$")], ...], BeforeValidator(_as_fields), Field(min_length=1)
    ] = Field(
        description=(
            "Place of a field in the scenario, as `--set` takes it, or a list of places. Several fields take one "
            "value, or each its own."
        )
    )
    values: Annotated[Any, AfterValidator(_check_values)] = Field(
        default=None,
        description=(
            "List of values for the field; for several fields, a list with one value for each. Random points draw "
            "each entry with equal probability."
        ),
    )
    low: Number | None = Field(default=None, description="Lowest value, in the unit of the field.")
    high: Number | None = Field(
        default=None, description="Highest value, in the unit of the field; random points exclude it."
    )
    count: Count | None = Field(
        default=None, description="Number of values of a grid from `low` to `high`, both included."
    )
    scale: Literal["linear", "log"] = Field(
        default="linear",
        description="Whether values are evenly spaced themselves (`linear`) or in their logarithms (`log`).",
    )

    @model_validator(mode="after")
    def _one_way(self) -> Self:
        span = {name: getattr(self, name) for name in ("low", "high", "count")}
        if self.values is not None:
            if both := [name for name, value in span.items() if value is not None]:
                raise ValueError(f"has values and {both[0]}; leave out one")
            if self.scale == "log":
                raise ValueError("has values and scale; a scale is of low and high")
            self._check_linked()
        elif self.low is None or self.high is None:
            raise ValueError("needs values, or low and high")
        elif self.low >= self.high:
            raise ValueError(f"low ({self.low:g}) is not below high ({self.high:g}); exchange the two")
        elif self.scale == "log" and self.low <= 0.0:
            raise ValueError(f"a log scale needs low above 0, not {self.low:g}")
        return self

    def _check_linked(self) -> None:
        if len(self.field) > 1:
            for value in self.values:
                if isinstance(value, list) and len(value) != len(self.field):
                    raise ValueError(f"{value!r:.60} has not one value for each of {len(self.field)} fields")

    @property
    def size(self) -> int | None:
        """Number of values of a grid; None where it is not given."""
        return self.count if self.values is None else len(self.values)

    @property
    def name(self) -> str:
        """Name of the axis: its first field."""
        return self.field[0]

    @property
    def numeric(self) -> bool:
        """Whether all values are numbers."""
        return self.values is None or all(type(value) in (int, float) for value in self.values)

    def at(self, share: np.ndarray) -> list[Any]:
        """Return the values at relative positions (point) along the axis, from 0 to below 1."""
        if self.values is not None:
            return [self.values[int(fraction * len(self.values))] for fraction in share.tolist()]
        assert self.low is not None
        assert self.high is not None
        if self.scale == "log":
            spread = self.low * (self.high / self.low) ** share
        else:
            spread = self.low + (self.high - self.low) * share
        return [float(f"{value:.12g}") for value in spread.tolist()]

    def grid(self) -> tuple[Any, ...]:
        """Return the values of a grid."""
        if self.values is not None:
            return tuple(self.values)
        assert self.count is not None
        share = np.arange(self.count) / max(self.count - 1, 1)
        return tuple(self.at(share))

    def settings(self, value: Any) -> dict[str, str]:
        """Return the TOML text of a value by field."""
        each = value if len(self.field) > 1 and isinstance(value, list) else [value] * len(self.field)
        return {field: write_toml_value(field_value) for field, field_value in zip(self.field, each, strict=True)}


class Report(Part):
    """Contents of the report beside plots and tables."""

    pictures: Annotated[Whole, Field(ge=0, le=24)] = Field(
        default=4,
        description=(
            "Number of points shown with a frame: the best and the worst by the first figure of merit, and evenly "
            "spaced ones between."
        ),
    )
    frame: Annotated[Whole, Field(ge=0)] | None = Field(
        default=None, description="Index of the frame shown. If omitted, the middle one of the simulated frames."
    )


class Study(FilePart):
    """A trade study, as its TOML file says it."""

    version: Literal[1] = Field(description="Version of the file format.")
    name: Text = Field(description="Title of the report.")
    scenario: Text = Field(description="Path of the scenario file, relative to the study's folder.")
    set: tuple[Text, ...] = Field(
        default=(), description="Settings that override the scenario for all points, as `--set` takes them."
    )
    seed: Annotated[Whole, Field(ge=0, lt=2**63)] = Field(
        default=0, description="Random seed of the drawn points; noise uses the scenario's seed."
    )
    seeds: Annotated[Count, Field(le=_MOST_SEEDS)] = Field(
        default=1,
        description=(
            "Number of runs of each point: the scenario's seed and the ones that follow it, equal for all points."
        ),
    )
    sampling: Annotated[Grid | Random | LatinHypercube, Field(discriminator="type")] = Field(
        default=Grid(), description="Choice of points: all of a grid, or random ones."
    )
    frames: Annotated[Any, AfterValidator(check_frames)] = Field(
        default=None,
        description=(
            'Frames of each run that are simulated, as text `"from:end:step"` or a list of indices, if a figure of '
            "merit needs frames. If omitted, all."
        ),
    )
    merits: Annotated[tuple[Text, ...], Field(min_length=1), AfterValidator(_check_merits)] = Field(
        description="Names of the figures of merit; the first one ranks the pictures."
    )
    target: Name | None = Field(
        default=None, description="Name of the target that is evaluated. If omitted, the first."
    )
    min_detection_fraction: Annotated[Number, Field(ge=0, le=1)] = Field(
        default=0.5,
        description=(
            "Minimum share of the target's pixels that report, averaged over the runs of a point, for a ranking by "
            "figures of merit that depend on detection; 0 ranks all points. With less than half, the reporting pixels "
            "are selected by brightness and noise, so that their errors do not represent the camera."
        ),
    )
    axis: tuple[Axis, ...] = Field(description="Fields that change from point to point.")
    report: Report = Field(default=Report(), description="Contents of the report.")
    _KIND: ClassVar[str] = "study"

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        if not self.axis:
            raise ValueError("axis: is empty; add [[axis]]")
        seen: list[str] = []
        for k, axis in enumerate(self.axis):
            for field in axis.field:
                if field in seen:
                    raise ValueError(f"axis[{k}].field: '{field}' is an axis already; name each field once")
                seen.append(field)
            if self.sampling.type == "grid" and axis.size is None:
                raise ValueError(f"axis[{k}]: a grid needs count beside low and high; or draw points: sampling.type")
            if self.sampling.type != "grid" and axis.count is not None:
                raise ValueError(f"axis[{k}].count: is for a grid; leave it out, sampling.points says how many")
        if "seed" in seen and self.seeds > 1:
            raise ValueError("seeds: 'seed' is an axis already; leave out one")
        if self.n_rows > MOST_ROWS:
            raise ValueError(
                f"{self.n_rows:,} points and seeds are more than {MOST_ROWS:,}; take fewer values, or draw some: "
                'sampling = { type = "latin_hypercube", points = 200 }'
            )
        return self

    @property
    def n_rows(self) -> int:
        """Number of runs."""
        n = math.prod(axis.size or 1 for axis in self.axis) if isinstance(self.sampling, Grid) else self.sampling.points
        return n * self.seeds

    @property
    def judged_by(self) -> tuple[str, ...]:
        """Figures of merit of a row: those requested, and the detection fraction where one depends on it."""
        return list_evaluated(self.merits)

    @property
    def places(self) -> tuple[str, ...]:
        """All fields that change, in the order of the axes."""
        return tuple(field for axis in self.axis for field in axis.field)

    def scenario_file(self) -> Path:
        """Find the scenario file, or raise `ScenarioError`."""
        path = self.folder / expand_user(self.scenario)
        if not path.is_file():
            raise ScenarioError(
                f"{self.where}: scenario: no file '{self.scenario}' in {self.folder.resolve()}; give its path from the study"
            )
        return path

    def base(self, *, trust_code: bool = False, trust_fmu: bool = False) -> Scenario:
        """Load the scenario before any axis changes it, and check target and frames.

        Parameters
        ----------
        trust_code, trust_fmu : whether Python code and FMUs that the scenario names may run

        Returns
        -------
        Scenario
            With the settings of `set`.
        """
        with add_place(self.where):
            scenario = Scenario.load(self.scenario_file(), self.set, trust_code=trust_code, trust_fmu=trust_fmu)
            self.number(scenario)
            if not any(place.startswith("time.") for place in self.places):
                self.numbers(scenario)
        return scenario

    def number(self, scenario: Scenario) -> int:
        """Return the index of the evaluated target, or raise `ScenarioError`.

        Parameters
        ----------
        scenario : in which the target is
        """
        return find_target(scenario, self.target, "target")

    def numbers(self, scenario: Scenario) -> np.ndarray:
        """Return the indices of the frames that are simulated.

        Parameters
        ----------
        scenario : with the number of its frames
        """
        return choose_frames(scenario, self.frames)


def choose_frames(scenario: Scenario, frames: Any) -> np.ndarray:
    """Return the indices of frames that are given as text ``A:B:STEP`` or as indices (None: all), in ascending order.

    Parameters
    ----------
    scenario : with the number of its frames
    frames : as `check_frames` lets it pass
    """
    if isinstance(frames, str):
        frames = slice(*(int(word) if word else None for word in frames.split(":")))
    return scenario.time.choose_frames(frames)


def write_toml_value(value: Any) -> str:
    """Write a value as TOML on one line. Numbers without a fraction become integers, which every numeric field accepts.

    >>> write_toml_value([0.5, 2.0, True, "a", {"type": "gsfl"}])
    '[0.5, 2, true, "a", { type = "gsfl" }]'
    """
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, int | float):
        return str(int(value)) if value == int(value) and abs(value) < 1e15 else repr(value)
    if isinstance(value, list | tuple):
        return "[" + ", ".join(write_toml_value(item) for item in value) + "]"
    if isinstance(value, dict):
        return (
            "{ "
            + ", ".join(
                f"{key if re.fullmatch(r'[A-Za-z0-9_-]+', key) else json.dumps(key)} = {write_toml_value(item)}"
                for key, item in value.items()
            )
            + " }"
        )
    if isinstance(value, datetime.date | datetime.time):
        return value.isoformat()
    return json.dumps(str(value), ensure_ascii=False)
