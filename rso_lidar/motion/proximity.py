"""The plans of bodies in proximity operations, and their flights."""

from __future__ import annotations

import datetime
from collections.abc import Sequence

from rso_lidar.motion.bodies.body import Body
from rso_lidar.motion.body_truth import Chief
from rso_lidar.rpo import (
    Flown,
    Plan,
    PlanFlight,
    PlannedImpulse,
    ProximityOperation,
)


def follows_plan(body: Body) -> bool:
    """Return whether a body flies a proximity operation, whose plan `find_plan` finds.

    Parameters
    ----------
    body : whose motion counts
    """
    return isinstance(body.motion, Flown | ProximityOperation)


def get_flown_motion(body: Body) -> Flown | None:
    """Return the motion of a body that flies a plan by real forces; None for any other motion.

    Parameters
    ----------
    body : whose motion counts
    """
    return body.motion if isinstance(body.motion, Flown) else None


def find_plan(body: Body, bodies: Sequence[Body], start_utc: datetime.datetime) -> Plan | None:
    """Find the plan of a body in a proximity operation, flown by real forces or not.

    Parameters
    ----------
    body : the body
    bodies : all bodies of the scenario
    start_utc : start of the plan

    Returns
    -------
    the plan; None for any other motion
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
    body : the body
    bodies : all bodies of the scenario
    start_utc : start of the plan

    Returns
    -------
    the flight; None for any other motion
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
    body : the body
    bodies : all bodies of the scenario
    start_utc : start of the plan
    until_s : last instant of interest [s]

    Returns
    -------
    impulses in the rtn axes of the body that is approached; none for any other motion
    """
    flight = find_flight(body, bodies, start_utc)
    if flight is not None:
        return flight.list_commands(until_s)
    plan = find_plan(body, bodies, start_utc)
    return tuple(impulse for impulse in plan.impulses if impulse.time_s <= until_s) if plan else ()
