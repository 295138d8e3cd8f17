"""Circumnavigation: natural ellipses, the walking safety ellipse, teardrop loops, and forced circles."""

from __future__ import annotations

import math
from typing import Literal, Self

import numpy as np
from pydantic import Field, model_validator

from rso_lidar import units
from rso_lidar.errors import ScenarioError
from rso_lidar.part import Direction, NotNegative, Number, Positive
from rso_lidar.rpo.limits import Duration, Pieces
from rso_lidar.rpo.plans.operation import ProximityOperation
from rso_lidar.rpo.plans.plan import Leg, Plan, PlannedImpulse, make_coast
from rso_lidar.rpo.plans.two_impulse import solve_departure_m_s


class Circumnavigation(ProximityOperation):
    """Natural motion round the body without end: the 2:1 ellipse of Clohessy-Wiltshire.

    Its radial semi-axis is `radial_m`. It begins at `phase_deg` (0 above, 90 behind its centre, 180 below). The
    cross-track motion, of amplitude `cross_track_m`, is the sine of the phase plus `phase_difference_deg`. At 0 it is
    greatest where the ellipse crosses the body's height. The transfer to the ellipse is not part of the plan; totals
    count over `duration_s` (one revolution if left out).
    """

    type: Literal["circumnavigation"] = "circumnavigation"
    radial_m: Positive = Field(description="Radial semi-axis of the ellipse, which is twice as long along-track [m].")
    cross_track_m: NotNegative = Field(default=0.0, description="Cross-track amplitude [m].")
    phase_deg: Number = Field(
        default=0.0, description="Initial phase on the ellipse [deg]: 0 above, 90 behind its centre, 180 below."
    )
    phase_difference_deg: Number = Field(
        default=0.0,
        description=(
            "Phase of the cross-track motion [deg]. At 0 it is at its greatest when the ellipse crosses the body's "
            "height."
        ),
    )
    center_along_track_m: Number = Field(
        default=0.0, description="Along-track position of the ellipse's centre, ahead positive [m]."
    )
    duration_s: Duration | None = Field(
        default=None,
        description=(
            "Time over which totals are counted [s]; the motion continues. If omitted, one revolution of the body."
        ),
    )

    def find_states(self, phase_deg: np.ndarray, mean_motion_rad_s: float) -> tuple[np.ndarray, np.ndarray]:
        """Return position [m] and velocity [m/s] (…, 3) with which the motion begins at some phases.

        Parameters
        ----------
        phase_deg : (…) phases on the ellipse [deg]
        mean_motion_rad_s : mean motion of the body that is approached [rad/s]
        """
        return _find_ellipse_states(self, 0.0, phase_deg, mean_motion_rad_s)

    def make_plan(self, mean_motion_rad_s: float) -> Plan:
        """Return the plan about a body of this mean motion [rad/s]."""
        n = mean_motion_rad_s
        leg = make_coast(0.0, *self.find_states(np.array(self.phase_deg), n), n)
        return Plan(self.name, n, self.duration_s or math.tau / n, (leg,))


