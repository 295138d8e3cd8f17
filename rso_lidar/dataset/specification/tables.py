"""The tables of a dataset's specification: classes, views, sequences, sensors, clutter, variables, splits and labels."""

from __future__ import annotations

from typing import Annotated, Literal, Self, get_args

import numpy as np
from pydantic import Field, model_validator

from rso_lidar.dataset.specification.distributions import (
    Choice,
    Law,
    LogUniform,
    NumberLaw,
    Uniform,
    UniformDirection,
    UniformRotation,
    WholeNumber,
    check_components,
    check_range,
)
from rso_lidar.part import Count, Flag, Fraction, Name, NotNegative, Part, Positive, Text, Whole
from rso_lidar.records import FRAGMENT_LENGTHS_M, FragmentKind, ObjectClass, ShapeFamily, SizeClass, Stabilisation

SPLITS = ("train", "val", "test")


class TaxonomyFilter(Part):
    """Shipped models whose taxonomy agrees with every key that is given."""

    object_class: ObjectClass | None = Field(default=None, description="Class of object.")
    subclass: Text | None = Field(default=None, description="Free subclass.")
    shape_family: ShapeFamily | None = Field(default=None, description="Overall shape.")
    size_class: SizeClass | None = Field(default=None, description="Class by the longest side.")
    stabilisation: Stabilisation | None = Field(default=None, description="How the object is stabilised or rotates.")

    @model_validator(mode="after")
    def _asks(self) -> Self:
        if not self.model_fields_set:
            raise ValueError("gives no key; give one, such as shape_family")
        return self


class DrawnFragments(Part):
    """Fragments of a break-up, each from a random seed: no mesh files, and another shape in every sample.

    Each kind counts as a model. The drawn size and seed are the variables `fragment.characteristic_length_m` and
    `fragment.seed`.
    """

    kinds: Annotated[tuple[FragmentKind, ...], Field(min_length=1)] = Field(
        default=get_args(FragmentKind), description="Categories of shape, equally likely. If omitted, all."
    )
    characteristic_length_m: NumberLaw = Field(description="Mean of the three orthogonal extents [m].")
    seed: WholeNumber = Field(
        default=WholeNumber(low=0, high=2**52 - 1),
        description="Random seed of the shape; a law with few values makes the same fragments again and again.",
    )

    @model_validator(mode="after")
    def _can_be_made(self) -> Self:
        if len(set(self.kinds)) < len(self.kinds):
            raise ValueError("kinds: one is named twice; name each once")
        law, (least_m, most_m) = self.characteristic_length_m, FRAGMENT_LENGTHS_M
        check_components(law, 1, "characteristic_length_m")
        ends = law.values if isinstance(law, Choice) else tuple(law.at(np.array([end])) for end in (0.0, 1.0))
        if min(ends) < least_m or max(ends) > most_m:
            raise ValueError(
                f"characteristic_length_m: draws {min(ends):g} to {max(ends):g} m, and fragments are of {least_m:g} to "
                f"{most_m:g} m; correct its bounds"
            )
        if self.seed.low < 0:
            raise ValueError(f"seed: draws {self.seed.low}, and a seed is 0 or more; raise low")
        return self


class ClassOfTargets(Part):
    """One class that a classifier tells apart, and how many samples it has.

    Its target is drawn from `models`, from the shipped models of a `taxonomy`, or from `fragments`. Without these it is the
    target of the scenario as it stands. A class that is `empty` has no target: background, for detection.
    """

    name: Name = Field(description="Name of the class.")
    samples: Count = Field(description="Number of samples: single flashes, or sequences.")
    models: tuple[Text, ...] = Field(
        default=(), description="Models of the class, equally likely: names of the catalogue, or paths of meshes."
    )
    taxonomy: TaxonomyFilter | None = Field(
        default=None, description="Shipped models by taxonomy, in place of `models`."
    )
    fragments: DrawnFragments | None = Field(
        default=None, description="Fragments from random seeds, in place of `models`."
    )
    empty: Flag = Field(default=False, description="Whether the target is left out.")
    set: tuple[Text, ...] = Field(
        default=(), description="Settings of the scenario for this class, as `--set` takes them."
    )

    @model_validator(mode="after")
    def _one_way(self) -> Self:
        ways = [name for name in ("models", "taxonomy", "fragments", "empty") if getattr(self, name)]
        if len(ways) > 1:
            raise ValueError(f"gives {' and '.join(ways)}; leave out all but one")
        if len(set(self.models)) < len(self.models):
            raise ValueError("models: one is named twice; name each once")
        return self

    @property
    def replaces_target(self) -> bool:
        """Whether the class, and not the scenario, chooses the target's shape."""
        return bool(self.models or self.taxonomy or self.fragments)


class RandomView(Part):
    """A random view: the target is placed in front of the lidar, in place of its own motion and attitude.

    The lidar must look along a fixed direction of the follower: a scenario with a PTU varies its own fields instead.
    """

    range_m: NumberLaw = Field(description="Distance of the target's origin from the lidar [m].")
    offset_fraction: Law = Field(
        default=Uniform(low=(-0.5, -0.5), high=(0.5, 0.5)),
        description=(
            "Place of the target's origin in the image, right and down from the boresight: two numbers, 1 at the edge of "
            "the field."
        ),
    )
    attitude: Law = Field(
        default=UniformRotation(), description="Initial inertial_from_body of the target, a quaternion x, y, z, w."
    )
    spin_deg_s: NumberLaw | None = Field(
        default=None,
        description="Body rate of the target about an axis uniform on the sphere [deg/s]. If omitted, it does not turn.",
    )
    sun: UniformDirection | None = Field(
        default=None,
        description="Direction to the Sun in root axes, of a scenario with local axes. If omitted, the scenario's own.",
    )

    @model_validator(mode="after")
    def _components(self) -> Self:
        check_range(self.range_m)
        check_components(self.offset_fraction, 2, "offset_fraction")
        check_components(self.attitude, 4, "attitude")
        if self.spin_deg_s is not None:
            check_components(self.spin_deg_s, 1, "spin_deg_s")
        return self


