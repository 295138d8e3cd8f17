"""The legs of a sequence assembled to one plan: ends found, transfers planned, impulses between legs merged."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import cast

import numpy as np

from rso_lidar.errors import ScenarioError, add_place
from rso_lidar.orbit import propagate_two_body
from rso_lidar.records import BodyState
from rso_lidar.rpo.plans.circumnavigation import Circumnavigation, SafetyEllipse
from rso_lidar.rpo.plans.keep_out import KeepOutSphere
from rso_lidar.rpo.plans.operation import check_plan
from rso_lidar.rpo.plans.plan import Leg, Path, Plan, PlannedImpulse, make_coast
from rso_lidar.rpo.plans.two_impulse import solve_departure_m_s
from rso_lidar.rpo.relative.hill import mean_motion_of_state
from rso_lidar.rpo.sequences.leg_flight import LegFlight, SunOverChief
from rso_lidar.rpo.sequences.leg_transfer import find_insertion, find_transfer_s
from rso_lidar.rpo.sequences.legs import EllipseLeg, LambertLeg, SequenceLeg, State
from rso_lidar.rpo.sequences.sequence_plan import PlannedLeg, SequencePlan

LONGEST_WAIT = 10.0  # revolutions in which a leg without an end of its own must meet its condition
_SAME_PLACE = 1e-9  # distance over the size of the path below which a leg begins where the last one ended
_LEAST_M_S = 1e-9  # an impulse below this is rounding
_LEAST_S = 1e-6  # a leg below this has no length, and instants closer than this are one


@dataclass(frozen=True, eq=False)
class _LastOperation:
    """Plan of the last operation, how long it is flown [s], and whether it is endless."""

    plan: Plan
    length_s: float
    is_endless: bool


@dataclass
class Assembly:
    """A plan in the making.

    Parameters
    ----------
    sun : the Sun over the chief, with the state of the chief at the start
    start : position [m] and velocity [m/s] (3,) at the start; None for that of the first leg
    now_s : end of what is planned so far [s]
    position_m, before_m_s : (3,) position and velocity there, before any impulse at that instant
    velocity_m_s : (3,) velocity there, after the impulse with which the last operation ends
    legs, impulses, parts : what is planned so far
    costs_m_s : impulses of each leg [m/s]
    adrift : path if the first impulse fails; None for Clohessy-Wiltshire's
    last : the last operation; None before the first leg
    """

    sun: SunOverChief
    start: State | None
    now_s: float = 0.0
    position_m: np.ndarray = field(default_factory=lambda: np.zeros(3))
    before_m_s: np.ndarray = field(default_factory=lambda: np.zeros(3))
    velocity_m_s: np.ndarray = field(default_factory=lambda: np.zeros(3))
    legs: list[Leg] = field(default_factory=list)
    impulses: list[PlannedImpulse] = field(default_factory=list)
    parts: list[PlannedLeg] = field(default_factory=list)
    costs_m_s: list[float] = field(default_factory=list)
    adrift: Path | None = None
    last: _LastOperation | None = None
    _is_begun: bool = False

    def __post_init__(self) -> None:
        self.n = mean_motion_of_state(self.sun.chief.position_m, self.sun.chief.velocity_m_s)
        if self.start is not None:
            self.position_m, self.before_m_s = self.start
            self.velocity_m_s, self._is_begun = self.before_m_s, True

    def add(self, leg: SequenceLeg, keep_out: KeepOutSphere) -> None:
        """Add a leg, with the transfer to it.

        Raises
        ------
        ScenarioError
            if it cannot be flown from where the last leg ended, does not meet its condition, or enters the sphere
        """
        begin_s, first_leg, first_impulse = self.now_s, len(self.legs), len(self.impulses)
        self.costs_m_s.append(0.0)
        own = self._plan_operation(leg)
        if not self._is_begun:
            self._begin(own)
        elif self._is_away(own):
            own = self._add_transfer(leg, own, keep_out)
        arrival_s = self.now_s
        length_s, ended_by = self._find_end(leg, own)
        self._add_path(own, length_s)
        new_legs, new_impulses = tuple(self.legs[first_leg:]), tuple(self.impulses[first_impulse:])
        nearest_m = float(np.linalg.norm(self.position_m))
        if new_legs:
            alone = Plan(leg.name, self.n, self.now_s, new_legs, new_impulses)
            nearest_m = keep_out.check(check_plan(alone, leg, far=isinstance(leg, LambertLeg))).nearest_m
        self.parts.append(PlannedLeg(leg.name, begin_s, arrival_s, self.now_s, ended_by, 0.0, nearest_m))
        self.last = _LastOperation(own, length_s, leg.is_endless)

    def finish(self, name: str) -> SequencePlan:
        """Return the plan of all legs.

        After its end the last operation continues; one that a condition ended early is followed by free flight.
        """
        assert self.last is not None
        end_s, last = self.now_s, self.last
        self._add_impulse(self.velocity_m_s, len(self.costs_m_s) - 1)
        if last.plan.duration_s <= last.length_s + _LEAST_S:
            later = [leg for leg in last.plan.legs if leg.begin_s >= last.length_s - _LEAST_S]
            self.legs += [replace(leg, begin_s=leg.begin_s - last.length_s + end_s) for leg in later]
        elif not last.is_endless or last.length_s <= _LEAST_S:
            self.legs.append(make_coast(end_s, self.position_m, self.velocity_m_s, self.n))
        plan = SequencePlan(name, self.n, end_s, tuple(self.legs), tuple(self.impulses), self.adrift)
        parts = [
            replace(part, delta_v_m_s=cost_m_s + self._sum_thrust(plan, part))
            for part, cost_m_s in zip(self.parts, self.costs_m_s, strict=True)
        ]
        return replace(plan, parts=tuple(parts))

    def _sum_thrust(self, plan: Plan, part: PlannedLeg) -> float:
        """Return the delta-v of continuous thrust [m/s] of a leg."""
        return math.fsum(
            plan.continuous_between_m_s(begin_s, end_s)
            for leg, begin_s, end_s in plan.stretches()
            if leg.acceleration_m_s2 is not None and part.begin_s <= begin_s < end_s <= part.end_s
        )

    def _plan_operation(self, leg: SequenceLeg) -> Plan:
        """Plan the operation of a leg from the present instant and state."""
        chief = self.sun.chief
        if self.now_s > 0.0:
            moved = propagate_two_body(chief.position_m, chief.velocity_m_s, np.array([self.now_s]))
            chief = BodyState(*(vectors[0] for vectors in moved))
        return leg.make_leg_plan(chief, (self.position_m, self.velocity_m_s) if self._is_begun else None)

    def _begin(self, own: Plan) -> None:
        """Begin with the first leg: at its start, before its first impulse."""
        position, velocity = own.relative(np.zeros(1))
        jumps = [impulse.delta_v_m_s for impulse in own.impulses if impulse.time_s <= _LEAST_S]
        self.position_m = position[0]
        self.before_m_s = self.velocity_m_s = velocity[0] - sum(jumps, np.zeros(3))
        self.adrift, self._is_begun = own.adrift, True

    def _is_away(self, own: Plan) -> bool:
        """Return whether an operation begins elsewhere than the last leg ended."""
        start = own.relative(np.zeros(1))[0][0]
        size_m = 1.0 + max(float(np.abs(start).max()), float(np.abs(self.position_m).max()))
        return float(np.abs(start - self.position_m).max()) > _SAME_PLACE * size_m

    def _add_transfer(self, leg: SequenceLeg, own: Plan, keep_out: KeepOutSphere) -> Plan:
        """Add the transfer to the start of an operation, and return the operation's plan from the arrival on."""
        here, duration_s = (self.position_m, self.before_m_s), leg.transfer_s
        if isinstance(leg, EllipseLeg) and leg.has_free_phase:
            operation = cast(Circumnavigation | SafetyEllipse, leg.make_operation((self.position_m, self.velocity_m_s)))
            phase_deg, duration_s = find_insertion(here, operation.find_states, self.n, keep_out, duration_s)
            leg = leg.replace(phase_deg=phase_deg)
            own = self._plan_operation(leg)
        position, velocity = own.relative(np.zeros(1))
        if duration_s is None:
            duration_s = find_transfer_s(here, (position[0], velocity[0]), self.n, keep_out)
        with add_place("transfer_s"):
            departure = solve_departure_m_s(self.position_m, position[0], duration_s, self.n)
        coast = make_coast(self.now_s, self.position_m, departure, self.n)
        self.velocity_m_s = departure
        self._add_impulse(departure, len(self.costs_m_s) - 1)
        self.legs.append(coast)
        self.now_s += duration_s
        arrival = coast.path(np.array([duration_s]))[1][0]
        self.position_m, self.before_m_s, self.velocity_m_s = position[0], arrival, arrival
        return self._plan_operation(leg)

    def _find_end(self, leg: SequenceLeg, own: Plan) -> tuple[float, str]:
        """Find the length [s] of a leg from its arrival on, and what ends it."""
        if leg.until is None:
            return own.duration_s, "plan"
        limit_s = own.duration_s if leg.has_own_end else LONGEST_WAIT * own.revolution_s
        flight = LegFlight(own.relative, self.now_s, self.n, leg.find_step_s(self.n), self.sun)
        if leg.until.name == "time" and leg.is_endless:
            limit_s = math.inf
        end_s = leg.until.find_end_s(flight, limit_s)
        if end_s is not None:
            return end_s, leg.until.name
        if leg.is_endless and leg.has_own_end:
            return own.duration_s, "plan"
        why = "the operation then ends" if leg.has_own_end else f"{LONGEST_WAIT:g} revolutions"
        raise ScenarioError(
            f"until: the condition '{leg.until.name}' is not met within {limit_s:.1f} s ({why}); change the condition, "
            "or the leg"
        )

    def _add_path(self, own: Plan, length_s: float) -> None:
        """Add the path of an operation from the present instant on, and move to its end."""
        now_s, velocity = self.now_s, own.relative(np.zeros(1))[1]
        if length_s <= _LEAST_S:  # nothing is flown, and no impulse is given
            return
        changes = float(np.abs(velocity[0] - self.velocity_m_s).max()) > _LEAST_M_S
        here = len(self.costs_m_s) - 1
        self._add_impulse(velocity[0], here if changes or here == 0 else here - 1)
        for impulse in own.impulses:
            if _LEAST_S < impulse.time_s < length_s - _LEAST_S:
                self.impulses.append(PlannedImpulse(now_s + impulse.time_s, impulse.delta_v_m_s))
                self.costs_m_s[here] += impulse.size_m_s
        flown = [leg for leg in own.legs if leg.begin_s < length_s - _LEAST_S]
        self.legs += [replace(leg, begin_s=now_s + leg.begin_s) for leg in flown]
        self.now_s = now_s + length_s
        last = flown[-1]
        position, before = last.path(np.array([length_s - last.begin_s]))
        self.position_m, self.before_m_s = position[0], before[0]
        begun = [leg for leg in own.legs if leg.begin_s <= length_s + _LEAST_S][-1]
        self.velocity_m_s = begun.path(np.array([max(0.0, length_s - begun.begin_s)]))[1][0]

    def _add_impulse(self, velocity_m_s: np.ndarray, leg: int) -> None:
        """Add the impulse at the present instant that leads to a velocity (3,) [m/s], and count it with a leg."""
        delta_v = velocity_m_s - self.before_m_s
        if float(np.abs(delta_v).max()) > _LEAST_M_S:
            self.impulses.append(PlannedImpulse(self.now_s, delta_v))
            self.costs_m_s[leg] += self.impulses[-1].size_m_s
        self.before_m_s = velocity_m_s


def assemble(
    name: str, legs: Sequence[tuple[SequenceLeg, KeepOutSphere]], sun: SunOverChief, start: State | None
) -> SequencePlan:
    """Assemble the plan of a sequence.

    Parameters
    ----------
    legs : the legs, each with the sphere that its path may not enter
    start : position [m] and velocity [m/s] (3,) at the start; None for that of the first leg

    Raises
    ------
    ScenarioError
        if a leg cannot be flown from where the last one ended, does not meet its condition, or enters the sphere
    """
    assembly = Assembly(sun, start)
    for k, (leg, keep_out) in enumerate(legs):
        with add_place(f"legs[{k}]"):
            assembly.add(leg, keep_out)
    return assembly.finish(name)
