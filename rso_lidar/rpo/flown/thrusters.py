"""Thrusters that carry out the impulses of a plan: burns of finite duration, and their errors.

The random errors are those of Gates (1963, "A simplified model of midcourse maneuver execution errors", JPL TR 32-504):
fixed and proportional parts of magnitude and pointing, all normal and independent for each burn.
"""

from __future__ import annotations

import math
from typing import Literal, Self

import numpy as np
from pydantic import Field, model_validator

from rso_lidar import units
from rso_lidar.orbit import Burn, Impulse
from rso_lidar.part import NotNegative, Number, Part, Positive, Vector

IMPULSES, HELD_LEGS, NAVIGATION, MEASUREMENTS = 0, 1, 2, 3  # what a random number is for
_LEAST_M_S = 1e-9  # smaller changes of velocity are not carried out


class Thrusters(Part):
    """Thrusters of a craft that flies a plan: how long burns last, and by how much they are off.

    Without `acceleration_m_s2` and `thrust_n` a change of velocity is an impulse. Otherwise it is a burn, centred on
    the instant of the impulse, but not before the flight begins or the correction is known. Burns keep their direction
    in the rtn axes of the body that is approached. A change of velocity too small for full thrust lasts as long as rise
    and fall, at less thrust. Thrust that holds a path follows its acceleration, with one draw of the proportional
    errors for each leg, and uses no propellant here.

    Random errors are those of Gates (1963): normal, independent for each burn, and repeatable, because they depend on
    the scenario's seed, the name of the body and the number of the burn only.
    """

    acceleration_m_s2: Positive | None = Field(
        default=None,
        description="Acceleration at full thrust [m/s²]; give at most one of this and `thrust_n`. Without both, impulses.",
    )
    thrust_n: Positive | None = Field(default=None, description="Full thrust [N], on `mass_kg`.")
    mass_kg: Positive | None = Field(default=None, description="Mass at the start of the flight [kg].")
    isp_s: Positive | None = Field(
        default=None,
        description="Specific impulse, by which the mass decreases from burn to burn [s]. If omitted, it is constant.",
    )
    rise_s: NotNegative = Field(default=0.0, description="Time in which thrust rises linearly [s].")
    fall_s: NotNegative = Field(default=0.0, description="Time in which thrust falls linearly [s].")
    magnitude_error_fraction: Number = Field(
        default=0.0, description="Constant error of every burn's magnitude, as a fraction: 0.01 gives 1 % too much."
    )
    misalignment_deg: Vector = Field(
        default=(0.0, 0.0, 0.0),
        description=(
            "Constant misalignment of every burn: rotation vector in the rtn axes of the body that is approached [deg]."
        ),
    )
    magnitude_sigma_fraction: NotNegative = Field(
        default=0.0, description="Standard deviation of a burn's magnitude, as a fraction of it."
    )
    magnitude_sigma_m_s: NotNegative = Field(
        default=0.0, description="Standard deviation of a burn's magnitude that does not depend on it [m/s]."
    )
    pointing_sigma_deg: NotNegative = Field(
        default=0.0, description="Standard deviation of a burn's direction about each of two axes across it [deg]."
    )
    pointing_sigma_m_s: NotNegative = Field(
        default=0.0,
        description="Standard deviation of the velocity along each of two axes across a burn, whatever its size [m/s].",
    )

    @model_validator(mode="after")
    def _one_push(self) -> Self:
        if self.acceleration_m_s2 is not None and self.thrust_n is not None:
            raise ValueError("needs at most one of acceleration_m_s2 and thrust_n; leave one out")
        if (self.thrust_n is None) != (self.mass_kg is None):
            raise ValueError("mass_kg: belongs to thrust_n; give both, or neither")
        if self.isp_s is not None and self.thrust_n is None:
            raise ValueError("isp_s: belongs to thrust_n and mass_kg; give those, or leave it out")
        if (self.rise_s > 0.0 or self.fall_s > 0.0) and self.acceleration_m_s2 is None and self.thrust_n is None:
            raise ValueError(
                "rise_s: an impulse has no rise and no fall; give acceleration_m_s2 or thrust_n, or leave out rise_s, fall_s"
            )
        if self.magnitude_error_fraction <= -1.0:
            raise ValueError("magnitude_error_fraction: at -1 and below no thrust is left; give more than -1")
        return self

    def disturb(self, delta_v_m_s: np.ndarray, draw: np.random.Generator) -> np.ndarray:
        """Return a change of velocity (3,) [m/s] as it is carried out, with one draw of the errors.

        Parameters
        ----------
        delta_v_m_s : (3,) as commanded [m/s], in rtn axes
        draw : generator of this burn
        """
        size = float(np.linalg.norm(delta_v_m_s))
        if size < _LEAST_M_S:
            return np.array(delta_v_m_s, dtype=float)
        along = delta_v_m_s / size
        done = self.draw_factor(draw) @ delta_v_m_s
        fixed = draw.standard_normal(4)
        across = fixed[1:] - (fixed[1:] @ along) * along
        errors = fixed[0] * self.magnitude_sigma_m_s * along + self.pointing_sigma_m_s * across
        return np.asarray(done + errors, dtype=float)

    def draw_factor(self, draw: np.random.Generator) -> np.ndarray:
        """Return the matrix (3, 3) by which the constant and the proportional errors change a thrust, with one draw.

        Parameters
        ----------
        draw : generator of this burn or leg
        """
        from scipy.spatial.transform import Rotation

        numbers = draw.standard_normal(4)
        size = 1.0 + self.magnitude_error_fraction + self.magnitude_sigma_fraction * numbers[0]
        # a rotation about the thrust itself has no effect: two axes across it are left
        turned = Rotation.from_rotvec(self.pointing_sigma_deg * units.DEG * numbers[1:])
        matrix: np.ndarray = (
            size * (Rotation.from_rotvec(np.array(self.misalignment_deg) * units.DEG) * turned).as_matrix()
        )
        return matrix

    @property
    def mean_factor(self) -> np.ndarray:
        """Matrix (3, 3) by which the constant errors change a thrust."""
        from scipy.spatial.transform import Rotation

        turned = Rotation.from_rotvec(np.array(self.misalignment_deg) * units.DEG).as_matrix()
        factor: np.ndarray = (1.0 + self.magnitude_error_fraction) * turned
        return factor

    def find_covariance(self, square: np.ndarray) -> np.ndarray:
        """Return the covariance (3, 3, …) of a burn's random errors [m2/s2], to first order.

        Parameters
        ----------
        square : (3, 3, …) the command times itself, or the mean of that [m2/s2]
        """
        total = square[0, 0] + square[1, 1] + square[2, 2]
        wide = (slice(None), slice(None), *(None,) * (square.ndim - 2))
        unit = np.eye(3)[wide]
        along = square / np.where(total > 0.0, total, 1.0)
        proportional = self.magnitude_sigma_fraction**2 * square
        proportional = proportional + (self.pointing_sigma_deg * units.DEG) ** 2 * (total * unit - square)
        fixed = self.magnitude_sigma_m_s**2 * along + self.pointing_sigma_m_s**2 * (unit - along)
        covariance: np.ndarray = np.where(total > 0.0, proportional + fixed, proportional)
        return covariance

    def spend(self, mass_kg: float, delta_v_m_s: float) -> float:
        """Return the mass after a change of velocity [kg], by Tsiolkovsky's equation.

        Parameters
        ----------
        mass_kg : mass before [kg]
        delta_v_m_s : size of the change [m/s]
        """
        if self.isp_s is None:
            return mass_kg
        return mass_kg * math.exp(-delta_v_m_s / (units.STANDARD_GRAVITY_M_S2 * self.isp_s))

    def find_duration_s(self, delta_v_m_s: float, mass_kg: float) -> float:
        """Return how long a burn lasts [s], 0 for an impulse.

        Parameters
        ----------
        delta_v_m_s : size of the change of velocity [m/s]
        mass_kg : mass before [kg]; not used where `acceleration_m_s2` is given
        """
        full_s = self._find_full_thrust_s(delta_v_m_s, mass_kg)
        return full_s and max(full_s + 0.5 * (self.rise_s + self.fall_s), self.rise_s + self.fall_s)

    def make_maneuver(self, begin_s: float, delta_v_m_s: np.ndarray, mass_kg: float) -> Impulse | Burn | None:
        """Return the impulse or burn of a change of velocity; None for one that is too small to be carried out.

        Parameters
        ----------
        begin_s : when it begins [s]
        delta_v_m_s : (3,) [m/s], in the rtn axes of the body that is approached
        mass_kg : mass before [kg]
        """
        size = float(np.linalg.norm(delta_v_m_s))
        if size < _LEAST_M_S:
            return None
        full_s, duration_s = self._find_full_thrust_s(size, mass_kg), self.find_duration_s(size, mass_kg)
        if duration_s == 0.0:
            return Impulse(at_s=begin_s, delta_v_m_s=tuple(delta_v_m_s.tolist()), axes="chief_rtn")
        share = full_s / (duration_s - 0.5 * (self.rise_s + self.fall_s))  # of full thrust, below 1 for a short pulse
        times = {"from_s": begin_s, "duration_s": duration_s, "rise_s": self.rise_s, "fall_s": self.fall_s}
        if self.acceleration_m_s2 is not None:
            push = delta_v_m_s / size * (self.acceleration_m_s2 * share)
            return Burn(acceleration_m_s2=tuple(push.tolist()), axes="chief_rtn", **times)
        assert self.thrust_n is not None
        push = delta_v_m_s / size * (self.thrust_n * share)
        return Burn(thrust_n=tuple(push.tolist()), mass_kg=mass_kg, isp_s=self.isp_s, axes="chief_rtn", **times)

    def _find_full_thrust_s(self, delta_v_m_s: float, mass_kg: float) -> float:
        """Return the time at full thrust that gives a change of velocity of this size [s], 0 for an impulse."""
        if self.acceleration_m_s2 is not None:
            return delta_v_m_s / self.acceleration_m_s2
        if self.thrust_n is None:
            return 0.0
        if self.isp_s is None:
            return delta_v_m_s * mass_kg / self.thrust_n
        flow_kg_s = self.thrust_n / (units.STANDARD_GRAVITY_M_S2 * self.isp_s)
        return (mass_kg - self.spend(mass_kg, delta_v_m_s)) / flow_kg_s


