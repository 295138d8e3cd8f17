"""Drives of a pan-tilt unit: the response of its axes to their demand, from tick to tick.

First- and second-order drives are linear and solved exactly for a demand that is held over a tick. Where a limit
applies, the change of rate is clipped to the greatest acceleration, then the rate to the greatest rate. The angle is
integrated from the mean of old and new rate in `SecondOrder`, and from the new rate in `FirstOrder`. A drive stops at
the ends of its travel.
"""

from __future__ import annotations

import functools
import math
from abc import abstractmethod
from typing import Annotated, Any, ClassVar, Literal, Self

import numpy as np
from pydantic import Field, model_validator

from rso_lidar import units
from rso_lidar.kernels import kernel, packed
from rso_lidar.motion.dynamics.function import (
    Dynamics,
    Function,
    find_function,
    name_function,
    stamp_file,
    wrap_dynamics,
)
from rso_lidar.part import NotNegative, Number, Part, Positive

TICK_S = 1e-3  # the grid of all drives
Limits = tuple[Number, Number]
Pair = tuple[float, float]
State = tuple[tuple[Pair, Pair], tuple[Any, ...]]  # (angle, rate) of pan and of tilt, and further entries


class Travel(Part):
    """Base of all drives: the limits of pan and tilt."""

    # Longest run [s] for which a preview steps the drive, which then takes a second or two.
    preview_limit_s: ClassVar[float] = 4000.0

    pan_limits_deg: Limits | None = Field(
        default=None, description="Lower and upper limit of pan [deg]. If omitted, pan is unlimited."
    )
    tilt_limits_deg: Limits | None = Field(
        default=None, description="Lower and upper limit of tilt [deg]. If omitted, tilt is unlimited."
    )

    @model_validator(mode="after")
    def _check_order(self) -> Self:
        for name in ("pan_limits_deg", "tilt_limits_deg"):
            limits = getattr(self, name)
            if limits is not None and not limits[0] < limits[1]:
                raise ValueError(f"{name}: give the lower limit first, then the upper")
        return self

    @property
    def travel_rad(self) -> tuple[Limits, Limits]:
        """Lower and upper limits of pan and of tilt [rad], infinite by default."""
        pan, tilt = self.pan_limits_deg, self.tilt_limits_deg
        free = (-math.inf, math.inf)
        return (
            (pan[0] * units.DEG, pan[1] * units.DEG) if pan else free,
            (tilt[0] * units.DEG, tilt[1] * units.DEG) if tilt else free,
        )


class _Drive(Travel):
    """Base of linear drives: the limits of rate and acceleration."""

    max_rate_deg_s: Positive | None = Field(
        default=None, description="Greatest rate of each axis [deg/s]. If omitted, the rate is unlimited."
    )
    max_acceleration_deg_s2: Positive | None = Field(
        default=None,
        description="Greatest acceleration of each axis [deg/s²]. If omitted, the acceleration is unlimited.",
    )

    @property
    def max_rate_rad_s(self) -> float:
        """Greatest rate [rad/s], infinite by default."""
        return math.inf if self.max_rate_deg_s is None else self.max_rate_deg_s * units.DEG

    @property
    def max_acceleration_rad_s2(self) -> float:
        """Greatest acceleration [rad/s2], infinite by default."""
        return math.inf if self.max_acceleration_deg_s2 is None else self.max_acceleration_deg_s2 * units.DEG

    def limits(self, dt: float) -> Pair:
        """Return the greatest rate [rad/s], and its greatest change [rad/s] in a time step.

        Parameters
        ----------
        dt : time step [s]
        """
        return self.max_rate_rad_s, self.max_acceleration_rad_s2 * dt

    def advance(
        self, begin_s: float, dt: float, axes: tuple[Pair, Pair], further: tuple[Any, ...], held: np.ndarray
    ) -> State:
        """Advance both axes through demands that are held one after the other.

        Parameters
        ----------
        begin_s, dt, axes, held : as for `StateSpaceDrive.advance`
        further : returned as it is, because this drive has no further entries

        Returns
        -------
        (angle [rad], rate [rad/s]) of pan and of tilt after the last row, and `further`
        """
        rows = zip(self.travel_rad, axes, packed(held.T, float), strict=True)
        pan, tilt = (self._advance_axis(dt, travel, axis, demanded) for travel, axis, demanded in rows)
        return (pan, tilt), further

    @abstractmethod
    def _advance_axis(self, dt: float, travel: Limits, axis: Pair, demanded: np.ndarray) -> Pair:
        """Advance one axis, as `advance_first_order` does."""


