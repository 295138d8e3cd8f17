"""The requirements file: what is required of which quantity, under which conditions and with which confidence."""

from __future__ import annotations

import math
from collections import Counter
from functools import cached_property
from typing import Annotated, Any, ClassVar, Literal, Self

import numpy as np
from pydantic import AfterValidator, Field, model_validator

from rso_lidar.part import Count, Name, Number, Part, Positive, Text
from rso_lidar.scenario import FilePart, Scenario
from rso_lidar.study.trades.definition import check_frames, choose_frames
from rso_lidar.study.trades.merits import MERITS
from rso_lidar.study.verification.quantities import EXTREMES, STATISTICS, BoundedQuantity, find_quantity

_MOST = 1000  # requirements of a file
_MOST_SEEDS = 1000
_TRUTH_OF_RUN = ("time_in_field_s", "off_boresight_deg")  # figures of merit of all frames of the scenario
_CONDITIONS = ("frames", "between_m", "range_m", "probability", "material", "tilt_deg", "statistic")
_ALLOWED: dict[str, tuple[str, ...]] = {
    "merit": ("frames", "between_m"),
    "budget": ("range_m", "material", "tilt_deg"),
    "reach": ("probability", "material", "tilt_deg"),
    "finding": ("probability",),
    "timeline": ("statistic", "between_m"),
    "tracking": ("statistic", "frames", "between_m"),
    "parameter": (),
}
_NEEDED = {
    "budget": "range_m",
    "reach": "probability",
    "finding": "probability",
    "timeline": "statistic",
    "tracking": "statistic",
}


