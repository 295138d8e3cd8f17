"""Errors that disperse the flights of a mission: of both starts, the burns, navigation, attitude, pointing and the laser."""

from __future__ import annotations

from typing import Annotated, Literal, Self

import numpy as np
from pydantic import Field, model_validator

from rso_lidar.errors import warn
from rso_lidar.part import NotNegative, Number, Part, Positive, Text, Vector, Whole
from rso_lidar.rpo import AnyNavigation, Thrusters

Row = tuple[Number, Number, Number, Number, Number, Number]
_ROUNDING = 1e-9  # relative, to which a covariance may be asymmetric or negative
MOST_ATTITUDE_DEG = 30.0
# 10 m/s of speed are 3 v T = 170 km along the track after one low revolution, and go with 10 km of position (v = n r). Sets
# that catalogues publish are known to some km and m/s; what is worse is lost, and nothing flies to it.
_MOST_M, _MOST_M_S = 100_000.0, 10.0
# Precise orbits are known to 1 to 2 cm and 10 um/s (GRACE: Kang et al., J. Geodesy 80 (2006) 322), relative ones to 1 mm by
# carrier phases in processing afterwards: no start of a flight is known to less than both of these.
_LEAST_M, _LEAST_M_S = 0.1, 1e-4


class ElementSetErrors(Part):
    """Covariance of an object's element sets at their age, from differences between its successive sets in a file.

    It is `rl.study.estimate_set_errors(sets).covariance_at(age_days)`: consistency of the sets, not their accuracy.
    """

    type: Literal["element_sets"] = "element_sets"
    file: Text = Field(description="File with element sets of the object at many epochs (TLE, 3LE or OMM).")
    name: Text | None = Field(default=None, description="Name of the object, where the file has several.")
    norad_id: Annotated[Whole, Field(ge=1, lt=10**9)] | None = Field(
        default=None, description="Catalogue number of the object, where the file has several."
    )
    age_days: NotNegative | None = Field(
        default=None,
        description="Age of the set that is flown [day]. If omitted, that of the set whose epoch is nearest to `start_utc`.",
    )

    @model_validator(mode="after")
    def _one_selection(self) -> Self:
        if self.name is not None and self.norad_id is not None:
            raise ValueError("name and norad_id both choose the object; give one")
        return self


class StateErrors(Part):
    """Base of errors of a state at `start_utc`: standard deviations, a covariance, or the errors of element sets."""

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
    start: ElementSetErrors | None = Field(
        default=None,
        description="Errors of element sets of a file, by their type, in place of the standard deviations and `covariance`.",
    )

    @model_validator(mode="after")
    def _is_covariance(self) -> Self:
        for key in ("position_sigma_m", "velocity_sigma_m_s"):
            if min(getattr(self, key)) < 0.0:
                raise ValueError(f"{key}: a standard deviation is negative; give 0 or more")
        stated = [key for key in ("position_sigma_m", "velocity_sigma_m_s") if any(getattr(self, key))]
        if self.start is not None and (stated or self.covariance is not None):
            raise ValueError(f"start: stands in place of {(stated or ['covariance'])[0]}; leave that out")
        if self.covariance is None:
            self._warn_of_units("position_sigma_m", "velocity_sigma_m_s")
            return self
        if any(self.position_sigma_m) or any(self.velocity_sigma_m_s):
            raise ValueError("covariance: stands in place of position_sigma_m and velocity_sigma_m_s; leave these out")
        matrix = np.array(self.covariance)
        scale = np.sqrt(np.abs(np.diag(matrix)))
        unit = matrix / np.where(np.outer(scale, scale) > 0.0, np.outer(scale, scale), 1.0)
        if np.abs(unit - unit.T).max() > _ROUNDING:
            raise ValueError("covariance: is not symmetric; give the same number on both sides of the diagonal")
        if np.linalg.eigvalsh(unit).min() < -_ROUNDING * 6 or np.abs(matrix[scale == 0.0]).max(initial=0.0) > 0.0:
            raise ValueError("covariance: is not positive semidefinite, so it is no covariance; correct it")
        self._warn_of_units("covariance", "covariance")
        return self

    def _warn_of_units(self, position: str, velocity: str) -> None:
        """Warn of standard deviations that no mission has, which look like another unit."""
        sigma = np.sqrt(np.diag(self.start_covariance))
        place_m, speed_m_s = float(sigma[:3].max()), float(sigma[3:].max())
        if speed_m_s > _MOST_M_S:
            warn(
                f"{velocity}: a sigma of {speed_m_s:g} m/s is more than the {_MOST_M_S:g} m/s of a lost object; as "
                f"mm/s it would be {speed_m_s / 1000.0:g} m/s; give m/s"
            )
        if place_m > _MOST_M:
            warn(
                f"{position}: a sigma of {place_m:g} m is more than the {_MOST_M:g} m of a lost object; as mm "
                f"it would be {place_m / 1000.0:g} m; give m"
            )
        if self.covariance is not None and 0.0 < place_m < _LEAST_M and 0.0 < speed_m_s < _LEAST_M_S:
            warn(
                f"covariance: sigmas of {place_m:g} m and {speed_m_s:g} m/s are less than those of precise "
                f"orbits; as km², km²/s and km²/s² they would be {1000.0 * place_m:g} m and {1000.0 * speed_m_s:g} m/s: "
                "multiply by 1e6"
            )

    @property
    def start_covariance(self) -> np.ndarray:
        """Covariance (6, 6) of the state at the start [m2, m2/s, m2/s2]."""
        if self.covariance is not None:
            return np.array(self.covariance)
        covariance: np.ndarray = np.diag(np.square((*self.position_sigma_m, *self.velocity_sigma_m_s)))
        return covariance


