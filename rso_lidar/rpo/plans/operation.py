"""Proximity operations in common: a plan about a chief, made once, checked against a keep-out sphere and limits."""

from __future__ import annotations

import datetime
import functools
from abc import abstractmethod
from typing import Any

import numpy as np
from pydantic import Field

from rso_lidar import units
from rso_lidar.errors import ScenarioError
from rso_lidar.orbit.epochs import Epochs
from rso_lidar.orbit.trajectory import Trajectory
from rso_lidar.part import NotNegative
from rso_lidar.rpo.limits import FASTEST_M_S, LONGEST_S, format_years
from rso_lidar.rpo.plans.plan import Plan
from rso_lidar.rpo.relative import hill
from rso_lidar.rpo.relative.relative_motion import RelativeMotion

_LOOKS = 5  # samples of a leg for its greatest distance and speed
# Keys that set the pace of a plan, the most direct first
_PACE = ("times_s", "duration_s", "speed_m_s", "hops", "rate_deg_s", "period_s", "loops", "radial_m", "position_m")


class ProximityOperation(RelativeMotion):
    """An operation about the body `relative_to`, planned by Clohessy-Wiltshire in its rtn axes from `start_utc` on.

    It is good for near-circular chiefs and short distances. The error is up to 6 pi rho^2 / r per revolution of free
    flight, and up to 30 e rho (see `Hill`). In low orbit J2 moves a free body by up to 4.5 % of the separation per
    revolution. `validity` reports where that matters.
    """

    keep_out_m: NotNegative = Field(
        default=0.0,
        description="Radius of a sphere about the body's origin that the path may not enter [m]; 0 disables the check.",
    )

    @property
    def name(self) -> str:
        """Name of the operation: its `type`."""
        return str(type(self).model_fields["type"].default)

    @abstractmethod
    def make_plan(self, mean_motion_rad_s: float) -> Plan:
        """Make the plan, without checks.

        Parameters
        ----------
        mean_motion_rad_s : mean motion of the body that is approached [rad/s]

        Returns
        -------
        the plan in rtn axes of that body, from time 0
        """

    def plan(self, start_utc: datetime.datetime, chief: Trajectory) -> Plan:
        """Return the plan: legs, impulses, costs and safety.

        Parameters
        ----------
        start_utc : start of the plan
        chief : trajectory of the chief

        Raises
        ------
        ScenarioError
            if the plan cannot be carried out, exceeds a limit, or enters the keep-out sphere
        """
        return _make_checked_plan(self, hill.find_mean_motion_rad_s(chief, start_utc))

    def relative(self, epochs: Epochs, chief: Trajectory) -> tuple[np.ndarray, np.ndarray]:
        """Return position [m] and velocity [m/s] (time, 3) in the chief's rotating rtn axes.

        Parameters
        ----------
        epochs : instants
        chief : trajectory of the chief

        Raises
        ------
        ScenarioError
            if the path enters the keep-out sphere at an epoch
        """
        position, velocity = self.plan(epochs.start_utc, chief).relative(epochs.time_s)
        distance = np.sqrt(np.sum(position * position, axis=1))
        if len(distance) and distance.min() < self.keep_out_m:
            k = int(np.argmin(distance))
            raise _keep_out_error(self.keep_out_m, float(distance[k]), float(epochs.time_s[k]), position[k])
        return position, velocity

    def breaks_s(self, epochs: Epochs, chief: Trajectory) -> np.ndarray:
        """Return the instants at which the legs of the plan begin."""
        return np.array([leg.begin_s for leg in self.plan(epochs.start_utc, chief).legs])

    def validity(self, epochs: Epochs, chief: Trajectory) -> list[str]:
        """Return one sentence for each limit of Clohessy-Wiltshire's equations that these epochs exceed.

        Parameters
        ----------
        epochs : instants
        chief : trajectory of the chief
        """
        position, _ = self.relative(epochs, chief)
        sentences = hill.describe_validity(
            position,
            *hill.find_start_state(chief, epochs.start_utc),
            better="use lambert, or nonlinear from the plan's state",
        )
        named = [f"{self.name}: {sentence.removeprefix('hill: ')}" for sentence in sentences]
        return named + self.describe_flattening(epochs, chief)

    def describe_flattening(self, epochs: Epochs, chief: Trajectory) -> list[str]:
        """Report how far J2 moves the body in its free flight. Thrust along a path compensates it.

        Parameters
        ----------
        epochs : instants
        chief : trajectory of the chief

        Returns
        -------
        one sentence; empty if the effect is small
        """
        free_s = self.plan(epochs.start_utc, chief).free_s(epochs.time_s)
        return hill.describe_flattening(
            self.name,
            Epochs(epochs.start_utc, np.array([free_s])),
            *hill.find_start_state(chief, epochs.start_utc),
            better="use relative_elements, or nonlinear with forces, from the plan's state",
        )


