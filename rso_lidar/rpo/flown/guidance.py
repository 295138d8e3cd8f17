"""Guidance of a craft on the way: a protocol, and two-impulse corrections as its reference."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Annotated, ClassVar, Literal, Protocol, Self, runtime_checkable

import numpy as np
from pydantic import Field, model_validator

from rso_lidar.errors import ScenarioError
from rso_lidar.orbit import Forces
from rso_lidar.part import NotNegative, Part, Positive, Seam, make_answer_error, name_object, to_real_array
from rso_lidar.rpo.limits import FASTEST_M_S, Wait
from rso_lidar.rpo.plans.plan import Plan, PlannedImpulse
from rso_lidar.rpo.relative.hill import clohessy_wiltshire

Predict = Callable[[float, Sequence[PlannedImpulse]], tuple[np.ndarray, np.ndarray]]
_CLOSE_M = 1e-4  # miss at which the search for a velocity ends
_MOST_STEPS = 25
_SHORTEST_S = 1e-3  # from a correction to its aim
_CARRIED_OUT_M_S = 1e-12


@dataclass(frozen=True, eq=False)
class GuidanceUpdate:
    """What guidance is given at an update.

    Parameters
    ----------
    time_s : present instant since the start of the plan [s]
    position_m, velocity_m_s : (3,) relative state as navigation knows it, before impulses at this instant, in the
        rotating rtn axes of the body that is approached [m], [m/s]
    plan : plan that is flown
    impulses : those not yet begun, in order of time; the first may be due now
    next_s : instant of the next update [s], infinite if there is none
    predict : ``predict(until_s, impulses)`` returns the relative position [m] and velocity [m/s] (3,) just before
        `until_s`, propagated from this state with those impulses by the guidance's own forces
    """

    time_s: float
    position_m: np.ndarray
    velocity_m_s: np.ndarray
    plan: Plan
    impulses: tuple[PlannedImpulse, ...]
    next_s: float
    predict: Predict


@runtime_checkable
class Guidance(Protocol):
    """Protocol of guidance: when it is asked, and which impulses it then wants.

    The result must depend on the arguments only, so that a frame does not depend on which others are made. An optional
    attribute `forces` (`Forces`) is what ``update.predict`` propagates with; without it, the forces that are flown.
    """

    def next_s(self, after_s: float) -> float:
        """Return the instant of the first update after another [s], infinite for none.

        Parameters
        ----------
        after_s : the other instant [s]; -1 in the first call
        """
        ...

    def replan(self, update: GuidanceUpdate) -> Sequence[PlannedImpulse]:
        """Return the impulses from now on, in the approached body's rtn axes. They replace all that have not yet begun.

        Parameters
        ----------
        update : what is known
        """
        ...


class TwoImpulseGuidance(Part):
    """Corrections by two impulses: one now that leads back to the plan, and one on arrival that matches its velocity.

    A correction aims at the plan's position at its next impulse or leg, or on a leg held by thrust at the next update, if
    that is earlier. It aims at most `horizon_s` ahead. The first impulse is found by shooting with the forces that
    guidance knows, or by Clohessy-Wiltshire's equations for the deviation from the plan. A component of the aim that no
    velocity reaches, such as the one across the track after half a revolution, is left alone.
    """

    WEAK_SHARE: ClassVar[float] = 1e-3  # of the strongest direction; a weaker component of the aim is not commanded
    type: Literal["two_impulse"] = "two_impulse"
    at_s: tuple[Wait, ...] | None = Field(
        default=None, description="Instants of the corrections [s]. Give exactly one of this and `every_s`."
    )
    every_s: Annotated[Positive, Field(ge=1.0)] | None = Field(
        default=None, description="Time from one correction to the next, the first after that time; at least 1 [s]."
    )
    model: Literal["forces", "clohessy_wiltshire"] = Field(
        default="forces",
        description="What predicts the arrival: integration under `forces`, or Clohessy-Wiltshire's equations.",
    )
    forces: Forces | None = Field(
        default=None, description="Forces that guidance knows. If omitted, those that are flown."
    )
    horizon_s: Annotated[Positive, Field(ge=1.0)] | None = Field(
        default=None,
        description=(
            "Longest time from a correction to its arrival; at least 1 [s]. On a long free leg it limits how far the "
            "craft strays. Keep it below a quarter of a revolution if updates come sooner. If omitted, no limit."
        ),
    )
    least_m_s: NotNegative = Field(
        default=0.0, description="A first impulse smaller than this is not made [m/s]; the plan then stays as it is."
    )

    @model_validator(mode="after")
    def _one_schedule(self) -> Self:
        if (self.at_s is None) == (self.every_s is None):
            raise ValueError("needs exactly one of at_s and every_s; give one of them")
        if self.at_s is not None and any(b <= a for a, b in zip(self.at_s, self.at_s[1:], strict=False)):
            raise ValueError("at_s: the corrections are not in order of time; sort them, each instant once")
        if self.forces is not None and self.model != "forces":
            raise ValueError(
                "forces: 'clohessy_wiltshire' predicts without forces; leave them out, or set model = \"forces\""
            )
        return self

    def next_s(self, after_s: float) -> float:
        """Return the instant of the first correction after another [s], infinite for none."""
        if self.every_s is not None:
            return (math.floor(max(after_s, 0.0) / self.every_s + 1e-9) + 1) * self.every_s
        return next((at_s for at_s in self.at_s or () if at_s > after_s), math.inf)

    def find_aim_s(self, plan: Plan, time_s: float, next_s: float) -> float:
        """Return the instant at which a correction arrives [s].

        Parameters
        ----------
        plan : plan that is flown
        time_s : instant of the correction [s]
        next_s : instant of the next update [s], infinite if there is none
        """
        return min(_find_aim_s(plan, time_s, next_s), time_s + (math.inf if self.horizon_s is None else self.horizon_s))

    def list_limits(self, mean_motion_rad_s: float) -> list[str]:
        """Return a sentence if corrections that are replaced before they arrive amplify an error.

        Across the track, the way to an aim T ahead is a part of a sine. After the time U to the next update,
        sin(n (T - U)) / sin(n T) of the error is left, which must be less than all of it.

        Parameters
        ----------
        mean_motion_rad_s : of the body that is approached [rad/s]
        """
        if self.every_s is None or self.horizon_s is None or self.every_s >= self.horizon_s:
            return []
        ahead, left = (mean_motion_rad_s * time_s for time_s in (self.horizon_s, self.horizon_s - self.every_s))
        if abs(math.sin(left)) < abs(math.sin(ahead)):
            return []
        return [
            f"guidance: an update each {self.every_s:g} s for an aim {self.horizon_s:g} s ahead multiplies an error across "
            f"the track by {abs(math.sin(left) / math.sin(ahead)):.2f}; make horizon_s shorter than a quarter of a "
            f"revolution, {0.5 * math.pi / mean_motion_rad_s:.0f} s"
        ]

    def replan(self, update: GuidanceUpdate) -> Sequence[PlannedImpulse]:
        """Return the impulses from now on: the correction, its arrival, and those of the plan after that."""
        aim_s = self.find_aim_s(update.plan, update.time_s, update.next_s)
        if not aim_s > update.time_s + _SHORTEST_S:
            return update.impulses
        planned_m, planned_m_s = (rows[0] for rows in update.plan.relative(np.array([update.time_s])))
        aim_m, aim_m_s = (rows[0] for rows in update.plan.relative(np.array([aim_s])))
        steer = Steering(update.plan.mean_motion_rad_s, aim_s - update.time_s)
        off_m = update.position_m - planned_m
        velocity = planned_m_s + steer.solve(-steer.drift(off_m))
        if self.model == "forces":
            velocity, arrival = _shoot(update, aim_s, aim_m, velocity, steer)
        else:
            arrival = aim_m_s - _impulse_at(update, aim_s) + steer.arrive(off_m, velocity - planned_m_s)
        kick = velocity - update.velocity_m_s
        due = _impulse_at(update, update.time_s)
        if float(np.linalg.norm(kick - due)) < self.least_m_s:
            return update.impulses
        later = [impulse for impulse in update.impulses if impulse.time_s > aim_s + _SHORTEST_S]
        return [PlannedImpulse(update.time_s, kick), PlannedImpulse(aim_s, aim_m_s - arrival), *later]


AnyGuidance = Annotated[TwoImpulseGuidance | Guidance, Seam(TwoImpulseGuidance, Guidance)]


class Steering:
    """What a velocity does to the position after a time, by Clohessy-Wiltshire's equations.

    Parameters
    ----------
    mean_motion_rad_s : of the body that is approached [rad/s]
    duration_s : the time [s]
    """

    def __init__(self, mean_motion_rad_s: float, duration_s: float) -> None:
        self._n, self._duration_s = mean_motion_rad_s, duration_s
        still = np.zeros(3)
        self.reach_s = clohessy_wiltshire(still, np.eye(3), duration_s, mean_motion_rad_s)[0].T

    def drift(self, offset_m: np.ndarray) -> np.ndarray:
        """Return where an offset (3,) [m] leads without a change of velocity (3,) [m]."""
        return clohessy_wiltshire(offset_m, np.zeros(3), self._duration_s, self._n)[0]

    def arrive(self, offset_m: np.ndarray, change_m_s: np.ndarray) -> np.ndarray:
        """Return the difference of velocity (3,) [m/s] on arrival, from the deviation (3,) from the plan at departure."""
        return clohessy_wiltshire(offset_m, change_m_s, self._duration_s, self._n)[1]

    def solve(self, gap_m: np.ndarray) -> np.ndarray:
        """Return the change of velocity (3,) [m/s] that closes a gap (3,) [m], as far as it can be commanded."""
        change = np.zeros(3)
        for rows in (slice(0, 2), slice(2, 3)):
            block = self.reach_s[rows, rows] / min(self._duration_s, 1.0 / self._n)
            u, strength, w = np.linalg.svd(block)
            usable = strength > TwoImpulseGuidance.WEAK_SHARE * max(1.0, strength[0])
            along = np.where(usable, (u.T @ gap_m[rows]) / np.where(usable, strength, 1.0), 0.0)
            change[rows] = w.T @ along / min(self._duration_s, 1.0 / self._n)
        return change


def _find_aim_s(plan: Plan, time_s: float, next_s: float) -> float:
    """Return the instant of the plan's next event [s], or of the next update."""
    begins = [leg.begin_s for leg in plan.legs]
    events = [*begins, *(impulse.time_s for impulse in plan.impulses)]
    ahead = min((at_s for at_s in events if at_s > time_s + _SHORTEST_S), default=math.inf)
    leg = plan.legs[max(int(np.searchsorted(begins, time_s, side="right")) - 1, 0)]
    if leg.acceleration_m_s2 is not None or ahead == math.inf:
        ahead = min(ahead, next_s)
    if ahead == math.inf:
        return plan.duration_s
    return ahead


