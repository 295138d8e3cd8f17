"""Transfers by impulses: hop, waypoints, rendezvous, and Lambert's transfer."""

from __future__ import annotations

import datetime
import functools
import math
from collections.abc import Sequence
from itertools import pairwise, product
from typing import Annotated, ClassVar, Literal, Self

import numpy as np
from pydantic import Field, model_validator

from rso_lidar import units
from rso_lidar.errors import ScenarioError, add_place
from rso_lidar.orbit import (
    Branch,
    Epochs,
    Trajectory,
    Transfer,
    Way,
    find_center,
    propagate_two_body,
    rtn_matrix,
    solve_lambert,
)
from rso_lidar.part import Flag, Positive, Vector, Whole
from rso_lidar.pose import rotate_vectors
from rso_lidar.records import BodyState
from rso_lidar.rpo.limits import MOST_PIECES, TransferTime, Velocity, Wait
from rso_lidar.rpo.plans.operation import ProximityOperation, check_plan
from rso_lidar.rpo.plans.plan import Leg, Plan, PlannedImpulse, make_coast, make_line
from rso_lidar.rpo.plans.two_impulse import solve_departure_m_s
from rso_lidar.rpo.relative import hill
from rso_lidar.rpo.relative.reference_orbit import add_relative_state, find_relative_state


class Hop(ProximityOperation):
    """A two-impulse transfer from rest at `from_m` to `to_m` in `duration_s` (Fehse ch. 3).

    With `stop` a second impulse stops the body there, and it holds its position (without thrust on the V-bar). Otherwise it
    drifts on.
    """

    type: Literal["hop"] = "hop"
    from_m: Vector = Field(description="Initial position at rest, in the body's rtn axes [m].")
    to_m: Vector = Field(description="Position of arrival, in the body's rtn axes [m].")
    duration_s: TransferTime = Field(description="Time between the two impulses, above 0 [s].")
    stop: Flag = Field(
        default=True,
        description="Whether a second impulse stops the craft, which then holds its position. If false, it flies on.",
    )

    def make_plan(self, mean_motion_rad_s: float) -> Plan:
        """Return the plan about a body of this mean motion [rad/s]."""
        return _plan_transfer(
            self.name,
            np.array(self.from_m),
            np.zeros(3),
            np.array(self.to_m),
            self.duration_s,
            mean_motion_rad_s,
            self.stop,
        )


class Rendezvous(ProximityOperation):
    """A two-impulse transfer from a position and a velocity relative to the rotating rtn axes, to rest at `to_m`, then held.

    Clohessy-Wiltshire targeting: Vallado 4th ed. sec. 6.8.
    """

    type: Literal["rendezvous"] = "rendezvous"
    position_m: Vector = Field(description="Position at `start_utc`, in the body's rtn axes [m].")
    velocity_m_s: Velocity = Field(
        default=(0.0, 0.0, 0.0),
        description="Velocity at `start_utc`, before the first impulse, relative to those rotating axes [m/s].",
    )
    to_m: Vector = Field(default=(0.0, 0.0, 0.0), description="Position of arrival, which is then held [m].")
    duration_s: TransferTime = Field(description="Time between the two impulses, above 0 [s].")

    def make_plan(self, mean_motion_rad_s: float) -> Plan:
        """Return the plan about a body of this mean motion [rad/s]."""
        before, aim = np.array(self.velocity_m_s), np.array(self.to_m)
        return _plan_transfer(
            self.name, np.array(self.position_m), before, aim, self.duration_s, mean_motion_rad_s, True
        )


def _plan_transfer(
    name: str, start: np.ndarray, before_m_s: np.ndarray, aim: np.ndarray, duration_s: float, n: float, stop: bool
) -> Plan:
    """Make the plan of one two-impulse transfer, held at its end if it stops.

    Parameters
    ----------
    start, before_m_s : (3,) state before the first impulse [m], [m/s]
    aim : (3,) position of arrival [m]
    n : mean motion of the body [rad/s]
    """
    departure = solve_departure_m_s(start, aim, duration_s, n)
    leg = make_coast(0.0, start, departure, n)
    first = PlannedImpulse(0.0, departure - before_m_s)
    if not stop:
        return Plan(name, n, duration_s, (leg,), (first,))
    arrival = leg.path(np.array([duration_s]))[1][0]
    return Plan(name, n, duration_s, (leg, make_line(duration_s, aim)), (first, PlannedImpulse(duration_s, -arrival)))