class Requirement(Part):
    """One requirement: a bound on a quantity, with what says how it is verified.

    Give exactly one of `at_least`, `at_most` and `within`. A random quantity needs a `confidence`.
    """

    id: Annotated[Text, Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9._\-]*$", max_length=60)] = Field(
        description="Identifier, such as `LID-010`; letters, digits, `.`, `_` and `-`."
    )
    text: Text = Field(description="The requirement as a sentence, such as `The lidar shall …`.")
    quantity: Text = Field(
        description=(
            "Quantity that is bounded: a figure of merit of a trade study, `finding.max_range_m`, or the path of a "
            "parameter such as `lidar.receiver.ifov_rad`. `budget.`, `timeline.` or `tracking.` and a name means a "
            "column of the link budget, the timeline or the table of the tracker."
        )
    )
    at_least: Number | None = Field(default=None, description="Lower bound, in the unit of the quantity.")
    at_most: Number | None = Field(default=None, description="Upper bound, in the unit of the quantity.")
    within: tuple[Number, Number] | None = Field(
        default=None, description="Lower and upper bound, in the unit of the quantity."
    )
    confidence: Annotated[Number, Field(gt=0.5, lt=1)] | None = Field(
        default=None,
        description=(
            "Confidence with which the bound must be shown, such as 0.95: that of a one-sided confidence bound. Required "
            "for a quantity that depends on noise, and only for that."
        ),
    )
    frames: Annotated[Any, AfterValidator(check_frames)] = Field(
        default=None,
        description=(
            'Frames that count, as text `"from:end:step"` or a list of indices. If omitted, all of the run, or those '
            "recorded."
        ),
    )
    between_m: tuple[Number, Number] | None = Field(
        default=None, description="Least and greatest true range of the target in the frames that count [m]."
    )
    range_m: Positive | None = Field(default=None, description="Range at which the link budget is evaluated [m].")
    probability: Annotated[Number, Field(gt=0, lt=1)] | None = Field(
        default=None, description="Probability of detection, or of finding, for which the greatest range is solved."
    )
    material: Text | None = Field(
        default=None,
        description=(
            "Material of the link budget: a name of the catalogue, a reflectance, or a BRDF table. If omitted, the dimmest "
            "and the brightest of the target; the worse one counts."
        ),
    )
    tilt_deg: Annotated[Number, Field(ge=0, le=89)] = Field(
        default=0.0, description="Tilt of the facet of the link budget [deg]. Default: a choice, it faces the lidar."
    )
    statistic: Literal["mean", "rms", "median", "p95", "greatest", "least"] | None = Field(
        default=None,
        description="Statistic of a column over the frames: `p95` is the 95 % quantile, `greatest` the largest value.",
    )
    verification: Literal["analysis", "test", "inspection", "demonstration"] = Field(
        default="analysis",
        description="Method of verification (NASA/SP-2016-6105, sec. 5.3). Default: a choice, a simulation is an analysis.",
    )
    rationale: Text | None = Field(default=None, description="Why the requirement is there.")
    source: Text | None = Field(default=None, description="Where the requirement or its number comes from.")

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        bounds = [name for name in ("at_least", "at_most", "within") if getattr(self, name) is not None]
        if len(bounds) != 1:
            given = f"both {bounds[0]} and {bounds[1]}" if bounds else "no bound"
            raise ValueError(f"has {given}; give exactly one of at_least, at_most and within")
        for name in ("within", "between_m"):
            ends = getattr(self, name)
            if ends is not None and not ends[0] < ends[1]:
                raise ValueError(f"{name}: {ends[0]:g} is not below {ends[1]:g}; give the lower one first")
        try:
            what = find_quantity(self.quantity)
        except ValueError as error:
            raise ValueError(f"quantity: {error}") from None
        self._check_conditions(what)
        if what.is_random and self.confidence is None:
            raise ValueError(f"confidence: is missing; '{self.quantity}' depends on noise, so give for example 0.95")
        if not what.is_random and self.confidence is not None:
            raise ValueError(f"confidence: '{self.quantity}' is computed without noise; leave it out")
        return self

    def _check_conditions(self, what: BoundedQuantity) -> None:
        """Refuse conditions that the quantity does not have, and ask for those that it needs."""
        allowed = () if self.quantity in _TRUTH_OF_RUN else _ALLOWED[what.kind]
        for name in _CONDITIONS:
            given = name in self.model_fields_set and getattr(self, name) is not None
            if given and name not in allowed:
                cure = f"it takes {', '.join(allowed)}" if allowed else "it takes no condition"
                raise ValueError(f"{name}: is no condition of '{self.quantity}'; {cure}")
        needed = _NEEDED.get(what.kind)
        if needed is not None and getattr(self, needed) is None:
            words = f" ({', '.join(STATISTICS)})" if needed == "statistic" else ""
            raise ValueError(f"{needed}: is missing; '{self.quantity}' needs it{words}")
        if what.kind == "tracking" and self.statistic in EXTREMES:
            raise ValueError(
                f"statistic: no sample bounds the {self.statistic} of what depends on noise; take p95 or rms"
            )

    @cached_property
    def what(self) -> BoundedQuantity:
        """The quantity that is bounded."""
        return find_quantity(self.quantity)

    @property
    def needs_frames(self) -> bool:
        """Whether frames must be simulated or read."""
        return self.what.kind == "tracking" or (self.what.kind == "merit" and MERITS[self.quantity].needs != "truth")

    @property
    def limits(self) -> tuple[float, float]:
        """Lower and upper bound; infinite where there is none."""
        if self.within is not None:
            return self.within
        return (
            -math.inf if self.at_least is None else self.at_least,
            math.inf if self.at_most is None else self.at_most,
        )

    def margin(self, low: float, high: float) -> float:
        """Return the distance of a value, or of its confidence bounds, from the limits; negative outside.

        Parameters
        ----------
        low, high : lower and upper confidence bound of the value, or the value twice
        """
        least, most = self.limits
        return min(low - least, most - high)

    def numbers(self, scenario: Scenario) -> np.ndarray:
        """Return the indices of the frames that `frames` chooses, whatever their range.

        Parameters
        ----------
        scenario : with the number of its frames
        """
        return choose_frames(scenario, self.frames)


class Requirements(FilePart):
    """A file of requirements, as TOML."""

    version: Literal[1] = Field(description="Version of the file format.")
    name: Text = Field(description="Title of the requirements.")
    target: Name | None = Field(
        default=None, description="Name of the target that the requirements are about. If omitted, the first."
    )
    seeds: Annotated[Count, Field(le=_MOST_SEEDS)] = Field(
        default=1,
        description=(
            "Number of runs of a scenario: its seed and the ones that follow it. A study has its own number, and a "
            "recording is one run."
        ),
    )
    requirement: tuple[Requirement, ...] = Field(
        min_length=1, max_length=_MOST, description="The requirements, in the order of the table."
    )
    _KIND: ClassVar[str] = "requirements"

    @model_validator(mode="after")
    def _own_names(self) -> Self:
        twice = [
            name for name, count in Counter(requirement.id for requirement in self.requirement).items() if count > 1
        ]
        if twice:
            raise ValueError(f"requirement: the id '{twice[0]}' is given twice; give each requirement its own")
        return self
