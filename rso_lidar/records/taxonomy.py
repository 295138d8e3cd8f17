"""What is known of a target beside its mesh: its place in the taxonomy, and its hinges."""

from __future__ import annotations

from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from rso_lidar.part import Direction, Name, NotNegative, Number, Part, Text, Vector

ObjectClass = Literal["payload", "rocket_body", "debris", "capsule", "calibration", "terrain"]
ShapeFamily = Literal["box", "box_wing", "cylinder", "cone", "sphere", "plate", "truss", "irregular"]
SizeClass = Literal["tiny", "small", "medium", "large"]
Stabilisation = Literal["three_axis", "spin", "gravity_gradient", "tumbling", "fixed"]

# Longest sides [m] at which one size class ends and the next begins: 0.1 m is about what radar catalogues hold in low
# orbit; a metre and ten are round numbers of our own.
SIZE_LIMITS_M: dict[SizeClass, float] = {"tiny": 0.1, "small": 1.0, "medium": 10.0}


class Taxonomy(Part):
    """Where a target belongs: what to draw a dataset by.

    `object_class` follows the catalogues (payload, rocket body, debris), with capsules, calibration bodies and terrain
    beside them; `subclass` is free. `size_class` is by the longest side: under 0.1 m tiny, under 1 m small, under 10 m
    medium, else large. `rate_deg_s` is the least and the greatest body rate that is usual for it [deg/s].
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
        """Return the place in the taxonomy in one line."""
        low, high = self.rate_deg_s
        rates = f" at {low:g} to {high:g} deg/s" if high else ""
        words = (self.object_class, self.subclass, self.shape_family, self.size_class, self.stabilisation)
        return ", ".join(word.replace("_", " ") for word in words) + rates

    @model_validator(mode="after")
    def _in_order(self) -> Self:
        if self.rate_deg_s[0] > self.rate_deg_s[1]:
            raise ValueError("rate_deg_s: the least comes first; exchange the two")
        return self


class Hinge(Part):
    """A hinge that a model has: its `parts` turn about `axis` through `position_m` [m], in the axes of the mesh.

    The mesh stands at angle zero; `travel_deg` is how far the hinge goes [deg]. `normal` is what it turns toward the Sun,
    or a boresight, at angle zero; left out where there is none.
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
            raise ValueError("travel_deg: goes from one end past 0, where the mesh stands, to the other; mend the ends")
        return self


def classify_size(longest_m: float) -> SizeClass:
    """Return the size class of a target by its longest side [m].

    >>> classify_size(0.34), classify_size(20.98)
    ('small', 'large')
    """
    return next((name for name, limit_m in SIZE_LIMITS_M.items() if longest_m < limit_m), "large")
