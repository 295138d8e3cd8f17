"""Motion by SGP4 from a mean-elements message (CCSDS OMM) that stands in the scenario."""

from __future__ import annotations

from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from rso_lidar.orbit.element_set import ElementSet, impossible
from rso_lidar.orbit.epochs import Epochs
from rso_lidar.orbit.teme import age_days, states
from rso_lidar.part import Instant, Number, Part, Text, Whole
from rso_lidar.records import BodyState


class Omm(Part):
    """Motion by SGP4 from a mean-elements message written inline, with the numbers that its OMM gives.

    They are SGP4's mean elements (TEME, WGS72), not osculating ones. Validity: about a kilometre, growing by one to three
    a day. Beyond a week from the epoch there is a warning, beyond 5 years an error. For a rendezvous within kilometres,
    give the chief so and the other by a relative motion about it.
    """

    type: Literal["omm"] = "omm"
    object_name: Text | None = None
    norad_id: Annotated[Whole, Field(ge=0, lt=10**9)] = 0
    epoch_utc: Instant
    epoch_rest_ns: Annotated[Number, Field(ge=0, lt=1000)] = 0.0
    mean_motion_rev_day: Number
    eccentricity: Number
    inclination_deg: Number
    raan_deg: Number
    argument_of_perigee_deg: Number
    mean_anomaly_deg: Number
    bstar_per_earth_radius: Number = 0.0
    mean_motion_dot_rev_day2: Number = 0.0
    mean_motion_ddot_rev_day3: Number = 0.0

    @model_validator(mode="after")
    def _of_an_orbit(self) -> Self:
        wrong = impossible(self.elements())
        if wrong:
            raise ValueError(f"{wrong}; correct the message")
        return self

    @classmethod
    def of(cls, elements: ElementSet) -> Omm:
        """Return the motion of an element set."""
        return cls(
            object_name=elements.name or None,
            norad_id=elements.norad_id,
            epoch_utc=elements.epoch_utc,
            epoch_rest_ns=elements.epoch_rest_ns,
            **{key: getattr(elements, key) for key in _SHARED},
        )

    def elements(self) -> ElementSet:
        """Return the element set."""
        return ElementSet(
            name=self.object_name or "",
            norad_id=self.norad_id,
            where="omm",
            epoch_utc=self.epoch_utc,
            epoch_rest_ns=self.epoch_rest_ns,
            **{key: getattr(self, key) for key in _SHARED},
        )

    def epoch_age_days(self, epochs: Epochs) -> float:
        """Return the largest time between the elements' epoch and the epochs asked for [day]."""
        return age_days(self.elements(), epochs)

    def states(self, epochs: Epochs) -> BodyState:
        """Return position [m] and velocity [m/s] (time, 3) in GCRS axes; SGP4's failures raise `PropagationError`."""
        return states(self.elements(), epochs)


_SHARED = (
    "mean_motion_rev_day",
    "eccentricity",
    "inclination_deg",
    "raan_deg",
    "argument_of_perigee_deg",
    "mean_anomaly_deg",
    "bstar_per_earth_radius",
    "mean_motion_dot_rev_day2",
    "mean_motion_ddot_rev_day3",
)
