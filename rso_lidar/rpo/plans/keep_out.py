"""The keep-out sphere about the body that is approached, and the corridor through which a path may enter it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rso_lidar import units
from rso_lidar.errors import ScenarioError
from rso_lidar.orbit import angle_rad, find_minimum, find_spans_below
from rso_lidar.part import Vector
from rso_lidar.rpo.plans.plan import Plan

_PER_REVOLUTION = 720  # samples of a path before entries are refined


@dataclass(frozen=True)
class KeepOutSphere:
    """A sphere about the body's origin that a path may not enter, except inside a cone about an axis.

    Parameters
    ----------
    radius_m : radius of the sphere [m]; 0 allows everything
    axis : centre line of the cone from the origin outward, in rtn axes; None without one
    half_angle_deg : half angle of the cone [deg]
    """

    radius_m: float
    axis: Vector | None = None
    half_angle_deg: float = 0.0

    def clear_m(self, position_m: np.ndarray) -> np.ndarray:
        """Return the distance (…) [m] of positions from what is forbidden, negative inside it.

        Parameters
        ----------
        position_m : (…, 3) in rtn axes of the body [m]
        """
        distance = np.sqrt(np.sum(position_m * position_m, axis=-1))
        clear: np.ndarray = distance - self.radius_m
        if self.axis is not None:
            aside_rad = self.half_angle_deg * units.DEG - angle_rad(position_m, np.array(self.axis))
            # the nearest point of a cone is its apex for whatever is a right angle or more from its surface
            clear = np.maximum(clear, distance * np.sin(np.clip(aside_rad, -0.5 * np.pi, 0.5 * np.pi)))
        return clear

    def check_positions(self, time_s: np.ndarray, position_m: np.ndarray) -> None:
        """Check that no position of a path is forbidden.

        Parameters
        ----------
        time_s : (time,) instants, for the message [s]
        position_m : (time, 3) positions in rtn axes of the body [m]

        Raises
        ------
        ScenarioError
            if one is forbidden; the message states the worst
        """
        if self.radius_m > 0.0 and len(position_m):
            clear = self.clear_m(position_m)
            k = int(np.argmin(clear))
            if clear[k] < 0.0:
                raise self._error(float(time_s[k]), position_m[k])

    def check(self, plan: Plan) -> Plan:
        """Check that a plan does not enter the sphere outside the corridor.

        Parameters
        ----------
        plan : the plan

        Returns
        -------
        Plan
            the same plan

        Raises
        ------
        ScenarioError
            if it does; the message states where
        """
        if self.radius_m <= 0.0:
            return plan
        nearest_m, at_s = plan.nearest()
        if nearest_m >= self.radius_m:
            return plan
        if self.axis is not None:
            entry_s = self._find_worst_entry_s(plan)
            if entry_s is None:
                return plan
            at_s = entry_s
        raise self._error(at_s, plan.relative(np.array([at_s]))[0][0])

    def _find_worst_entry_s(self, plan: Plan) -> float | None:
        """Find the instant [s] at which a plan is deepest in what is forbidden; None if it never is."""
        worst: list[tuple[float, float]] = []
        for leg, begin_s, end_s in plan.stretches():

            def clear(time_s: np.ndarray, leg=leg) -> np.ndarray:  # type: ignore[no-untyped-def]
                return self.clear_m(leg.path(time_s)[0])

            length_s = end_s - begin_s
            step_s = max(min(plan.revolution_s / _PER_REVOLUTION, length_s / 48.0), 1e-3)
            for from_s, to_s in find_spans_below(clear, 0.0, length_s, step_s):
                at_s, depth_m = find_minimum(clear, max(from_s, 0.0), min(to_s, length_s))
                worst.append((depth_m, begin_s + at_s))
        return min(worst)[1] if worst else None

    def _error(self, at_s: float, position_m: np.ndarray) -> ScenarioError:
        where = ", ".join(f"{part:.4g}" for part in position_m)
        nearest_m = float(np.linalg.norm(position_m))
        corridor = "" if self.axis is None else " and outside its corridor"
        return ScenarioError(
            f"keep_out_m: at {at_s:.1f} s the path is {nearest_m:.4g} m from the body ({where} m in rtn), inside the "
            f"sphere of {self.radius_m:g} m{corridor}; go round it, end farther out, or make the sphere smaller"
        )