class Ideal(Travel):
    """A drive that follows its demand without delay, within its travel."""

    preview_limit_s: ClassVar[float] = 0.0
    type: Literal["ideal"] = "ideal"


class FirstOrder(_Drive):
    """A drive with tau dx/dt + x = demand. `time_constant_s` is tau."""

    type: Literal["first_order"] = "first_order"
    time_constant_s: Positive = Field(description="Time constant τ [s].")

    def _advance_axis(self, dt: float, travel: Limits, axis: Pair, demanded: np.ndarray) -> Pair:
        law = self.time_constant_s, math.exp(-dt / self.time_constant_s)
        return advance_first_order(dt, law, self.limits(dt), travel, axis, demanded)


class SecondOrder(_Drive):
    """A drive with d2x/dt2 + 2 zeta w dx/dt + w^2 x = w^2 demand, w = 2 pi `natural_hz`, zeta = `damping`."""

    type: Literal["second_order"] = "second_order"
    natural_hz: Annotated[Positive, Field(le=1000)] = Field(description="Undamped natural frequency [Hz].")
    damping: Annotated[NotNegative, Field(le=100)] = Field(
        description="Damping ratio ζ. The drive lags a steady slew by ζ / (π natural_hz) seconds."
    )

    def _advance_axis(self, dt: float, travel: Limits, axis: Pair, demanded: np.ndarray) -> Pair:
        law = second_order_transition(2.0 * math.pi * self.natural_hz, self.damping, dt)
        return advance_second_order(dt, law, self.limits(dt), travel, axis, demanded)


class StateSpaceDrive(Travel):
    """A drive with user-defined dynamics x' = f(t, x, u) (Fuller et al., eq. 6), integrated by RK4 in steps of 1 ms.

    x begins with pan, tilt [rad] and their rates [rad/s]; `further_state` is the initial value of further entries. u is
    the demanded pan and tilt [rad]. `dynamics` is ``file.py:name``, ``package.module:name`` or a function.
    """

    preview_limit_s: ClassVar[float] = 60.0
    type: Literal["state_space"] = "state_space"
    dynamics: Dynamics = Field(
        description=(
            "Function x' = f(t, x, u), with x = pan, tilt [rad], their rates [rad/s] and further entries, and u = "
            "demanded pan and tilt [rad]."
        )
    )
    further_state: tuple[Number, ...] = Field(default=(), description="Further entries of x at `start_utc`.")

    @property
    def label(self) -> str:
        """Name of the dynamics in error messages."""
        return name_function(self.dynamics)

    def advance(
        self, begin_s: float, dt: float, axes: tuple[Pair, Pair], further: tuple[Any, ...], held: np.ndarray
    ) -> State:
        """Advance both axes through demands that are held one after the other.

        Parameters
        ----------
        begin_s : instant of the first row [s]
        dt : how long each row is held [s]
        axes : (angle [rad], rate [rad/s]) of pan and of tilt at `begin_s`
        further : further entries of the state at `begin_s`
        held : demanded pan and tilt (tick, 2) [rad]

        Returns
        -------
        (angle [rad], rate [rad/s]) of pan and of tilt after the last row, and the further entries of the state
        """
        f = _function(self, stamp_file(self.dynamics))
        (pan, pan_rate), (tilt, tilt_rate) = axes
        x, ends = np.array([pan, tilt, pan_rate, tilt_rate, *further]), self.travel_rad
        for tick, u in enumerate(held):
            t = begin_s + tick * dt
            k1 = f(t, x, u)
            k2 = f(t + 0.5 * dt, x + 0.5 * dt * k1, u)
            k3 = f(t + 0.5 * dt, x + 0.5 * dt * k2, u)
            x = x + dt / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + f(t + dt, x + dt * k3, u))
            for axis, (low, high) in enumerate(ends):
                if not low <= x[axis] <= high:
                    x[axis], x[axis + 2] = (low if x[axis] < low else high), 0.0
        pan, tilt, pan_rate, tilt_rate, *more = x.tolist()
        return ((pan, pan_rate), (tilt, tilt_rate)), tuple(more)


