"""Thrust that holds the legs of a plan, and what its errors do to a flight."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np

from rso_lidar import units
from rso_lidar.orbit import rotate_to_inertial
from rso_lidar.rpo.flown.thrusters import HELD_LEGS, Thrusters, make_generator
from rso_lidar.rpo.navigation.filter_bank import apply_matrix
from rso_lidar.rpo.plans.plan import Plan
from rso_lidar.rpo.relative.deviation_flow import Push

Axes = Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]


@dataclass(frozen=True, eq=False)
class HeldThrust:
    """Thrust that holds a leg of a plan, with its errors.

    Parameters
    ----------
    plan : the plan
    from_s, until_s : span of the leg [s]
    factor : (3, 3) by which the errors change the thrust
    number : of the leg, by which its errors are drawn
    """

    plan: Plan
    from_s: float
    until_s: float
    factor: np.ndarray
    number: int
    axes: Literal["chief_rtn"] = "chief_rtn"

    @property
    def edges_s(self) -> tuple[float, ...]:
        """Instants at which the acceleration is discontinuous [s]."""
        return self.from_s, self.until_s

    def acceleration(self, time_s: float, r: list[float], v: list[float]) -> tuple[float, float, float]:
        """Return the acceleration [m/s2] in inertial axes.

        Parameters
        ----------
        time_s : seconds since the start of the plan
        r, v : position [m] and velocity [m/s] of the chief
        """
        inside_s = min(time_s, math.nextafter(self.until_s, -math.inf))
        push = self.factor @ self.plan.control_m_s2(np.array([inside_s]))[0]
        x, y, z = push.tolist()
        return rotate_to_inertial((x, y, z), self.axes, r, v)


class HeldThrustErrors:
    """Errors of held thrust at the stages of an integrator, in inertial axes, to first order.

    Parameters
    ----------
    stage_s : (stage,) instants [s]
    find_axes : function of instants that returns the rtn axes of the body approached, as columns (stage, 3, 3) in inertial
        axes, and their angular velocity
    control_m_s2 : function of instants that returns the thrust (stage, 3) [m/s2] in those axes
    thrusters : whose proportional errors act
    """

    def __init__(
        self,
        stage_s: np.ndarray,
        find_axes: Axes,
        control_m_s2: Callable[[np.ndarray], np.ndarray],
        thrusters: Thrusters,
    ) -> None:
        self._thrusters = thrusters
        axes, _ = find_axes(stage_s)
        control = control_m_s2(stage_s)
        self._thrust = np.einsum("tij,tj->ti", axes, control)
        x, y, z = control.T
        zero = np.zeros_like(x)
        crossed = np.array([[zero, z, -y], [-z, zero, x], [y, -x, zero]]).transpose(2, 0, 1)  # p x a = crossed @ p
        self._turned = np.einsum("tij,tjk->tik", axes, crossed)

    def make_push(self, numbers: np.ndarray) -> Push:
        """Return the error of the thrust: proportional, and turned.

        Parameters
        ----------
        numbers : (4, n) standard normal: size, and turns about three axes
        """
        size = self._thrusters.magnitude_sigma_fraction * numbers[0]
        turn = self._thrusters.pointing_sigma_deg * units.DEG * numbers[1:]
        return lambda stage: self._thrust[stage][:, None] * size + apply_matrix(self._turned[stage], turn)

    def stop(self) -> Push:
        """Return what is missing without thrust."""
        return lambda stage: -self._thrust[stage][:, None]


def hold_legs(plan: Plan, thrusters: Thrusters, seed: int) -> list[HeldThrust]:
    """Return the thrust that holds the legs of a plan, the last one without end."""
    ends = [*(leg.begin_s for leg in plan.legs[1:]), math.inf]
    return [
        HeldThrust(plan, leg.begin_s, end_s, thrusters.draw_factor(make_generator(seed, HELD_LEGS, number)), number)
        for number, (leg, end_s) in enumerate(zip(plan.legs, ends, strict=True))
        if leg.acceleration_m_s2 is not None and end_s > leg.begin_s
    ]
