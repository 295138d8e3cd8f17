"""Sequences of proximity operations about one body, planned as one."""

from __future__ import annotations

import datetime
import functools
from collections.abc import Iterator
from typing import Annotated, ClassVar, Literal, Self

import numpy as np
from pydantic import Field, model_validator

from rso_lidar import units
from rso_lidar.errors import ScenarioError
from rso_lidar.orbit import Epochs, Trajectory, angle_rad
from rso_lidar.part import Positive, Vector
from rso_lidar.records import BodyState
from rso_lidar.rpo.limits import LONGEST_S, MOST_PIECES, Velocity, format_years
from rso_lidar.rpo.plans.exhaust import plume_margin
from rso_lidar.rpo.plans.keep_out import KeepOutSphere
from rso_lidar.rpo.plans.operation import ProximityOperation, check_lengths
from rso_lidar.rpo.plans.plan import Plan
from rso_lidar.rpo.relative.hill import find_mean_motion_rad_s, find_start_state, mean_motion_of_state
from rso_lidar.rpo.sequences.assembly import assemble
from rso_lidar.rpo.sequences.leg_flight import SunOverChief
from rso_lidar.rpo.sequences.legs import AnyLeg, SequenceLeg
from rso_lidar.rpo.sequences.sequence_plan import SequencePlan

_SAMPLES = 200  # of the thrust of a forced stretch


class Sequence(ProximityOperation):
    """Operations one after the other, each from where the last one ended until a time or a condition.

    Where a leg begins elsewhere than the last one ended, a two-impulse transfer leads there. Impulses at the instant
    between two legs become one. Legs are planned with the Clohessy-Wiltshire equations; `lambert` is planned about the
    body's orbit as two-body motion. After the last leg its operation continues. All impulses are in the rtn axes of
    the body at their instants.
    """

    any_center: ClassVar[bool] = False
    type: Literal["sequence"] = "sequence"
    legs: Annotated[tuple[AnyLeg, ...], Field(min_length=1, max_length=MOST_PIECES)] = Field(
        description="Legs in order, each an operation with the condition that ends it."
    )
    position_m: Vector | None = Field(
        default=None,
        description="Position at `start_utc`, in the body's rtn axes [m]. If omitted, the start of the first leg.",
    )
    velocity_m_s: Velocity | None = Field(
        default=None,
        description=(
            "Velocity at `start_utc` relative to those rotating axes, before the first impulse [m/s]. It needs "
            "`position_m`. If omitted, at rest."
        ),
    )
    max_delta_v_m_s: Positive | None = Field(
        default=None, description="Greatest delta-v of the whole plan [m/s]. If omitted, no limit."
    )
    max_impulse_m_s: Positive | None = Field(default=None, description="Greatest impulse [m/s]. If omitted, no limit.")
    max_acceleration_m_s2: Positive | None = Field(
        default=None, description="Greatest acceleration of continuous thrust [m/s²]. If omitted, no limit."
    )
    plume_half_angle_deg: Annotated[Positive, Field(lt=180)] | None = Field(
        default=None,
        description=(
            "Least angle between the exhaust and the direction to the body, while nearer than `plume_range_m` [deg]. If "
            "omitted, no limit."
        ),
    )
    plume_range_m: Positive | None = Field(
        default=None, description="Distance from the body within which the plume is limited [m]."
    )

    @model_validator(mode="after")
    def _one_body(self) -> Self:
        for k, leg in enumerate(self.legs):
            if leg.relative_to not in (None, self.relative_to):
                raise ValueError(
                    f"legs[{k}].relative_to: is '{leg.relative_to}', but the sequence is about '{self.relative_to}'; "
                    "leave it out"
                )
        if self.velocity_m_s is not None and self.position_m is None:
            raise ValueError("velocity_m_s: needs position_m; give it, or leave velocity_m_s out")
        if (self.plume_half_angle_deg is None) != (self.plume_range_m is None):
            raise ValueError("plume_half_angle_deg: belongs to plume_range_m; give both, or neither")
        return self

    def make_plan(self, mean_motion_rad_s: float) -> Plan:
        """Make the plan about a body on a circular orbit; conditions of the Sun need `plan`, which knows the date."""
        radius = float(np.cbrt(units.EARTH_GM_M3_S2 / mean_motion_rad_s**2))
        speed = radius * mean_motion_rad_s
        return _plan_sequence(self, None, (radius, 0.0, 0.0), (0.0, speed, 0.0))

    def plan(self, start_utc: datetime.datetime, chief: Trajectory) -> SequencePlan:
        """Return the plan: legs, impulses, costs and safety.

        Raises
        ------
        ScenarioError
            if a leg cannot be carried out, does not meet its condition, exceeds a limit, or enters the keep-out sphere
        """
        find_mean_motion_rad_s(chief, start_utc)  # raises an error if the orbit is open
        position, velocity = find_start_state(chief, start_utc)
        return _plan_sequence(self, start_utc, tuple(position.tolist()), tuple(velocity.tolist()))

    def check_positions(self, epochs: Epochs, chief: Trajectory, position_m: np.ndarray) -> None:
        """Check that the path does not enter the keep-out sphere of the leg at each epoch; else raise `ScenarioError`."""
        ends = np.array([part.end_s for part in self.plan(epochs.start_utc, chief).parts])
        leg = np.minimum(np.searchsorted(ends, epochs.time_s), len(self.legs) - 1)
        for k in np.unique(leg):
            of = leg == k
            self.sphere_of(self.legs[k]).check_positions(epochs.time_s[of], position_m[of])

    def sphere_of(self, leg: SequenceLeg) -> KeepOutSphere:
        """Return the sphere that the path of a leg may not enter: its own, where it states one.

        Parameters
        ----------
        leg : the leg
        """
        sphere, own = self.keep_out, leg.model_fields_set
        return KeepOutSphere(
            sphere.radius_m if leg.keep_out_m is None else leg.keep_out_m,
            sphere.axis if leg.corridor_axis is None else leg.corridor_axis,
            leg.corridor_half_angle_deg if "corridor_half_angle_deg" in own else sphere.half_angle_deg,
        )


