"""The specification of a dataset: what is drawn around a scenario, how often, and how it is split."""

from __future__ import annotations

from typing import Annotated, Any, ClassVar, Literal, Self

from pydantic import Field, model_validator

from rso_lidar.dataset.specification.distributions import Choice, Law, WholeNumber
from rso_lidar.dataset.specification.tables import (
    ClassOfTargets,
    Clutter,
    DrawnField,
    FrameSequence,
    ModelSplit,
    OptionalLabels,
    RandomSplit,
    RandomView,
    ReferencePointing,
    SensorEntry,
    SensorSplit,
    SplitRule,
)
from rso_lidar.errors import DatasetError, did_you_mean
from rso_lidar.part import Count, Name, Text, Whole
from rso_lidar.scenario import FilePart

MOST_SAMPLES = 10**8
_MEASURED = ("lidar.detector.", "lidar.laser.pulse_")  # fields on which the table of scatter depends, except:
_UNMEASURED = (
    "lidar.detector.camera_seed",
    "lidar.detector.armed_from_m",
    "lidar.detector.armed_to_m",
    "lidar.detector.gate.delay_ns",
    "lidar.laser.pulse_rate_hz",
)
_FEW = 32  # values of a law for whole numbers, for which that table is filled


class DatasetSpec(FilePart):
    """A dataset as its TOML file says it. Sample i depends on the specification and on i only."""

    version: Literal[1] = Field(description="Version of the file format.")
    name: Text = Field(description="Title of the dataset.")
    scenario: Text = Field(
        description="Path of the base scenario, beside this file or among the shipped examples; any scenario can be one."
    )
    set: tuple[Text, ...] = Field(
        default=(), description="Settings that override the scenario for all samples, as `--set` takes them."
    )
    seed: Annotated[Whole, Field(ge=0, lt=2**63)] = Field(
        default=0, description="Random seed of everything that is drawn, noise included."
    )
    sampling: Literal["random", "halton"] = Field(
        default="random",
        description=(
            "How laws are sampled: pseudo-random, or by a scrambled Halton sequence, whose points cover all laws of a class "
            "more evenly."
        ),
    )
    draws: Annotated[Count, Field(le=64)] = Field(
        default=1, description="Number of noise draws of each frame: the same poses and mean light, other noise."
    )
    target: Name | None = Field(
        default=None, description="Name of the scenario's target that classes replace. If omitted, the first."
    )
    classes: Annotated[tuple[ClassOfTargets, ...], Field(min_length=1)] = Field(description="Classes of targets.")
    view: RandomView | None = Field(
        default=None, description="Random views of the target. If omitted, the scenario's own motions and attitudes."
    )
    sequence: FrameSequence = Field(default=FrameSequence(), description="Frames of each sample.")
    sensor: tuple[SensorEntry, ...] = Field(
        default=(), description="Instruments, equally likely; the scenario's if none."
    )
    clutter: Clutter | None = Field(default=None, description="Other bodies in the field.")
    variable: tuple[DrawnField, ...] = Field(default=(), description="Fields of the scenario that are drawn.")
    controller: ReferencePointing | None = Field(
        default=None, description="Controller of a closed loop. If omitted, the scenario is flown in open loop."
    )
    split: SplitRule = Field(default=RandomSplit(), description="Rule that assigns samples to train, val and test.")
    labels: OptionalLabels = Field(default=OptionalLabels(), description="Optional labels.")
    shard_frames: Annotated[Count, Field(le=65536)] = Field(
        default=256, description="Greatest number of frames of a shard; a sample is never divided."
    )
    _KIND: ClassVar[str] = "dataset"

    def dumps(self) -> str:
        """Return the specification as TOML, with every default written out."""
        import tomli_w

        return tomli_w.dumps(self.model_dump(exclude_none=True))

    def variables_of(self, target_class: ClassOfTargets) -> list[DrawnField]:
        """Return the variables that are drawn for a class.

        Parameters
        ----------
        target_class : one of `classes`
        """
        return [drawn for drawn in self.variable if not drawn.classes or target_class.name in drawn.classes]

    @property
    def n_samples(self) -> int:
        """Number of samples of all classes."""
        return sum(target_class.samples for target_class in self.classes)

    @property
    def frames_per_sample(self) -> int:
        """Number of frames of a sample, all noise draws counted."""
        return self.sequence.frames * self.draws

    @property
    def samples_per_shard(self) -> int:
        """Number of samples of a full shard."""
        return max(1, self.shard_frames // self.frames_per_sample)

    @property
    def draws_detector(self) -> bool:
        """Whether nearly every sample has another detector or pulse, so that a table of one serves no other."""
        return any(
            variable.field.startswith(_MEASURED)
            and variable.field not in _UNMEASURED
            and not _has_few_values(variable.law)
            for variable in self.variable
        )

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        _check_names("classes", [target_class.name for target_class in self.classes])
        _check_names("sensor", [sensor.name for sensor in self.sensor])
        if self.n_samples > MOST_SAMPLES:
            raise ValueError(f"classes: {self.n_samples:,} samples are over {MOST_SAMPLES:,}; divide the dataset")
        if all(target_class.empty for target_class in self.classes):
            raise ValueError("classes: all are empty, so no frame would hold a target; add a class with models")
        known = [target_class.name for target_class in self.classes]
        for k, drawn in enumerate(self.variable):
            for name in drawn.classes:
                if name not in known:
                    raise ValueError(f"variable[{k}].classes: no class '{name}'{did_you_mean(name, known)}")
        if self.clutter is not None and self.view is None:
            raise ValueError("clutter: is placed by the laws of a view; add [view]")
        if self.controller is not None and self.sequence.start not in (None, 0):
            raise ValueError("sequence.start: under a controller frames depend on history; leave it out, or take 0")
        self._check_split()
        return self

    def _check_split(self) -> None:
        if isinstance(self.split, SensorSplit):
            _check_split_names(self.split, [sensor.name for sensor in self.sensor], "sensor")
        if isinstance(self.split, ModelSplit):
            for target_class in self.classes:
                if target_class.empty:
                    raise ValueError(
                        f"split: class '{target_class.name}' has no model to split by; take the type random"
                    )


def _has_few_values(law: Law) -> bool:
    """Return whether a law draws from a list, or from a few whole numbers."""
    return isinstance(law, Choice) or (isinstance(law, WholeNumber) and law.high - law.low < _FEW)


def _check_names(place: str, names: list[str]) -> None:
    """Check that names differ."""
    for k, name in enumerate(names):
        if name in names[:k]:
            raise ValueError(f"{place}: two have the name '{name}'; rename one")


def _check_split_names(split: Any, known: list[str], what: str) -> None:
    """Check that the names of a split exist, and leave some to train on."""
    for place in ("val", "test"):
        for name in getattr(split, place):
            if name not in known:
                raise ValueError(
                    f"split.{place}: no {what} '{name}'{did_you_mean(name, known)} (known: {', '.join(known)})"
                )
    if {*split.val, *split.test} >= {*known}:
        raise ValueError(f"split: every {what} is for validation or test; leave one to train on")


def check_model_split(spec: DatasetSpec, models: list[tuple[str, ...]]) -> None:
    """Check the split of a dataset by model, once the models of its classes are known.

    Parameters
    ----------
    models : (class) models of each class

    Raises
    ------
    DatasetError
        If a name is no model, or a class has none to train on or none left out.
    """
    if not isinstance(spec.split, ModelSplit):
        return
    try:
        _check_split_names(spec.split, sorted({name for names in models for name in names}), "model")
    except ValueError as error:
        raise DatasetError(f"{spec.where}: {error}") from None
    for target_class, names in zip(spec.classes, models, strict=True):
        if {*names} <= {*spec.split.val, *spec.split.test}:
            raise DatasetError(
                f"{spec.where}: split: class '{target_class.name}' has no model left to train on; give it another model"
            )