class Waypoints(ProximityOperation):
    """Two-impulse transfers through a list of positions, from rest at the first to the last, which is then held.

    `times_s` are the times of arrival, the first 0. Or `speed_m_s` is the mean speed along each straight line between.
    One impulse turns the path at each position; with `stop` the body comes to rest there first, and stays for `hold_s`.
    Without `end_at_rest` it passes the last position and flies on.
    """

    type: Literal["waypoints"] = "waypoints"
    positions_m: Annotated[tuple[Vector, ...], Field(min_length=2, max_length=MOST_PIECES)] = Field(
        description=(
            "Two or more positions in the body's rtn axes [m]. The craft starts at rest at the first and, with "
            "`end_at_rest`, holds the last."
        )
    )
    times_s: tuple[Wait, ...] | None = Field(
        default=None,
        description="Time of arrival at each position, 0 for the first [s]. Give exactly one of this and `speed_m_s`.",
    )
    speed_m_s: Positive | None = Field(
        default=None,
        description=(
            "Mean speed along the straight line between positions [m/s]. Give exactly one of this and `times_s`."
        ),
    )
    stop: Flag = Field(default=False, description="Whether the craft stops at each position, with a separate impulse.")
    hold_s: Wait = Field(
        default=0.0,
        description="Time for which thrust holds the craft at each intermediate position [s]; it needs `stop`.",
    )
    end_at_rest: Flag = Field(
        default=True,
        description=(
            "Whether a closing impulse stops the craft at the last position, which it then holds. If false, it flies on."
        ),
    )

    @model_validator(mode="after")
    def _in_order(self) -> Self:
        if (self.times_s is None) == (self.speed_m_s is None):
            raise ValueError("needs exactly one of times_s and speed_m_s; give one of them")
        if self.hold_s > 0.0 and not self.stop:
            raise ValueError("hold_s: to hold a position it must stop there; set stop = true, or leave hold_s out")
        if self.times_s is None:
            for k, (position_m, next_m) in enumerate(pairwise(self.positions_m)):
                if position_m == next_m:
                    raise ValueError(
                        f"positions_m[{k + 1}]: is the same as the position before it; leave it out, or use times_s"
                    )
            return self
        if len(self.times_s) != len(self.positions_m):
            raise ValueError(
                f"times_s: {len(self.times_s)} times for {len(self.positions_m)} positions in positions_m; "
                "give as many times as positions"
            )
        if self.times_s[0] != 0.0:
            raise ValueError(f"times_s[0]: a plan begins at 0, not at {self.times_s[0]:g} s; count from there")
        for k, (before_s, after_s) in enumerate(pairwise(self.times_s)):
            if after_s <= before_s + (self.hold_s if k else 0.0):
                held = f", after a hold of {self.hold_s:g} s" if self.hold_s and k else ""
                raise ValueError(
                    f"times_s[{k + 1}]: {after_s:g} s leaves no time for the transfer from {before_s:g} s{held}; "
                    "give a later time"
                )
        return self

    def make_plan(self, mean_motion_rad_s: float) -> Plan:
        """Return the plan about a body of this mean motion [rad/s]."""
        n, places = mean_motion_rad_s, np.array(self.positions_m)
        legs: list[Leg] = []
        impulses: list[PlannedImpulse] = []
        now_s, arrival = 0.0, np.zeros(3)
        for k, (start, aim) in enumerate(pairwise(places)):
            if k and self.stop:
                impulses.append(PlannedImpulse(now_s, -arrival))
                legs += [make_line(now_s, start)] if self.hold_s else []
                now_s, arrival = now_s + self.hold_s, np.zeros(3)
            if self.times_s is not None:
                each_s = self.times_s[k + 1] - now_s
            else:
                each_s = float(np.linalg.norm(aim - start)) / (self.speed_m_s or math.nan)
            with add_place(f"positions_m[{k + 1}]"):
                departure = solve_departure_m_s(start, aim, each_s, n)
            legs.append(make_coast(now_s, start, departure, n))
            impulses.append(PlannedImpulse(now_s, departure - arrival))
            arrival = legs[-1].path(np.array([each_s]))[1][0]
            now_s = self.times_s[k + 1] if self.times_s is not None else now_s + each_s
        if self.end_at_rest:
            legs.append(make_line(now_s, places[-1]))
            impulses.append(PlannedImpulse(now_s, -arrival))
        return Plan(self.name, n, now_s, tuple(legs), tuple(impulses))


