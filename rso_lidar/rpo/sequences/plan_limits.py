"""Limits of a whole plan: its length, delta-v, impulses, acceleration, and where its plume may point."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from rso_lidar import units
from rso_lidar.errors import ScenarioError
from rso_lidar.orbit import angle_rad
from rso_lidar.rpo.limits import LONGEST_S, format_years
from rso_lidar.rpo.plans.plan import Plan

_SAMPLES = 200  # of the thrust of a forced stretch
_LEAST_M_S2 = 1e-12  # a thrust below this is rounding


@dataclass(frozen=True)
class PlanLimits:
    """What a plan may take at most; None without a limit.

    Parameters
    ----------
    delta_v_m_s : whole delta-v [m/s]
    impulse_m_s : largest impulse [m/s]
    acceleration_m_s2 : largest acceleration of continuous thrust [m/s2]
    plume_half_angle_deg : angle about the exhaust in which the body may not be [deg]
    plume_range_m : distance from the body up to which that holds [m]
    """

    delta_v_m_s: float | None
    impulse_m_s: float | None
    acceleration_m_s2: float | None
    plume_half_angle_deg: float | None
    plume_range_m: float | None

    def check(self, plan: Plan) -> None:
        """Raise `ScenarioError` if a plan exceeds a limit; the message names the key."""
        if plan.duration_s > LONGEST_S:
            raise ScenarioError(
                f"legs: the plan takes {format_years(plan.duration_s)} years, and plans are for up to "
                f"{format_years(LONGEST_S)}; give shorter legs"
            )
        if self.delta_v_m_s is not None and (total_m_s := plan.delta_v_m_s) > self.delta_v_m_s:
            raise ScenarioError(
                f"max_delta_v_m_s: the plan needs {total_m_s:.5g} m/s, more than {self.delta_v_m_s:g} m/s; give longer "
                "transfers or shorter holds, or raise the limit"
            )
        largest = max(plan.impulses, key=lambda impulse: impulse.size_m_s, default=None)
        if self.impulse_m_s is not None and largest is not None and largest.size_m_s > self.impulse_m_s:
            raise ScenarioError(
                f"max_impulse_m_s: the impulse at {largest.time_s:.1f} s is {largest.size_m_s:.5g} m/s, more than "
                f"{self.impulse_m_s:g} m/s; give a longer transfer, or raise the limit"
            )
        if self.acceleration_m_s2 is not None:
            for times_s, control in _sample_thrust(plan):
                size = np.linalg.norm(control, axis=1)
                if (largest_m_s2 := float(size.max())) > self.acceleration_m_s2:
                    raise ScenarioError(
                        f"max_acceleration_m_s2: at {times_s[np.argmax(size)]:.1f} s thrust accelerates by "
                        f"{largest_m_s2:.4g} m/s2, more than {self.acceleration_m_s2:g} m/s2; fly slower or nearer to the "
                        "V-bar, or raise the limit"
                    )
        if self.plume_half_angle_deg is not None and self.plume_range_m is not None:
            self._check_plume(plan, self.plume_half_angle_deg, self.plume_range_m)

    def _check_plume(self, plan: Plan, half_angle_deg: float, range_m: float) -> None:
        """Raise `ScenarioError` if exhaust points at the body.

        Parameters
        ----------
        half_angle_deg : angle about the exhaust in which the body may not be [deg]
        range_m : distance from the body up to which that holds [m]
        """
        at_once = [(np.array([impulse.time_s]), impulse.delta_v_m_s[None]) for impulse in plan.impulses]
        for times_s, push in sorted([*at_once, *_sample_thrust(plan)], key=lambda pair: float(pair[0][0])):
            position, _ = plan.relative(times_s)
            away_m = np.linalg.norm(position, axis=1)
            # the exhaust is opposite to the push, and the body opposite to the position
            off_rad = angle_rad(push, position)
            hits = (off_rad < half_angle_deg * units.DEG) & (away_m < range_m)
            hits &= np.linalg.norm(push, axis=1) > _LEAST_M_S2
            if hits.any():
                k = int(np.argmax(hits))
                raise ScenarioError(
                    f"plume_half_angle_deg: at {times_s[k]:.1f} s, {away_m[k]:.4g} m away, the body is "
                    f"{off_rad[k] / units.DEG:.1f} deg off the exhaust, less than {half_angle_deg:g} deg; brake farther "
                    "out, approach from another side, or shrink plume_range_m"
                )


def _sample_thrust(plan: Plan) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Yield instants (time,) [s] and the acceleration of thrust (time, 3) [m/s2] of each forced stretch."""
    for leg, begin_s, end_s in plan.stretches():
        if leg.acceleration_m_s2 is not None and end_s > begin_s:
            times_s = np.linspace(begin_s, end_s, _SAMPLES, endpoint=False)
            yield times_s, plan.control_m_s2(times_s)