class NavigationErrors(Part):
    """Errors of the relative state that guidance is given: normal, independent for each fix and each axis."""

    type: Literal["errors"] = "errors"

    position_sigma_m: NotNegative = Field(
        default=0.0, description="Standard deviation of each component of the relative position [m]."
    )
    velocity_sigma_m_s: NotNegative = Field(
        default=0.0, description="Standard deviation of each component of the relative velocity [m/s]."
    )

    @property
    def sigma(self) -> np.ndarray:
        """Standard deviations (6,) of position [m] and velocity [m/s]."""
        return np.array([self.position_sigma_m] * 3 + [self.velocity_sigma_m_s] * 3)

    def disturb(self, state: tuple[np.ndarray, np.ndarray], draw: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
        """Return position [m] and velocity [m/s] (3,) as they are known.

        Parameters
        ----------
        state : true position [m] and velocity [m/s], each (3,)
        draw : generator of this fix
        """
        numbers = draw.standard_normal((2, 3))
        return state[0] + self.position_sigma_m * numbers[0], state[1] + self.velocity_sigma_m_s * numbers[1]


def make_generator(seed: int, use: int, number: int) -> np.random.Generator:
    """Return the counter-based generator of one burn, held leg, fix or measurement, by its `use`, such as `IMPULSES`."""
    return np.random.Generator(np.random.Philox(np.random.SeedSequence(seed, spawn_key=(use, number))))