@functools.lru_cache(maxsize=128)
def _plan_sequence(
    part: Sequence, start_utc: datetime.datetime | None, chief_m: tuple[float, ...], chief_m_s: tuple[float, ...]
) -> SequencePlan:
    """Make the plan about a chief.

    Parameters
    ----------
    start_utc : start of the plan; None where the date is unknown
    chief_m, chief_m_s : (3,) state of the chief in inertial axes [m], [m/s]
    """
    chief = BodyState(np.array(chief_m), np.array(chief_m_s))
    check_lengths(part, mean_motion_of_state(chief.position_m, chief.velocity_m_s))
    start = None
    if part.position_m is not None:
        start = np.array(part.position_m), np.array(part.velocity_m_s or (0.0, 0.0, 0.0))
    legs = [(leg, part.sphere_of(leg)) for leg in part.legs]
    plan = assemble(part.name, legs, SunOverChief(start_utc, chief), start)
    _check_limits(part, plan)
    return plan


def _check_limits(part: Sequence, plan: Plan) -> None:
    """Raise `ScenarioError` if a plan exceeds a limit; the message names the key."""
    if plan.duration_s > LONGEST_S:
        raise ScenarioError(
            f"legs: the plan takes {format_years(plan.duration_s)} years, and plans are for up to "
            f"{format_years(LONGEST_S)}; give shorter legs"
        )
    if part.max_delta_v_m_s is not None and (total_m_s := plan.delta_v_m_s) > part.max_delta_v_m_s:
        raise ScenarioError(
            f"max_delta_v_m_s: the plan needs {total_m_s:.5g} m/s, more than {part.max_delta_v_m_s:g} m/s; give longer "
            "transfers or shorter holds, or raise the limit"
        )
    largest = max(plan.impulses, key=lambda impulse: impulse.size_m_s, default=None)
    if part.max_impulse_m_s is not None and largest is not None and largest.size_m_s > part.max_impulse_m_s:
        raise ScenarioError(
            f"max_impulse_m_s: the impulse at {largest.time_s:.1f} s is {largest.size_m_s:.5g} m/s, more than "
            f"{part.max_impulse_m_s:g} m/s; give a longer transfer, or raise the limit"
        )
    if part.max_acceleration_m_s2 is not None:
        for times_s, control in _sample_thrust(plan):
            size = np.linalg.norm(control, axis=1)
            if (largest_m_s2 := float(size.max())) > part.max_acceleration_m_s2:
                raise ScenarioError(
                    f"max_acceleration_m_s2: at {times_s[np.argmax(size)]:.1f} s thrust accelerates by "
                    f"{largest_m_s2:.4g} m/s2, more than {part.max_acceleration_m_s2:g} m/s2; fly slower or nearer to the "
                    "V-bar, or raise the limit"
                )
    if part.plume_half_angle_deg is not None and part.plume_range_m is not None:
        _check_plume(plan, part.plume_half_angle_deg, part.plume_range_m)


def _check_plume(plan: Plan, half_angle_deg: float, range_m: float) -> None:
    """Raise `ScenarioError` if exhaust points within an angle of the body while it is nearer than a range."""
    at_once = [(np.array([impulse.time_s]), impulse.delta_v_m_s[None]) for impulse in plan.impulses]
    for times_s, push in sorted([*at_once, *_sample_thrust(plan)], key=lambda pair: float(pair[0][0])):
        position, _ = plan.relative(times_s)
        hits = plume_margin(push, position, half_angle_deg * units.DEG, range_m) < 0.0
        if hits.any():
            k = int(np.argmax(hits))
            off_deg = float(angle_rad(push[k], position[k])) / units.DEG
            raise ScenarioError(
                f"plume_half_angle_deg: at {times_s[k]:.1f} s, {np.linalg.norm(position[k]):.4g} m away, the body is "
                f"{off_deg:.1f} deg off the exhaust, less than {half_angle_deg:g} deg; brake farther "
                "out, approach from another side, or shrink plume_range_m"
            )


def _sample_thrust(plan: Plan) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Yield instants (time,) [s] and the acceleration of thrust (time, 3) [m/s2] of each forced stretch."""
    for leg, begin_s, end_s in plan.stretches():
        if leg.acceleration_m_s2 is not None and end_s > begin_s:
            times_s = np.linspace(begin_s, end_s, _SAMPLES, endpoint=False)
            yield times_s, plan.control_m_s2(times_s)