@functools.lru_cache(maxsize=16)
def _function(drive: StateSpaceDrive, _stamp: tuple[int, int]) -> Function:
    return wrap_dynamics(find_function(drive.dynamics), drive.label, 4 + len(drive.further_state))


@kernel
def advance_first_order(dt: float, law: Pair, limits: Pair, travel: Pair, axis: Pair, demanded: np.ndarray) -> Pair:
    """Advance one axis of a first-order drive through demands that are held one after the other.

    Parameters
    ----------
    dt : how long each demand is held [s]
    law : tau [s] and exp(-dt / tau)
    limits : greatest rate [rad/s], and greatest change of it in `dt` [rad/s]
    travel : lower and upper end of the axis [rad]
    axis : angle [rad] and rate [rad/s] at the start
    demanded : demands (tick) f8 [rad]

    Returns
    -------
    angle [rad] and rate [rad/s] after the last demand
    """
    (x, v), (low, high), (most, change), (tau, decay) = axis, travel, limits, law
    step = most * dt
    for d in demanded:
        new = d + decay * (x - d)
        rate = (d - new) / tau
        if -change <= rate - v <= change and -step <= new - x <= step:
            x, v = new, rate
        else:
            v = max(-most, min(most, max(v - change, min(v + change, rate))))
            x += v * dt
        if not low <= x <= high:
            x, v = (low if x < low else high), 0.0
    return x, v


@kernel
def advance_second_order(
    dt: float,
    law: tuple[float, float, float, float],
    limits: Pair,
    travel: Pair,
    axis: Pair,
    demanded: np.ndarray,
) -> Pair:
    """Advance one axis of a second-order drive through demands that are held one after the other.

    Parameters
    ----------
    law : transition matrix over `dt`, by rows
    dt, limits, travel, axis, demanded : as for `advance_first_order`
    """
    (x, v), (low, high), (most, change), (xx, xv, vx, vv) = axis, travel, limits, law
    for d in demanded:
        error = x - d
        new = vx * error + vv * v
        if -change <= new - v <= change and -most <= new <= most:
            x, v = d + xx * error + xv * v, new
        else:
            new = max(-most, min(most, max(v - change, min(v + change, new))))
            x += 0.5 * (v + new) * dt
            v = new
        if not low <= x <= high:
            x, v = (low if x < low else high), 0.0
    return x, v


def second_order_transition(natural: float, damping: float, dt: float) -> tuple[float, float, float, float]:
    """Compute the matrix exponential of ((0, 1), (-w^2, -2 zeta w)) dt, by rows.

    Parameters
    ----------
    natural : undamped natural angular frequency w [rad/s]
    damping : damping ratio zeta
    dt : time step [s]

    Returns
    -------
    matrix by rows: new angle from angle and rate [s], then new rate from angle [1/s] and rate
    """
    sigma = damping * natural
    phase = natural * natural * (1.0 - damping) * (1.0 + damping)
    if phase >= 0.0:
        root = math.sqrt(phase)
        cosine, sine = math.cos(root * dt), math.sin(root * dt) / root if root else dt
        fading = math.exp(-sigma * dt)
    else:  # overdamped: factor out the slow exponential, so that nothing overflows
        root = math.sqrt(-phase)
        lost = -math.expm1(-2.0 * root * dt)
        cosine, sine = 1.0 - 0.5 * lost, 0.5 * lost / root
        fading = math.exp(-natural * natural / (sigma + root) * dt)
    return (
        fading * (cosine + sigma * sine),
        fading * sine,
        -fading * natural * natural * sine,
        fading * (cosine - sigma * sine),
    )
