"""Taxonomy of targets, and hinges and keypoints of their models."""

from __future__ import annotations

from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from rso_lidar.part import Direction, Name, NotNegative, Number, Part, Text, Vector

ObjectClass = Literal["payload", "rocket_body", "debris", "capsule", "calibration", "terrain"]
ShapeFamily = Literal["box", "box_wing", "cylinder", "cone", "sphere", "plate", "truss", "irregular"]
SizeClass = Literal["tiny", "small", "medium", "large"]
Stabilisation = Literal["three_axis", "spin", "gravity_gradient", "tumbling", "fixed"]
# Categories of the shapes of fragments in DebriSat (Liou et al. 2013, 6th European Conference on Space Debris)
FragmentKind = Literal["flat_plate", "bent_plate", "straight_rod", "bent_rod", "nugget", "flexible"]
FRAGMENT_LENGTHS_M = (0.001, 10.0)  # of fragments that can be made; a choice

# Upper limits of the longest side [m]: 0.1 m is about the smallest object that radar catalogues hold in low orbit;
# 1 m and 10 m are arbitrary round numbers.
SIZE_LIMITS_M: dict[SizeClass, float] = {"tiny": 0.1, "small": 1.0, "medium": 10.0}


class Taxonomy(Part):
    """Class of a target, for statistics and for drawing datasets.

    `object_class` follows the catalogues (payload, rocket body, debris) and adds capsules, calibration bodies and
    terrain. `subclass` is free text. `size_class` depends on the longest side: below 0.1 m tiny, below 1 m small,
    below 10 m medium, otherwise large. `rate_deg_s` holds the lowest and highest usual body rate [deg/s].
    """

    object_class: ObjectClass = Field(
        description="Class of object as space catalogues use it, extended by capsules, calibration bodies and terrain."
    )
    subclass: Text = Field(description="Free subclass in a word or two, such as `upper_stage`.")
    shape_family: ShapeFamily = Field(description="Overall shape as seen from a distance.")
    size_class: SizeClass = Field(
        description="Class by the longest side: below 0.1 m tiny, below 1 m small, below 10 m medium, otherwise large."
    )
    stabilisation: Stabilisation = Field(description="How the object is stabilised or rotates.")
    rate_deg_s: tuple[NotNegative, NotNegative] = Field(
        default=(0.0, 0.0), description="Lowest and highest usual body rate [deg/s]."
    )

    @property
    def in_words(self) -> str:
        """Return the taxonomy in one line."""
        low, high = self.rate_deg_s
        rates = f" at {low:g} to {high:g} deg/s" if high else ""
        words = (self.object_class, self.subclass, self.shape_family, self.size_class, self.stabilisation)
        return ", ".join(word.replace("_", " ") for word in words) + rates

    @model_validator(mode="after")
    def _in_order(self) -> Self:
        if self.rate_deg_s[0] > self.rate_deg_s[1]:
            raise ValueError("rate_deg_s: the lowest rate comes first; exchange the two")
        return self


class Hinge(Part):
    """Hinge of a model: its `parts` turn about `axis` through `position_m` [m], in the axes of the mesh.

    The mesh stands at angle zero, and `travel_deg` holds the limits of the angle [deg]. `normal` is the direction that
    the hinge turns toward the Sun or a boresight.
    """

    name: Name = Field(description="Name of the hinge.")
    parts: Annotated[tuple[Text, ...], Field(min_length=1)] = Field(
        description="Names of the mesh parts that turn with the hinge."
    )
    position_m: Vector = Field(description="A point on the hinge line, in mesh axes [m].")
    axis: Direction = Field(
        description="Direction of the hinge line, in mesh axes, of any length; rotation is right-handed."
    )
    normal: Direction | None = Field(
        default=None,
        description=(
            "Direction, in mesh axes at angle zero, that the hinge turns toward the Sun or a boresight. If omitted, "
            "there is none."
        ),
    )
    travel_deg: tuple[Number, Number] = Field(
        default=(-180.0, 180.0), description="Lowest and highest hinge angle [deg]; the mesh stands at zero."
    )

    @model_validator(mode="after")
    def _in_order(self) -> Self:
        low, high = self.travel_deg
        if not low <= 0.0 <= high or low == high:
            raise ValueError("travel_deg: the range must contain 0, where the mesh stands; correct the limits")
        return self


class Keypoint(Part):
    """A named point on a target, whose place in images is labelled.

    In a scenario `position_m` is in body axes, with all hinges at zero. In the index of models it is in mesh axes.
    """

    name: Name = Field(description="Name of the point.")
    position_m: Vector = Field(
        description="Position, with all hinges at zero, in body axes [m]; in the index of models in mesh axes."
    )
    part: Text | None = Field(
        default=None, description="Part that carries the point along when a hinge turns it. If omitted, the body."
    )


def classify_size(longest_m: float) -> SizeClass:
    """Return the size class of a target by its longest side.

    Parameters
    ----------
    longest_m : the longest side [m]

    >>> classify_size(0.34), classify_size(20.98)
    ('small', 'large')
    """
    return next((name for name, limit_m in SIZE_LIMITS_M.items() if longest_m < limit_m), "large")