class Lambert(ProximityOperation):
    """A two-body transfer from `from_m` to rest at `to_m` (rtn axes of departure and of arrival), which is then held.

    It is exact for two-body motion at any distance and about a chief of any eccentricity. The position is the
    difference of two propagated orbits in the rtn axes of the chief's propagated orbit. Perturbations common to both
    (J2, drag) are left out. In low orbit the difference of J2 is up to 4.5 % of the separation per revolution (by
    numerical integration). It is less if it starts at a node. After `duration_s`, control and passive safety are
    Clohessy-Wiltshire's.

    `revolutions` are whole ones about the Earth before arrival; if left out, the number with the least cost. From one
    on, two orbits take the same time, and `branch` chooses `low` (the smaller semi-major axis) or `high`; if left out,
    the one that costs less. `way` is `prograde` (with the chief), `retrograde`, or `short` and `long` (less or more
    than half a revolution).
    """

    any_center: ClassVar[bool] = False
    type: Literal["lambert"] = "lambert"
    from_m: Vector = Field(description="Position at `start_utc`, in the body's rtn axes of that time [m].")
    to_m: Vector = Field(
        description="Position of arrival, which is then held, in the body's rtn axes of that time [m]."
    )
    duration_s: TransferTime = Field(description="Time between the two impulses, above 0 [s].")
    velocity_m_s: Velocity = Field(
        default=(0.0, 0.0, 0.0),
        description="Velocity at `start_utc`, before the first impulse, relative to those rotating axes [m/s].",
    )
    revolutions: Annotated[Whole, Field(ge=0)] | None = Field(
        default=None,
        description=(
            "Number of whole revolutions about the Earth before arrival. If omitted, the number that costs least."
        ),
    )
    branch: Branch | None = Field(
        default=None,
        description=(
            "Choice between the two orbits of one revolution or more: `low` has the smaller semi-major axis. If "
            "omitted, the cheaper one."
        ),
    )
    way: Way = Field(
        default="prograde",
        description=(
            "Direction about the Earth: `prograde` follows the body; `short` covers less than half a revolution, "
            "`long` more."
        ),
    )

    def make_plan(self, mean_motion_rad_s: float) -> Plan:
        """Make the plan about a body on a circular orbit, without checks."""
        radius = float(np.cbrt(units.EARTH_GM_M3_S2 / mean_motion_rad_s**2))
        speed = radius * mean_motion_rad_s
        return _plan_lambert(self, (radius, 0.0, 0.0), (0.0, speed, 0.0))

    def make_plan_about(self, chief: BodyState) -> Plan:
        """Make the plan about a chief of which the state is known, and check it."""
        return _plan_lambert(self, tuple(chief.position_m.tolist()), tuple(chief.velocity_m_s.tolist()))

    def plan(self, start_utc: datetime.datetime, chief: Trajectory) -> Plan:
        """Return the plan: legs, impulses, costs and safety.

        Raises
        ------
        ScenarioError
            if there is no such transfer, or it meets the Earth, exceeds a limit, or enters the keep-out sphere
        """
        self.check_center(find_center(chief))
        hill.find_mean_motion_rad_s(chief, start_utc)  # raises an error if the orbit is open
        return self.make_plan_about(BodyState(*hill.find_start_state(chief, start_utc)))

    def validity(self, epochs: Epochs, chief: Trajectory) -> list[str]:
        """Return one sentence for each limit of the model that these epochs exceed."""
        return self.describe_flattening(epochs, chief)


