"""The plans of bodies in proximity operations, and their flights."""

from __future__ import annotations

import datetime
import itertools
import math
from collections.abc import Sequence

import numpy as np

from rso_lidar.errors import ScenarioError
from rso_lidar.motion.bodies.body import Body
from rso_lidar.motion.body_truth import Chief
from rso_lidar.orbit import Epochs, Forces, Impulse
from rso_lidar.rpo import (
    Flown,
    GuidanceInstant,
    NavigationErrors,
    NominalFlight,
    Plan,
    PlanFlight,
    PlannedImpulse,
    ProximityOperation,
    RelativeFilter,
    Thrusters,
    TwoImpulseGuidance,
    rtn_matrix,
)


def follows_plan(body: Body) -> bool:
    """Return whether a body flies a proximity operation, whose plan `find_plan` finds."""
    return isinstance(body.motion, Flown | ProximityOperation)


def find_plan(body: Body, bodies: Sequence[Body], start_utc: datetime.datetime) -> Plan | None:
    """Find the plan of a body in a proximity operation, flown by real forces or not.

    Parameters
    ----------
    body : the body.
    bodies : all bodies of the scenario.
    start_utc : start of the plan.

    Returns
    -------
    the plan; None for any other motion.
    """
    if isinstance(body.motion, Flown):
        return body.motion.make_plan(start_utc, Chief(bodies, body.motion.relative_to))
    if not isinstance(body.motion, ProximityOperation):
        return None
    return body.motion.plan(start_utc, Chief(bodies, body.motion.relative_to))


def find_flight(body: Body, bodies: Sequence[Body], start_utc: datetime.datetime) -> PlanFlight | None:
    """Find the flight of a body that flies a plan by real forces.

    Parameters
    ----------
    body : the body.
    bodies : all bodies of the scenario.
    start_utc : start of the plan.

    Returns
    -------
    the flight; None for any other motion.
    """
    if not isinstance(body.motion, Flown):
        return None
    return body.motion.fly(start_utc, Chief(bodies, body.motion.relative_to))


def list_commands(
    body: Body, bodies: Sequence[Body], start_utc: datetime.datetime, until_s: float
) -> tuple[PlannedImpulse, ...]:
    """List the impulses that a body in a proximity operation commands, those of corrections among them.

    Parameters
    ----------
    body : the body.
    bodies : all bodies of the scenario.
    start_utc : start of the plan.
    until_s : last instant of interest [s].

    Returns
    -------
    impulses in the rtn axes of the body that is approached; none for any other motion.
    """
    flight = find_flight(body, bodies, start_utc)
    if flight is not None:
        return flight.list_commands(until_s)
    plan = find_plan(body, bodies, start_utc)
    return tuple(one for one in plan.impulses if one.time_s <= until_s) if plan else ()


def find_jumps_s(body: Body, bodies: Sequence[Body], start_utc: datetime.datetime, until_s: float) -> set[float]:
    """Find the instants at which the velocity of a body jumps [s].

    Parameters
    ----------
    body : the body.
    bodies : all bodies of the scenario.
    start_utc : start of the run.
    until_s : last instant of interest [s].
    """
    flight = find_flight(body, bodies, start_utc)
    if flight is not None:
        return {one.at_s for one in flight.list_maneuvers(until_s) if isinstance(one, Impulse)}
    planned = {float(one.time_s) for one in list_commands(body, bodies, start_utc, until_s)}
    return planned | set(getattr(body.motion, "impulses_s", ()))


def find_nominal_flight(
    body: Body, bodies: Sequence[Body], start_utc: datetime.datetime, chief: str, until_s: float
) -> NominalFlight:
    """Find the flight of a body without random errors, and the errors that disperse it.

    Parameters
    ----------
    body : the body.
    bodies : all bodies of the scenario.
    start_utc : start of the run.
    chief : name of the body that is approached, whose rtn axes count.
    until_s : last instant of interest [s].

    Raises
    ------
    ScenarioError
        If its guidance is an object of the user's, which is not known in all runs at once.
    """
    motion, plan, held = body.motion, None, []
    commands: tuple[PlannedImpulse, ...] = ()
    updates: list[GuidanceInstant] = []
    forces, thrusters, least = Forces(), Thrusters(), 0.0
    navigation: NavigationErrors | RelativeFilter = NavigationErrors()
    if isinstance(motion, Flown):
        if motion.guidance is not None and not isinstance(motion.guidance, TwoImpulseGuidance):
            raise ScenarioError(
                'follower.motion.guidance: an object of your own cannot be dispersed; use type = "two_impulse"'
            )
        thrusters, navigation = motion.thrusters, motion.navigation
        exact = body.replace(motion=motion.without_random_errors())
        bodies = [exact if one is body else one for one in bodies]
        flight = find_flight(exact, bodies, start_utc)
        assert flight is not None
        plan, forces, commands = flight.plan, flight.settings.forces, flight.list_commands(until_s)
        if motion.guidance is not None:
            guidance, instants = motion.guidance, flight.list_updates_s(until_s)
            least = guidance.least_m_s
            updates = [
                GuidanceInstant(now_s, guidance.find_aim_s(plan, now_s, next_s))
                for now_s, next_s in itertools.pairwise((*instants, math.inf))
            ]
    elif isinstance(motion, ProximityOperation):
        plan = find_plan(body, bodies, start_utc)
        assert plan is not None
        commands = tuple(one for one in plan.impulses if one.time_s <= until_s)
    if plan is not None:
        ends = [*(leg.begin_s for leg in plan.legs[1:]), math.inf]
        held = [
            (leg.begin_s, min(end_s, until_s))
            for leg, end_s in zip(plan.legs, ends, strict=True)
            if leg.acceleration_m_s2 is not None and leg.begin_s < min(end_s, until_s)
        ]

    def place(time_s: np.ndarray) -> np.ndarray:
        return Chief(bodies, body.name).states(Epochs(start_utc, time_s)).position_m

    def place_chief(time_s: np.ndarray) -> np.ndarray:
        return Chief(bodies, chief).states(Epochs(start_utc, time_s)).position_m

    def find_axes(time_s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        state = Chief(bodies, chief).states(Epochs(start_utc, time_s))
        return rtn_matrix(state.position_m, state.velocity_m_s)

    return NominalFlight(
        start_utc, place, find_axes, forces, commands, tuple(updates), tuple(held),
        plan.control_m_s2 if plan is not None and held else None, thrusters, navigation, least, place_chief,
    )  # fmt: skip