@functools.lru_cache(maxsize=128)
def _make_checked_plan(operation: ProximityOperation, mean_motion_rad_s: float) -> Plan:
    check_lengths(operation, mean_motion_rad_s)
    return check_keep_out(check_plan(operation.make_plan(mean_motion_rad_s), operation), operation.keep_out_m)


def check_keep_out(plan: Plan, keep_out_m: float) -> Plan:
    """Check that a plan does not enter a sphere about the body's origin [m], and return it; else raise `ScenarioError`."""
    if keep_out_m > 0.0:
        nearest_m, at_s = plan.nearest()
        if nearest_m < keep_out_m:
            raise _keep_out_error(keep_out_m, nearest_m, at_s, plan.relative(np.array([at_s]))[0][0])
    return plan


def _keep_out_error(keep_out_m: float, nearest_m: float, at_s: float, position_m: np.ndarray) -> ScenarioError:
    """Make the error of a path that enters the keep-out sphere.

    Parameters
    ----------
    keep_out_m : radius of the sphere [m]
    nearest_m : distance from the body [m]
    at_s : time of the plan [s]
    position_m : position (3,) in rtn axes [m]

    Returns
    -------
    the error
    """
    where = ", ".join(f"{part:.4g}" for part in position_m)
    return ScenarioError(
        f"keep_out_m: at {at_s:.1f} s the path is {nearest_m:.4g} m from the body ({where} m in rtn), inside the sphere of "
        f"{keep_out_m:g} m: go round it, end farther out, or make the sphere smaller"
    )


def check_lengths(operation: Any, mean_motion_rad_s: float) -> None:
    """Check that lengths of an operation are within the radius of the body's orbit; beyond, its rtn axes have no meaning."""
    radius_m = float(np.cbrt(units.EARTH_GM_M3_S2 / mean_motion_rad_s**2))
    for name in type(operation).model_fields:
        if not name.endswith("_m") or name == "keep_out_m" or getattr(operation, name) is None:
            continue
        rows = np.array(getattr(operation, name), dtype=float)
        sizes_m = np.abs(rows) if rows.ndim == 0 else np.sqrt(np.sum(rows * rows, axis=-1))
        if np.any(sizes_m > radius_m):
            at = f"{name}[{int(np.argmax(sizes_m > radius_m))}]" if rows.ndim == 2 else name
            raise ScenarioError(
                f"{at}: {float(sizes_m.max()) / units.KM:.4g} km is farther than the body is from the Earth's centre, "
                f"{radius_m / units.KM:.0f} km, where Clohessy-Wiltshire does not apply: come nearer, or use lambert"
            )


def check_plan(plan: Plan, operation: Any, *, far: bool = False) -> Plan:
    """Check that a plan is not too long, too fast or too far, and return it.

    Parameters
    ----------
    plan : the plan
    operation : the part it was made from
    far : whether it may go beyond the radius of the body's orbit

    Returns
    -------
    the same plan

    Raises
    ------
    ScenarioError
        if the plan exceeds a limit; the message names the key that sets its pace
    """
    given = type(operation).model_fields
    key = next((name for name in _PACE if name in given and getattr(operation, name) is not None), plan.name)
    if not plan.duration_s <= LONGEST_S:
        raise ScenarioError(
            f"{key}: the plan takes {format_years(plan.duration_s)} years, and plans are for up to "
            f"{format_years(LONGEST_S)}: give a shorter time"
        )
    speeds_m_s, places_m = [impulse.size_m_s for impulse in plan.impulses], [0.0]
    for leg, begin_s, end_s in plan.stretches():
        position, velocity = leg.path(np.linspace(0.0, end_s - begin_s, _LOOKS))
        speeds_m_s.append(float(np.sqrt(np.sum(velocity * velocity, axis=1).max())))
        places_m.append(float(np.sqrt(np.sum(position * position, axis=1).max())))
    if not max(speeds_m_s) <= FASTEST_M_S:
        raise ScenarioError(
            f"{key}: the plan needs {max(speeds_m_s):.3g} m/s, faster than bodies pass each other near the Earth, at most "
            f"{FASTEST_M_S:g} m/s: give a longer time or a shorter way"
        )
    radius_m = float(np.cbrt(units.EARTH_GM_M3_S2 / plan.mean_motion_rad_s**2))
    if not far and not max(places_m) <= radius_m:
        raise ScenarioError(
            f"{key}: the plan leads {max(places_m) / units.KM:.4g} km away, farther than the body is from the Earth's "
            f"centre, {radius_m / units.KM:.0f} km, where Clohessy-Wiltshire does not apply: plan a shorter time, or use "
            "lambert"
        )
    return plan