@functools.lru_cache(maxsize=128)
def _plan_lambert(part: Lambert, chief_m: tuple[float, ...], chief_m_s: tuple[float, ...]) -> Plan:
    """Make the plan about a chief with the least delta-v of those that the part allows.

    Parameters
    ----------
    chief_m, chief_m_s : (3,) state of the chief in inertial axes [m], [m/s]

    Raises
    ------
    ScenarioError
        if no orbit fits
    """
    r0, v0 = np.array(chief_m), np.array(chief_m_s)
    r1, v1 = propagate_two_body(r0, v0, np.array([part.duration_s]))
    chief, there = BodyState(r0, v0), BodyState(r1[0], v1[0])
    start = add_relative_state(chief, np.array(part.from_m), np.array(part.velocity_m_s))
    end = add_relative_state(there, np.array(part.to_m), np.zeros(3))
    start_m, before_m_s, end_m, after_m_s = start.position_m, start.velocity_m_s, end.position_m, end.velocity_m_s
    branches: tuple[Branch, ...] = ("low", "high") if part.branch is None else (part.branch,)
    way, pole = part.way, np.cross(r0, v0)

    def cost(orbit: Transfer) -> float:
        jumps = orbit.departure_m_s - before_m_s, after_m_s - orbit.arrival_m_s
        return sum(float(np.linalg.norm(jump)) for jump in jumps)

    if part.revolutions is not None:
        counts: Sequence[int] = (part.revolutions,)
    else:  # those of the chief, and one more or less
        own = part.duration_s * _find_mean_motion(chief) / math.tau
        counts = range(max(0, math.floor(own) - 1), math.ceil(own) + 2)
    orbits = []
    for turns, branch in product(counts, branches):
        try:
            orbits.append(
                solve_lambert(start_m, end_m, part.duration_s, revolutions=turns, branch=branch, way=way, normal=pole)
            )
        except ScenarioError:
            if part.revolutions is not None or (turns == counts[0] and turns == 0):
                raise
    orbit = min(
        orbits,
        key=lambda transfer: (
            _find_lowest_m(start_m, transfer, part.duration_s) < units.EARTH_RADIUS_M,
            cost(transfer),
        ),
    )

    def path(time_s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return _difference_orbits(chief, BodyState(start_m, orbit.departure_m_s), time_s)

    def adrift(time_s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return _difference_orbits(chief, start, time_s)

    departure = _rotate_into_rtn(chief, orbit.departure_m_s - before_m_s)
    arrival = _rotate_into_rtn(there, after_m_s - orbit.arrival_m_s)
    impulses = (PlannedImpulse(0.0, departure), PlannedImpulse(part.duration_s, arrival))
    legs = (Leg(0.0, path), make_line(part.duration_s, np.array(part.to_m)))
    plan = Plan(part.name, _find_mean_motion(chief), part.duration_s, legs, impulses, adrift)
    least_m = _find_lowest_m(start_m, orbit, part.duration_s)
    if least_m < units.EARTH_RADIUS_M:
        raise ScenarioError(
            f"duration_s: the transfer comes within {least_m / units.KM:.0f} km of the Earth's centre, and hits it; "
            "change the duration, the revolutions or the way"
        )
    return part.keep_out.check(check_plan(plan, part, far=True))


def _find_lowest_m(start_m: np.ndarray, orbit: Transfer, duration_s: float) -> float:
    """Return the least distance from the Earth's centre [m] during a transfer from a position (3,) [m]."""
    once_s = min(duration_s, math.tau / max(_find_mean_motion(BodyState(start_m, orbit.departure_m_s)), 1e-300))
    low_m = propagate_two_body(start_m, orbit.departure_m_s, np.linspace(0.0, once_s, 721))[0]
    return float(np.sqrt(np.sum(low_m * low_m, axis=1)).min())


def _difference_orbits(chief: BodyState, body: BodyState, time_s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the difference of two orbits in the chief's rotating rtn axes at instants (time,) since the start."""
    there, here = (
        BodyState(*propagate_two_body(state.position_m, state.velocity_m_s, time_s)) for state in (chief, body)
    )
    return find_relative_state(there, here)


def _rotate_into_rtn(state: BodyState, vector: np.ndarray) -> np.ndarray:
    return rotate_vectors(rtn_matrix(state.position_m, state.velocity_m_s)[0].T, vector)


def _find_mean_motion(state: BodyState) -> float:
    """Return the mean motion of an orbit [rad/s], 0 if it is open."""
    r, v = state.position_m, state.velocity_m_s
    alpha = float(2.0 / np.linalg.norm(r) - np.sum(v * v) / units.EARTH_GM_M3_S2)
    return math.sqrt(units.EARTH_GM_M3_S2 * max(alpha, 0.0) ** 3)