class SafetyEllipse(ProximityOperation):
    """A walking safety ellipse: round the track and along it, so that it never crosses the track however far it drifts.

    Relative eccentricity and inclination vectors are parallel at `phase_difference_deg` 0 (180: antiparallel). Then
    height and cross-track position never vanish together (D'Amico & Montenbruck, J. Guid. Control Dyn. 29 (2006) 554).
    The centre walks `drift_m` along the track per revolution. The transfer to the ellipse is not part of the plan;
    totals count over `duration_s` (one revolution if left out).
    """

    type: Literal["safety_ellipse"] = "safety_ellipse"
    radial_m: Positive = Field(
        description="Radial semi-axis of the ellipse [m]: the relative eccentricity vector times the semi-major axis."
    )
    cross_track_m: Positive = Field(
        description="Cross-track amplitude [m]: the relative inclination vector times the semi-major axis."
    )
    phase_deg: Number = Field(
        default=0.0, description="Initial phase on the ellipse [deg]: 0 above, 90 behind its centre, 180 below."
    )
    phase_difference_deg: Number = Field(
        default=0.0,
        description=(
            "Angle between the relative eccentricity and inclination vectors [deg]. 0 and 180 are safest; 90 is "
            "refused."
        ),
    )
    drift_m: Number = Field(
        default=0.0, description="Along-track drift of the centre per revolution, ahead positive [m]."
    )
    center_along_track_m: Number = Field(
        default=0.0, description="Initial along-track position of the ellipse's centre, ahead positive [m]."
    )
    duration_s: Duration | None = Field(
        default=None,
        description=(
            "Time over which totals are counted [s]; the motion continues. If omitted, one revolution of the body."
        ),
    )

    @model_validator(mode="after")
    def _safe(self) -> Self:
        slant = abs(math.cos(self.phase_difference_deg * units.DEG))
        if slant < 1e-9:
            raise ValueError(
                f"phase_difference_deg: at {self.phase_difference_deg:g} height and cross-track vanish together, and the "
                "ellipse crosses the track; give 0 or 180, or a value near them"
            )
        if abs(self.height_m) >= self.radial_m * slant * (1.0 - 1e-9):
            raise ValueError(
                f"drift_m: walking {self.drift_m:g} m each revolution raises the ellipse's centre by {self.height_m:.4g} m, "
                "and in projection along the track it no longer encloses the body; give a smaller drift_m, a larger "
                "radial_m, or a phase_difference_deg nearer to 0 or 180"
            )
        return self

    @property
    def height_m(self) -> float:
        """Height of the ellipse's centre above the body's orbit [m], which makes it walk."""
        return -self.drift_m / (3.0 * math.pi)

    @property
    def separation_m(self) -> float:
        """Least distance from the track [m] in projection along it: the separation for any along-track error."""
        ahead = self.phase_difference_deg * units.DEG

        def projected_distance(u: np.ndarray) -> np.ndarray:
            out, across = self.height_m + self.radial_m * np.cos(u), self.cross_track_m * np.sin(u + ahead)
            distance: np.ndarray = np.sqrt(out * out + across * across)
            return distance

        centre, width = 0.0, math.pi
        for _ in range(6):
            angles = centre + width * np.linspace(-1.0, 1.0, 2001)
            centre, width = float(angles[np.argmin(projected_distance(angles))]), width / 500.0
        return float(projected_distance(np.array([centre]))[0])

    def find_states(self, phase_deg: np.ndarray, mean_motion_rad_s: float) -> tuple[np.ndarray, np.ndarray]:
        """Return position [m] and velocity [m/s] (…, 3) with which the motion begins at some phases.

        Parameters
        ----------
        phase_deg : (…) phases on the ellipse [deg]
        mean_motion_rad_s : mean motion of the body that is approached [rad/s]
        """
        return _find_ellipse_states(self, self.height_m, phase_deg, mean_motion_rad_s)

    def make_plan(self, mean_motion_rad_s: float) -> Plan:
        """Return the plan about a body of this mean motion [rad/s]."""
        n = mean_motion_rad_s
        leg = make_coast(0.0, *self.find_states(np.array(self.phase_deg), n), n)
        return Plan(self.name, n, self.duration_s or math.tau / n, (leg,))


class Teardrop(ProximityOperation):
    """Loops above or below the body, each from the cusp at `cusp_m` (radial) to its turn and back in `period_s`.

    At the cusp one radial impulse begins the next loop (Lovell & Tollefson, Calculation of impulsive hovering
    trajectories via relative orbit elements, 2005). Give `period_s`, or `turn_m`, the height of the turn. The turn is
    between the body's height and the cusp, or beyond the body for periods over 0.406 of a revolution. The plan begins
    in the loop, at the cusp; the transfer there is not part of it. After `loops` the body drifts away.
    """

    type: Literal["teardrop"] = "teardrop"
    cusp_m: Number = Field(description="Height of the cusp, where the craft thrusts, below negative; not 0 [m].")
    turn_m: Number | None = Field(
        default=None,
        description=(
            "Height of the loop's other end, nearer to the body's height than the cusp [m]. Give exactly one of this "
            "and `period_s`."
        ),
    )
    period_s: Duration | None = Field(
        default=None,
        description=(
            "Period of one loop, less than a revolution of the body [s]. Give exactly one of this and `turn_m`."
        ),
    )
    along_track_m: Number = Field(default=0.0, description="Along-track position of the loop, ahead positive [m].")
    loops: Pieces = Field(default=1, description="Number of loops, after which the craft drifts away.")

    @model_validator(mode="after")
    def _a_loop(self) -> Self:
        if self.cusp_m == 0.0:
            raise ValueError("cusp_m: at the body's height a loop does not exist; give a height above or below")
        if (self.turn_m is None) == (self.period_s is None):
            raise ValueError("needs exactly one of turn_m and period_s; give one of them")
        if self.turn_m is not None and not -1.0 < self.turn_m / self.cusp_m < 1.0:
            raise ValueError(
                f"turn_m: a loop with its cusp at {self.cusp_m:g} m turns nearer to the body's height than that, not at "
                f"{self.turn_m:g} m; give a smaller turn_m"
            )
        return self

    def loop_s(self, mean_motion_rad_s: float) -> float:
        """Return the duration of one loop [s].

        Parameters
        ----------
        mean_motion_rad_s : mean motion of the body [rad/s]

        Raises
        ------
        ScenarioError
            if `period_s` is not less than one revolution of the body
        """
        if self.period_s is not None:
            if self.period_s >= math.tau / mean_motion_rad_s:
                raise ScenarioError(
                    f"period_s: a teardrop takes less than one revolution of the body, "
                    f"{math.tau / mean_motion_rad_s:.1f} s, not {self.period_s:g} s; shorten it"
                )
            return self.period_s
        wanted = (self.turn_m or 0.0) / self.cusp_m
        low, high = 0.0, math.pi  # half the loop's angle; turn over cusp falls from 1 to -1 with it
        while (middle := 0.5 * (low + high)) not in (low, high):
            pull = 4.0 * math.sin(middle) / (3.0 * middle)
            if (1.0 - pull) / (math.cos(middle) - pull) > wanted:
                low = middle
            else:
                high = middle
        return 2.0 * middle / mean_motion_rad_s

    def make_plan(self, mean_motion_rad_s: float) -> Plan:
        """Return the plan about a body of this mean motion [rad/s]."""
        n, each_s = mean_motion_rad_s, self.loop_s(mean_motion_rad_s)
        cusp = np.array([self.cusp_m, self.along_track_m, 0.0])
        departure = solve_departure_m_s(cusp, cusp, each_s, n)
        legs = tuple(make_coast(k * each_s, cusp, departure, n) for k in range(self.loops))
        turned = np.array([2.0 * departure[0], 0.0, 0.0])
        impulses = tuple(PlannedImpulse(k * each_s, turned) for k in range(1, self.loops))
        return Plan(self.name, n, self.loops * each_s, legs, impulses)


