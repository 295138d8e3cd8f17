"""Errors that disperse the flights of a mission: of the start, the burns, navigation, pointing and the laser."""

from __future__ import annotations

from typing import Annotated, Literal, Self

import numpy as np
from pydantic import Field, model_validator

from rso_lidar.part import NotNegative, Number, Part, Positive, Vector
from rso_lidar.rpo import Thrusters
from rso_lidar.rpo.flown.flown_plan import AnyNavigation

Row = tuple[Number, Number, Number, Number, Number, Number]
_ROUNDING = 1e-9  # relative, to which a covariance may be asymmetric or negative


class Dispersion(Part):
    """Errors of the flights that `disperse` makes: normal, and independent from run to run. A run does not use them.

    Errors of burns and navigation are those of a `flown` motion, unless they are given here.
    """

    position_sigma_m: Vector = Field(
        default=(0.0, 0.0, 0.0),
        description="Standard deviations of the position at `start_utc`: radial, along-track and cross-track [m].",
    )
    velocity_sigma_m_s: Vector = Field(
        default=(0.0, 0.0, 0.0),
        description="Standard deviations of the velocity relative to the rotating rtn axes, in the same axes [m/s].",
    )
    covariance: tuple[Row, Row, Row, Row, Row, Row] | None = Field(
        default=None,
        description=(
            "Covariance of position and velocity at `start_utc`, in place of the standard deviations, in the rotating rtn "
            "axes [m², m²/s, m²/s²]."
        ),
    )
    thrusters: Thrusters | None = Field(
        default=None, description="Errors of burns. If omitted, those of the `flown` motion, else none."
    )
    navigation: AnyNavigation | None = Field(
        default=None,
        description="Navigation: `errors` or a `filter`. If omitted, that of the `flown` motion, else none.",
    )
    pointing: Literal["target", "plan"] = Field(
        default="target",
        description=(
            "Where the lidar is pointed: at the target, wherever it is, or at the place where the flight without errors "
            "would see it."
        ),
    )
    pointing_sigma_deg: NotNegative = Field(
        default=0.0, description="Standard deviation of a constant error of the boresight about each of two axes [deg]."
    )
    energy_sigma_fraction: Annotated[NotNegative, Field(le=0.3)] = Field(
        default=0.0, description="Standard deviation of the pulse energy of a run, as a fraction, at most 0.3."
    )
    hard_body_radius_m: Positive | None = Field(
        default=None,
        description=(
            "Distance from the target's origin that counts as a collision [m]. If omitted, the radius of the sphere about "
            "that origin that holds the target's model."
        ),
    )

    @model_validator(mode="after")
    def _is_covariance(self) -> Self:
        for key in ("position_sigma_m", "velocity_sigma_m_s"):
            if min(getattr(self, key)) < 0.0:
                raise ValueError(f"{key}: a standard deviation is negative: give 0 or more")
        if self.covariance is None:
            return self
        if any(self.position_sigma_m) or any(self.velocity_sigma_m_s):
            raise ValueError("covariance: stands in place of position_sigma_m and velocity_sigma_m_s: leave these out")
        matrix = np.array(self.covariance)
        scale = np.sqrt(np.abs(np.diag(matrix)))
        unit = matrix / np.where(np.outer(scale, scale) > 0.0, np.outer(scale, scale), 1.0)
        if np.abs(unit - unit.T).max() > _ROUNDING:
            raise ValueError("covariance: is not symmetric: give the same number on both sides of the diagonal")
        if np.linalg.eigvalsh(unit).min() < -_ROUNDING * 6 or np.abs(matrix[scale == 0.0]).max(initial=0.0) > 0.0:
            raise ValueError("covariance: is not positive semidefinite, so it is no covariance: correct it")
        return self

    @property
    def start_covariance(self) -> np.ndarray:
        """Covariance (6, 6) of the state at the start [m2, m2/s, m2/s2]."""
        if self.covariance is not None:
            return np.array(self.covariance)
        made: np.ndarray = np.diag(np.square((*self.position_sigma_m, *self.velocity_sigma_m_s)))
        return made
