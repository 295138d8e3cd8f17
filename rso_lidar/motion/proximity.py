"""The plans of bodies in proximity operations."""

from __future__ import annotations

import datetime
from collections.abc import Sequence

from rso_lidar.motion.bodies.body import Body
from rso_lidar.motion.truth import Chief
from rso_lidar.rpo import Plan, ProximityOperation


def find_plan(body: Body, bodies: Sequence[Body], start_utc: datetime.datetime) -> Plan | None:
    """Find the plan of a body in a proximity operation.

    Parameters
    ----------
    body : the body.
    bodies : all bodies of the scenario.
    start_utc : start of the plan.

    Returns
    -------
    the plan; None for any other motion.
    """
    if not isinstance(body.motion, ProximityOperation):
        return None
    return body.motion.plan(start_utc, Chief(bodies, body.motion.relative_to))