class ForcedCircumnavigation(ProximityOperation):
    """A circle about the body at a constant rate, by thrust, without end. In rtn axes, a rate of 0 is not a hold in space.

    The rotation about `axis` is right-handed. It begins `phase_deg` from the projection of the radial direction onto
    the circle's plane (along-track if the axis is radial). Thrust compensates centrifugal, Coriolis and tidal
    acceleration. The transfer to the circle is not part of the plan; totals count over `duration_s` (one turn if left
    out).
    """

    type: Literal["forced_circumnavigation"] = "forced_circumnavigation"
    radius_m: Positive = Field(description="Radius of the circle about the body's origin [m].")
    rate_deg_s: Positive | None = Field(
        default=None,
        description="Angular rate in the rotating rtn axes [deg/s]; give exactly one of this and `period_s`.",
    )
    period_s: Duration | None = Field(
        default=None, description="Period of one turn [s]; give exactly one of this and `rate_deg_s`."
    )
    axis: Direction = Field(
        default=(0.0, 0.0, 1.0), description="Rotation axis in rtn axes, right-handed and of any length."
    )
    phase_deg: Number = Field(
        default=0.0,
        description=(
            "Initial angle from the projection of the radial direction onto the circle's plane, or from along-track "
            "if `axis` is radial [deg]."
        ),
    )
    duration_s: Duration | None = Field(
        default=None, description="Time over which totals are counted [s]; the motion continues. If omitted, one turn."
    )

    @model_validator(mode="after")
    def _one_rate(self) -> Self:
        if (self.rate_deg_s is None) == (self.period_s is None):
            raise ValueError("needs exactly one of rate_deg_s and period_s; give one of them")
        return self

    @property
    def turn_s(self) -> float:
        """Duration of one turn [s]."""
        return self.period_s or 360.0 / (self.rate_deg_s or math.nan)

    def make_plan(self, mean_motion_rad_s: float) -> Plan:
        """Return the plan about a body of this mean motion [rad/s]."""
        pole = np.array(self.axis) / np.linalg.norm(self.axis)
        toward = np.array([1.0, 0.0, 0.0]) if abs(pole[0]) < 1.0 - 1e-12 else np.array([0.0, 1.0, 0.0])
        out = toward - pole * float(np.sum(pole * toward))
        out *= self.radius_m / np.linalg.norm(out)
        on = np.cross(pole, out)
        rate_rad_s, phase_rad = math.tau / self.turn_s, self.phase_deg * units.DEG

        def path(time_s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
            angle = (phase_rad + rate_rad_s * time_s)[:, None]
            c, s = np.cos(angle), np.sin(angle)
            return c * out + s * on, rate_rad_s * (c * on - s * out)

        circle = Leg(0.0, path, lambda time_s: -(rate_rad_s**2) * path(time_s)[0])
        return Plan(self.name, mean_motion_rad_s, self.duration_s or self.turn_s, (circle,))


def _find_ellipse_states(
    part: Circumnavigation | SafetyEllipse, h: float, phase_deg: np.ndarray, n: float
) -> tuple[np.ndarray, np.ndarray]:
    """Return position [m] and velocity [m/s] (…, 3) of free flight on a 2:1 ellipse at its begin, by phase [deg].

    x = h + b cos(u), y = c - 3/2 n h t - 2 b sin(u), z = q sin(u + a), u = n t + phase (the relative orbit elements of
    Lovell & Spencer, J. Astronaut. Sci. 61, 2014).

    Parameters
    ----------
    h : height of the ellipse's centre [m]
    n : mean motion of the body [rad/s]
    """
    b, q, c = part.radial_m, part.cross_track_m, part.center_along_track_m
    phase_rad, ahead_rad = np.asarray(phase_deg) * units.DEG, part.phase_difference_deg * units.DEG
    sine, cosine = np.sin(phase_rad), np.cos(phase_rad)
    position = h + b * cosine, c - 2.0 * b * sine, q * np.sin(phase_rad + ahead_rad)
    velocity = -n * b * sine, -1.5 * n * h - 2.0 * n * b * cosine, n * q * np.cos(phase_rad + ahead_rad)
    return np.stack(position, axis=-1), np.stack(velocity, axis=-1)