class TargetErrors(StateErrors):
    """Errors of the target's own state, in its own rtn axes, and of its attitude. `run` does not use them."""

    attitude_sigma_deg: Vector = Field(
        default=(0.0, 0.0, 0.0),
        description="Standard deviations of a constant rotation about the target's body axes x, y and z [deg].",
    )
    rate_sigma_deg_s: Vector = Field(
        default=(0.0, 0.0, 0.0),
        description=(
            "Standard deviations of a constant drift about the same axes, by which that rotation grows from `start_utc` "
            "on [deg/s]."
        ),
    )

    @model_validator(mode="after")
    def _are_deviations(self) -> Self:
        for key in ("attitude_sigma_deg", "rate_sigma_deg_s"):
            if min(getattr(self, key)) < 0.0:
                raise ValueError(f"{key}: a standard deviation is negative; give 0 or more")
        if max(self.attitude_sigma_deg) > MOST_ATTITUDE_DEG:
            raise ValueError(
                f"attitude_sigma_deg: {max(self.attitude_sigma_deg):g} is over {MOST_ATTITUDE_DEG:g}, where rotations about "
                "three axes are no longer independent; give less"
            )
        return self

    @property
    def has_attitude(self) -> bool:
        """Whether the attitude has errors."""
        return any(self.attitude_sigma_deg) or any(self.rate_sigma_deg_s)


class Dispersion(StateErrors):
    """Errors of the flights that `disperse` makes: normal, and independent from run to run. A run does not use them.

    Errors of burns and navigation are those of a `flown` motion, unless they are given here.
    """

    target: TargetErrors | None = Field(
        default=None,
        description="Errors of the target's own orbit and attitude, independent of those of the follower; none if omitted.",
    )
    thrusters: Thrusters | None = Field(
        default=None, description="Errors of burns. If omitted, those of the `flown` motion, else none."
    )
    navigation: AnyNavigation | None = Field(
        default=None,
        description="Navigation: `errors` or a `filter`. If omitted, that of the `flown` motion, else none.",
    )
    pointing: Literal["target", "navigation", "plan"] | None = Field(
        default=None,
        description=(
            "Where the lidar is pointed: at the target, wherever it is; where navigation takes it to be; or where the "
            "flight without errors would see it. If omitted, by navigation where that has errors, else at the target."
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
