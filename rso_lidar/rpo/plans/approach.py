"""Station keeping, and approaches along the V-bar (+y, along-track) or the R-bar (-x, toward the Earth)."""

from __future__ import annotations

from typing import ClassVar, Literal, Self

import numpy as np
from pydantic import Field, model_validator

from rso_lidar.part import Number, Positive, Vector
from rso_lidar.rpo.limits import Duration, Pieces
from rso_lidar.rpo.plans.operation import ProximityOperation
from rso_lidar.rpo.plans.plan import Plan, PlannedImpulse, make_coast, make_line
from rso_lidar.rpo.plans.two_impulse import fly_arcs


class StationKeeping(ProximityOperation):
    """A position held in rtn axes without end; totals count over `duration_s` (one revolution if left out).

    On the V-bar it needs no thrust. Elsewhere thrust must compensate 3 n^2 |x| radially and n^2 |z| across (Fehse ch. 3).
    """

    type: Literal["station_keeping"] = "station_keeping"
    position_m: Vector = Field(description="Position that is held, in the body's rtn axes [m].")
    duration_s: Duration | None = Field(
        default=None,
        description=(
            "Time over which totals are counted [s]; the hold continues. If omitted, one revolution of the body."
        ),
    )

    def make_plan(self, mean_motion_rad_s: float) -> Plan:
        """Return the plan about a body of this mean motion [rad/s]."""
        duration_s = self.duration_s or 2.0 * np.pi / mean_motion_rad_s
        return Plan(self.name, mean_motion_rad_s, duration_s, (make_line(0.0, np.array(self.position_m)),))


class _AlongAnAxis(ProximityOperation):
    """Base of approaches along one axis: a forced straight line, or hops."""

    axis: ClassVar[int]
    from_m: Number = Field(
        description=(
            "Initial position at rest along the axis [m]: y for the V-bar (ahead positive), x for the R-bar (below "
            "negative)."
        )
    )
    to_m: Number = Field(description="Final position along the axis, where the craft stops and holds [m].")
    speed_m_s: Positive | None = Field(
        default=None, description="Mean speed [m/s]; give at most one of this and `duration_s`."
    )
    duration_s: Duration | None = Field(
        default=None, description="Duration of the approach [s]; give at most one of this and `speed_m_s`."
    )
    hops: Pieces | None = Field(
        default=None,
        description=(
            "Number of free arcs between impulses, instead of a forced straight line. Without speed and duration, "
            "each takes half a revolution."
        ),
    )

    @model_validator(mode="after")
    def _somewhere(self) -> Self:
        if self.from_m == self.to_m:
            raise ValueError(
                f"to_m: begins and ends at {self.to_m:g} m, so the approach has no length; change one of the two"
            )
        if self.speed_m_s is not None and self.duration_s is not None:
            raise ValueError("needs one of speed_m_s and duration_s, not both; leave one out")
        if self.hops is None:
            if self.speed_m_s is None and self.duration_s is None:
                raise ValueError("needs speed_m_s or duration_s (or hops, each of half a revolution); give one")
            if self.from_m * self.to_m < 0.0:
                raise ValueError(
                    "to_m: the straight line goes through the body; stay on one side, or use hops or waypoints"
                )
        return self

    def _at(self, along_m: float) -> np.ndarray:
        place = np.zeros(3)
        place[self.axis] = along_m
        return place

    def make_plan(self, mean_motion_rad_s: float) -> Plan:
        """Return the plan about a body of this mean motion [rad/s]."""
        n, way_m = mean_motion_rad_s, self.to_m - self.from_m
        if self.duration_s is not None:
            duration_s = self.duration_s
        elif self.speed_m_s is not None:
            duration_s = abs(way_m) / self.speed_m_s
        else:
            duration_s = (self.hops or 1) * np.pi / n
        if self.hops is None:
            velocity = self._at(way_m / duration_s)
            legs, impulses = [make_line(0.0, self._at(self.from_m), velocity)], [PlannedImpulse(0.0, velocity)]
            end_s, arrival = duration_s, velocity
        else:
            each_s, step_m = duration_s / self.hops, way_m / self.hops
            places_m = np.array([self._at(self.from_m + k * step_m) for k in range(self.hops + 1)])
            begins_s = [k * each_s for k in range(self.hops)]
            legs, impulses, arrival = fly_arcs(n, begins_s, [each_s] * self.hops, places_m)
            end_s = self.hops * each_s
        legs.append(make_line(duration_s, self._at(self.to_m)))
        impulses.append(PlannedImpulse(end_s, -arrival))
        return Plan(self.name, n, duration_s, tuple(legs), tuple(impulses))


