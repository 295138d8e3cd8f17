"""What a threshold is solved for: a probability of detection at a signal, or a rate of false alarms."""

from __future__ import annotations

from typing import Annotated, Self

from pydantic import Field, model_validator

from rso_lidar.part import Number, Part, Positive

_Probability = Annotated[Number, Field(gt=0, lt=1)]


class ThresholdCondition(Part):
    """A condition for which the threshold is solved: `pd` at `photons`, or `false_alarms_per_s`.

    It is solved in the dark, with the other settings as they are, when the lidar is made; the trigger then has that
    `threshold_electrons`. In a file each change of laser or detector solves it again, so a trade compares cameras that
    are all set for it.
    """

    pd: _Probability | None = Field(
        default=None, description="Probability with which a return of `photons` is detected, such as 0.95."
    )
    photons: Positive | None = Field(
        default=None, description="Mean photons of that return on the pixel after the optics, of a facing surface."
    )
    pulse_fwhm_ns: Positive | None = Field(
        default=None,
        description="Length of the Gaussian pulse of that return [ns]. If omitted, it is the laser's own pulse.",
    )
    false_alarms_per_s: Positive | None = Field(
        default=None,
        description="Rate at which noise triggers an armed pixel in the dark, mean over the camera's pixels [1/s].",
    )

    @model_validator(mode="after")
    def _check_condition(self) -> Self:
        if self.false_alarms_per_s is not None:
            for name in ("pd", "photons", "pulse_fwhm_ns"):
                if getattr(self, name) is not None:
                    raise ValueError(f"{name} and false_alarms_per_s both determine the threshold; leave one out")
        elif self.pd is None or self.photons is None:
            raise ValueError("needs pd and photons, or false_alarms_per_s; give them")
        return self
