"""Errors that disperse the flights of a mission: of both starts, the burns, navigation, attitude, pointing and the laser."""

from __future__ import annotations

from typing import Annotated, Literal, Self

import numpy as np
from pydantic import Field, model_validator

from rso_lidar.errors import ScenarioError, warn
from rso_lidar.orbit import check_covariances, describe_unlikely_units
from rso_lidar.part import Flag, NotNegative, Number, Part, Positive, Text, Vector, Whole
from rso_lidar.rpo import AnyNavigation, Thrusters

Row = tuple[Number, Number, Number, Number, Number, Number]
MOST_ATTITUDE_DEG = 30.0


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


class CovarianceErrors(Part):
    """Covariance of an object's state from a CCSDS message or a fit, or by its terms, in any named axes.

    An OEM has covariances over time, of which the one at `start_utc` is used; an OPM and a CDM have one at their epoch. See
    `rl.orbit.read_covariances`.
    """

    type: Literal["covariance"] = "covariance"
    file: Text | None = Field(
        default=None, description="Path of an OEM, OPM or CDM (KVN or XML); exactly one of this and `matrix`."
    )
    object: Text | None = Field(
        default=None,
        description="Name or identifier of the object, of a CDM also OBJECT1 or OBJECT2, where the file has several.",
    )
    propagate: Flag = Field(
        default=False,
        description=(
            "Whether a covariance of another epoch than `start_utc`, before the first or after the last of the file, is "
            "propagated by two-body motion without process noise, which understates it. If false, that is an error."
        ),
    )
    earth_orientation_file: Text | None = Field(
        default=None, description="Path of the IERS file finals2000A.all, for a file in ITRF."
    )
    matrix: tuple[Row, Row, Row, Row, Row, Row] | None = Field(
        default=None, description="The covariance at `start_utc` by its terms [m², m²/s, m²/s²], in place of a file."
    )
    axes: Literal["rtn", "tnw", "ntw", "vnc", "lvlh_ccsds", "gcrs", "eme2000", "mod", "tod", "teme", "itrs"] = Field(
        default="rtn", description="Axes of `matrix`: of the body's own orbit, or of the Earth."
    )
    rotating: Flag = Field(
        default=False,
        description=(
            "Whether the velocities of `matrix` are relative to axes of the orbit as they turn, rather than to inertial "
            "axes."
        ),
    )

    @model_validator(mode="after")
    def _one_source(self) -> Self:
        if (self.file is None) == (self.matrix is None):
            raise ValueError("needs exactly one of file and matrix; give one of them")
        if self.matrix is None:
            if self.axes != "rtn" or self.rotating:
                raise ValueError("axes, rotating: are those of matrix; a file states its own, so leave them out")
            return self
        stated = [key for key in ("object", "propagate", "earth_orientation_file") if getattr(self, key)]
        if stated:
            raise ValueError(f"{stated[0]}: goes with file, not with matrix; leave it out")
        check_covariances(np.array(self.matrix), "matrix")
        return self


OtherStart = Annotated[ElementSetErrors | CovarianceErrors, Field(discriminator="type")]


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
    start: OtherStart | None = Field(
        default=None,
        description=(
            "Errors that a file states, by their type, in place of the standard deviations and `covariance`: those of its "
            "element sets, or a covariance."
        ),
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
            for key, part in (("position_sigma_m", slice(0, 3)), ("velocity_sigma_m_s", slice(3, 6))):
                alone = np.zeros((6, 6))
                alone[part, part] = self.start_covariance[part, part]
                _warn_of_units(key, describe_unlikely_units(alone, "m", "smaller"))
            return self
        if any(self.position_sigma_m) or any(self.velocity_sigma_m_s):
            raise ValueError("covariance: stands in place of position_sigma_m and velocity_sigma_m_s; leave these out")
        check_covariances(np.array(self.covariance), "covariance")
        is_known = not np.any(np.diag(self.start_covariance)[3:])  # the velocity, so that there are no precise orbits
        _warn_of_units(
            "covariance", describe_unlikely_units(self.start_covariance, "m", "smaller" if is_known else "both")
        )
        return self

    @property
    def start_covariance(self) -> np.ndarray:
        """Covariance (6, 6) of the state at the start [m2, m2/s, m2/s2]."""
        if self.covariance is not None:
            given = np.array(self.covariance)
            symmetric: np.ndarray = 0.5 * (given + given.T)  # its digits may differ by their rounding
            return symmetric
        covariance: np.ndarray = np.diag(np.square((*self.position_sigma_m, *self.velocity_sigma_m_s)))
        return covariance


def _warn_of_units(key: str, slip: str) -> None:
    if slip:
        warn(f"{key}: {slip}")


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
        description="Errors of the target's own orbit and attitude; none if omitted.",
    )
    relative_to_target: Flag = Field(
        default=False,
        description=(
            "Whether the errors of the start are those of the state relative to the target, as a fit of ranges and "
            "directions states them. The target's own errors then move both bodies. If false, they are those of the "
            "follower's own state."
        ),
    )
    cross_covariance: tuple[Row, Row, Row, Row, Row, Row] | None = Field(
        default=None,
        description=(
            "Covariance at `start_utc` of the follower's position and velocity (rows) with the target's (columns), both in "
            "the rotating rtn axes of the target [m², m²/s, m²/s²]. If omitted, the errors of the two are independent."
        ),
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

    @model_validator(mode="after")
    def _is_joint(self) -> Self:
        if self.cross_covariance is None:
            return self
        if self.relative_to_target:
            raise ValueError("cross_covariance: relative_to_target states how errors are shared, too; give one of them")
        if self.target is None:
            raise ValueError("cross_covariance: is with errors of the target, which has none; add them as target")
        if self.start is None and self.target.start is None:  # else it is checked when the files have been read
            cross = np.array(self.cross_covariance)
            own, other = self.start_covariance, self.target.start_covariance
            try:
                check_covariances(np.block([[own, cross], [cross.T, other]]), "cross_covariance")
            except ScenarioError:
                raise ValueError(
                    "cross_covariance: is more than the errors of follower and target allow, so that both together have no "
                    "distribution; correct its terms"
                ) from None
        return self