class VBarApproach(_AlongAnAxis):
    """Approach along the V-bar (along-track y [m], ahead positive) from rest to rest; the final position is then held.

    On the straight line thrust must compensate the Coriolis acceleration 2 n v, radially (Fehse ch. 3). With `hops` it
    is that many free arcs. Each takes half a revolution if neither speed nor duration is given: Fehse's radial boosts,
    n dy / 4 each. If thrust stops, the straight line bends up and back, or, if it was fast, on through the body: see
    the plan's passive safety.
    """

    type: Literal["v_bar_approach"] = "v_bar_approach"
    axis: ClassVar[int] = 1


class RBarApproach(_AlongAnAxis):
    """Approach along the R-bar (radial x [m], below negative) from rest to rest; the final position is then held by thrust.

    On the straight line thrust must compensate 3 n^2 x radially and 2 n v along-track (Fehse ch. 3). If thrust stops, a
    body slower than sqrt(7) n |x| turns back before the other's height, and drifts away ahead (below) or behind
    (above).
    """

    type: Literal["r_bar_approach"] = "r_bar_approach"
    axis: ClassVar[int] = 0


class CoElliptic(ProximityOperation):
    """Endless drift on a neighbouring circle, `radial_m` above (positive) or below, from along-track `from_m`.

    It falls back by 3/2 n x per second, 3 pi x per revolution (Fehse ch. 3). Totals count until `to_m`, or over
    `duration_s`. The transfer to that circle is not part of the plan.
    """

    type: Literal["co_elliptic"] = "co_elliptic"
    radial_m: Number = Field(description="Height relative to the body's orbit, below negative; not 0 [m].")
    from_m: Number = Field(description="Initial along-track position, ahead positive [m].")
    to_m: Number | None = Field(
        default=None,
        description=(
            "Along-track position up to which totals are counted [m]; the drift continues. Give exactly one of this "
            "and `duration_s`."
        ),
    )
    duration_s: Duration | None = Field(
        default=None,
        description="Time over which totals are counted [s]; the drift continues. Give exactly one of this and `to_m`.",
    )

    @model_validator(mode="after")
    def _gets_there(self) -> Self:
        if self.radial_m == 0.0:
            raise ValueError(
                "radial_m: at the body's height there is no drift; give a height above or below, or use station_keeping"
            )
        if (self.to_m is None) == (self.duration_s is None):
            raise ValueError("needs exactly one of to_m and duration_s; give one of them")
        if self.to_m is not None and (self.to_m - self.from_m) * self.radial_m >= 0.0:
            way = "back, toward smaller" if self.radial_m > 0.0 else "ahead, toward larger"
            raise ValueError(
                f"to_m: {'above' if self.radial_m > 0.0 else 'below'} the body drift goes {way} along-track, and never "
                f"gets from {self.from_m:g} m to {self.to_m:g} m; change the sign of radial_m, or to_m"
            )
        return self

    def make_plan(self, mean_motion_rad_s: float) -> Plan:
        """Return the plan about a body of this mean motion [rad/s]."""
        drift_m_s = -1.5 * mean_motion_rad_s * self.radial_m
        duration_s = self.duration_s or ((self.to_m or 0.0) - self.from_m) / drift_m_s
        start = np.array([self.radial_m, self.from_m, 0.0])
        leg = make_coast(0.0, start, np.array([0.0, drift_m_s, 0.0]), mean_motion_rad_s)
        return Plan(self.name, mean_motion_rad_s, duration_s, (leg,))