class FrameSequence(Part):
    """Frames that one sample takes from its scenario."""

    frames: Annotated[Count, Field(le=4096)] = Field(default=1, description="Number of frames of a sample.")
    stride: Count = Field(default=1, description="Step between them, in frames of the scenario.")
    start: Annotated[Whole, Field(ge=0)] | None = Field(
        default=None, description="Number of the first frame. If omitted, it is drawn, uniformly over the scenario."
    )


class SensorEntry(Part):
    """One of several instruments, by settings of the scenario; samples draw one of them."""

    name: Name = Field(description="Name of the sensor.")
    set: tuple[Text, ...] = Field(
        default=(), description='Settings, as `--set` takes them, such as `"lidar.receiver.fov_deg=5"`.'
    )


class Clutter(Part):
    """Other bodies in the field: background clutter, drawn anew for each sample. They need a `[view]`."""

    models: tuple[Text, ...] = Field(
        default=(),
        description="Models of the bodies, equally likely: names of the catalogue, or paths of meshes.",
    )
    fragments: DrawnFragments | None = Field(
        default=None, description="Fragments from random seeds; each of their kinds is as likely as a model."
    )
    count: WholeNumber = Field(description="Law of the number of bodies.")
    range_m: NumberLaw = Field(
        default=LogUniform(low=50.0, high=3000.0), description="Distance of each from the lidar [m]."
    )
    offset_fraction: Law = Field(
        default=Uniform(low=(-1.0, -1.0), high=(1.0, 1.0)),
        description="Place of each in the image, right and down from the boresight; 1 is the edge of the field.",
    )

    @model_validator(mode="after")
    def _components(self) -> Self:
        if not self.models and self.fragments is None:
            raise ValueError("gives neither models nor fragments; give some of them")
        check_range(self.range_m)
        check_components(self.offset_fraction, 2, "offset_fraction")
        if not 0 <= self.count.low <= self.count.high <= 16:
            raise ValueError("count: needs 0 to 16 bodies; correct low and high")
        return self


class DrawnField(Part):
    """A field of the scenario, or several that take one value, drawn for each sample."""

    field: Text = Field(description="Place of the field in the scenario, as `--set` takes it.")
    law: Law = Field(description="Law of its values.")
    classes: tuple[Name, ...] = Field(
        default=(), description="Names of the classes that it applies to; all if omitted."
    )


class RandomSplit(Part):
    """Each class is divided at random by its shares. A sample keeps its split when its class grows."""

    type: Literal["random"] = "random"
    val: Fraction = Field(default=0.0, description="Share of each class for validation.")
    test: Fraction = Field(default=0.4, description="Share of each class for the test.")

    @model_validator(mode="after")
    def _room(self) -> Self:
        if self.val + self.test >= 1.0:
            raise ValueError(f"val and test are {self.val + self.test:g} together, and nothing is left to train on")
        return self


class _NamedSplit(Part):
    """Samples are assigned by a name of what they hold."""

    val: tuple[Text, ...] = Field(default=(), description="Names for validation.")
    test: Annotated[tuple[Text, ...], Field(min_length=1)] = Field(description="Names for the test; the rest trains.")

    @model_validator(mode="after")
    def _once(self) -> Self:
        both = sorted({*self.val} & {*self.test})
        if both:
            raise ValueError(f"'{both[0]}' is for validation and for the test; name it once")
        return self


class ModelSplit(_NamedSplit):
    """Samples are assigned by model: whole craft are unseen in training."""

    type: Literal["model"] = "model"


class SensorSplit(_NamedSplit):
    """Samples are assigned by sensor: a whole instrument is unseen in training."""

    type: Literal["sensor"] = "sensor"


SplitRule = Annotated[RandomSplit | ModelSplit | SensorSplit, Field(discriminator="type")]


class OptionalLabels(Part):
    """Labels that cost time or space, beside those that every frame has."""

    prediction: Flag = Field(
        default=True, description="Detection probability and standard deviation of range, pixel by pixel."
    )
    part_visibility: Flag = Field(
        default=False,
        description="Share of each part class's silhouette that is not hidden; costs one more cast.",
    )
    oversampled: Flag = Field(
        default=False, description="Range and photons on the finer grid of rays, for super-resolution."
    )
    camera_electrons: Flag = Field(
        default=False, description="Expected electrons of each pixel of the cameras beside the lidar, without noise."
    )
    keypoints: Flag = Field(
        default=False,
        description="Places of the target's keypoints in the images of lidar and cameras, and which of them are visible.",
    )
    normals: Flag = Field(
        default=False,
        description="Normal of what is in each pixel, in the axes of lidar or camera; three numbers a pixel.",
    )


class ReferencePointing(Part):
    """The reference controller of `rl.track.Pointing`, for a scenario in closed loop."""

    type: Literal["pointing"] = "pointing"
    gate_m: Positive = Field(default=20.0, description="Depth of the range window [m], about that of the target.")
    min_pixels: Count = Field(default=4, description="Fewest returns that make a target.")
    alpha: Annotated[Fraction, Field(gt=0)] = Field(default=0.5, description="Share of each new angle in the estimate.")
    lead_s: NotNegative = Field(default=0.0, description="Further lead for the lag of the drive [s].")
    coast_s: NotNegative = Field(default=2.0, description="How long a lost target is followed at its last rate [s].")