def _impulse_at(update: GuidanceUpdate, time_s: float) -> np.ndarray:
    """Return the sum (3,) [m/s] of the impulses that are due at an instant [s]."""
    due = [impulse.delta_v_m_s for impulse in update.impulses if abs(impulse.time_s - time_s) <= _SHORTEST_S]
    return np.asarray(np.sum([np.zeros(3), *due], axis=0))


def _shoot(
    update: GuidanceUpdate, aim_s: float, aim_m: np.ndarray, velocity: np.ndarray, steer: Steering
) -> tuple[np.ndarray, np.ndarray]:
    """Find the velocity that leads to an aim, by Broyden's method from that of Clohessy-Wiltshire.

    Parameters
    ----------
    aim_s, aim_m : instant [s] and position (3,) [m] of arrival
    velocity : (3,) first guess [m/s]
    """
    inverse = np.stack([steer.solve(column) for column in np.eye(3)], axis=1)

    def arrive(departure: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        first = PlannedImpulse(update.time_s, departure - update.velocity_m_s)
        position, arrival = update.predict(aim_s, [first])
        return position - aim_m, arrival

    miss, arrival = arrive(velocity)
    best = (float(np.linalg.norm(miss)), velocity, arrival)
    for _ in range(_MOST_STEPS):
        step = -inverse @ miss
        if float(np.linalg.norm(steer.reach_s @ step)) < _CLOSE_M:
            break
        velocity = velocity + step
        after, arrival = arrive(velocity)
        change = after - miss
        weight = step @ inverse @ change
        if abs(weight) > 1e-12 * float(step @ step):
            inverse = inverse + np.outer(step - inverse @ change, step @ inverse) / weight
        miss = after
        best = min(best, (float(np.linalg.norm(miss)), velocity, arrival), key=lambda attempt: attempt[0])
    return best[1], best[2]


def check_impulses(guidance: object, impulses: object, now_s: float) -> tuple[PlannedImpulse, ...]:
    """Return the impulses that guidance wants, in order of time; those that are too small to matter are left out.

    Raises
    ------
    ScenarioError
        if they are not impulses from now on
    """
    cure = f"return a list of PlannedImpulse(time_s, delta_v_m_s), from {now_s:g} s on, with 3 numbers [m/s] each"
    if not isinstance(impulses, Sequence) or not all(isinstance(impulse, PlannedImpulse) for impulse in impulses):
        raise make_answer_error(guidance, "replan", impulses, cure)
    checked = []
    for impulse in impulses:
        delta_v = to_real_array(impulse.delta_v_m_s)
        if delta_v is None or delta_v.shape != (3,) or not np.isfinite(delta_v).all() or not impulse.time_s >= now_s:
            raise make_answer_error(guidance, "replan", impulse, cure)
        if (size := float(np.linalg.norm(delta_v))) > FASTEST_M_S:
            raise ScenarioError(
                f"{name_object(guidance)}: replan() wants {size:.3g} m/s at {impulse.time_s:g} s, more than "
                f"{FASTEST_M_S:g} m/s; correct it, or give the correction more time before its aim"
            )
        if size > _CARRIED_OUT_M_S:
            checked.append(PlannedImpulse(float(impulse.time_s), delta_v))
    return tuple(sorted(checked, key=lambda impulse: impulse.time_s))
