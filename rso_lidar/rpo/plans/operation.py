"""Proximity operations in common: a plan about a chief, made once, checked against a keep-out sphere and limits."""

from __future__ import annotations

import datetime
import functools
from abc import abstractmethod
from typing import Annotated, Any, ClassVar

import numpy as np
from pydantic import Field

from rso_lidar import units
from rso_lidar.errors import ScenarioError
from rso_lidar.orbit import EARTH, CentralBody, Epochs, Trajectory, find_center
from rso_lidar.part import Direction, NotNegative, Positive
from rso_lidar.records import BodyState
from rso_lidar.rpo.limits import FASTEST_M_S, LONGEST_S, format_years
from rso_lidar.rpo.plans.keep_out import KeepOutSphere
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

    any_center: ClassVar[bool] = True
    keep_out_m: NotNegative = Field(
        default=0.0,
        description="Radius of a sphere about the body's origin that the path may not enter [m]; 0 disables the check.",
    )
    corridor_axis: Direction | None = Field(
        default=None,
        description=(
            "Centre line, from the body's origin outward in its rtn axes, of a cone through which the path may enter the "
            "keep-out sphere. If omitted, it may not enter."
        ),
    )
    corridor_half_angle_deg: Annotated[Positive, Field(lt=90)] = Field(
        default=10.0, description="Half angle of that cone [deg]."
    )

    @property
    def keep_out(self) -> KeepOutSphere:
        """Sphere that the path may not enter, with its corridor."""
        return KeepOutSphere(self.keep_out_m, self.corridor_axis, self.corridor_half_angle_deg)

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

    def make_plan_about(self, chief: BodyState) -> Plan:
        """Make the plan about a chief of which the state is known, without checks.

        Parameters
        ----------
        chief : its inertial state (3,) at the start of the plan

        Returns
        -------
        the plan in rtn axes of the chief, from time 0
        """
        return self.make_plan(hill.mean_motion_of_state(chief.position_m, chief.velocity_m_s))

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
        self.check_center(find_center(chief))
        return _make_checked_plan(self, hill.find_mean_motion_rad_s(chief, start_utc), find_center(chief))

    def relative(self, epochs: Epochs, chief: Trajectory) -> tuple[np.ndarray, np.ndarray]:
        """Return position [m] and velocity [m/s] (time, 3) in the chief's rotating rtn axes.

        Raises
        ------
        ScenarioError
            if the path enters the keep-out sphere at an epoch
        """
        position, velocity = self.plan(epochs.start_utc, chief).relative(epochs.time_s)
        self.check_positions(epochs, chief, position)
        return position, velocity

    def check_positions(self, epochs: Epochs, chief: Trajectory, position_m: np.ndarray) -> None:
        """Check that the path does not enter the keep-out sphere at some epochs; else raise `ScenarioError`.

        Parameters
        ----------
        epochs : instants
        chief : trajectory of the chief
        position_m : (time, 3) positions at the epochs in rtn axes [m]
        """
        self.keep_out.check_positions(epochs.time_s, position_m)

    def breaks_s(self, epochs: Epochs, chief: Trajectory) -> np.ndarray:
        """Return the instants at which the legs of the plan begin."""
        return np.array([leg.begin_s for leg in self.plan(epochs.start_utc, chief).legs])

    def validity(self, epochs: Epochs, chief: Trajectory) -> list[str]:
        """Return one sentence for each limit of Clohessy-Wiltshire's equations that these epochs exceed."""
        position, _ = self.relative(epochs, chief)
        sentences = hill.describe_validity(
            position,
            *hill.find_start_state(chief, epochs.start_utc),
            better="use lambert, or nonlinear from the plan's state",
            center=find_center(chief),
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
            center=find_center(chief),
        )


@functools.lru_cache(maxsize=128)
def _make_checked_plan(operation: ProximityOperation, mean_motion_rad_s: float, center: CentralBody) -> Plan:
    """Make a plan and check it."""
    check_lengths(operation, mean_motion_rad_s, center)
    return operation.keep_out.check(check_plan(operation.make_plan(mean_motion_rad_s), operation, center=center))


def check_lengths(operation: Any, mean_motion_rad_s: float, center: CentralBody = EARTH) -> None:
    """Check that lengths of an operation are within the radius of the body's orbit; beyond, its rtn axes have no meaning."""
    radius_m = float(np.cbrt(center.gm_m3_s2 / mean_motion_rad_s**2))
    for name in type(operation).model_fields:
        if not name.endswith("_m") or name == "keep_out_m" or getattr(operation, name) is None:
            continue
        rows = np.array(getattr(operation, name), dtype=float)
        sizes_m = np.abs(rows) if rows.ndim == 0 else np.sqrt(np.sum(rows * rows, axis=-1))
        if np.any(sizes_m > radius_m):
            at = f"{name}[{int(np.argmax(sizes_m > radius_m))}]" if rows.ndim == 2 else name
            raise ScenarioError(
                f"{at}: {float(sizes_m.max()) / units.KM:.4g} km is farther than the body is from {center.name}'s centre, "
                f"{radius_m / units.KM:.0f} km, where Clohessy-Wiltshire does not apply; come nearer, or use lambert"
            )


def check_plan(plan: Plan, operation: Any, *, far: bool = False, center: CentralBody = EARTH) -> Plan:
    """Check that a plan is not too long, too fast or too far, and return it.

    Parameters
    ----------
    far : whether it may go beyond the radius of the body's orbit

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
            f"{format_years(LONGEST_S)}; give a shorter time"
        )
    speeds_m_s, places_m = [impulse.size_m_s for impulse in plan.impulses], [0.0]
    for leg, begin_s, end_s in plan.stretches():
        position, velocity = leg.path(np.linspace(0.0, end_s - begin_s, _LOOKS))
        speeds_m_s.append(float(np.sqrt(np.sum(velocity * velocity, axis=1).max())))
        places_m.append(float(np.sqrt(np.sum(position * position, axis=1).max())))
    if not max(speeds_m_s) <= FASTEST_M_S:
        raise ScenarioError(
            f"{key}: the plan needs {max(speeds_m_s):.3g} m/s, faster than bodies pass each other near the Earth, at most "
            f"{FASTEST_M_S:g} m/s; give a longer time or a shorter way"
        )
    radius_m = float(np.cbrt(center.gm_m3_s2 / plan.mean_motion_rad_s**2))
    if not far and not max(places_m) <= radius_m:
        raise ScenarioError(
            f"{key}: the plan leads {max(places_m) / units.KM:.4g} km away, farther than the body is from {center.name}'s "
            f"centre, {radius_m / units.KM:.0f} km, where Clohessy-Wiltshire does not apply; plan a shorter time, or use "
            "lambert"
        )
    return plan
