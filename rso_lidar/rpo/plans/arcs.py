"""Plans of free arcs from place to place, with an impulse between each two."""

from __future__ import annotations

import numpy as np

from rso_lidar.rpo.plans.plan import Leg, Plan, PlannedImpulse, make_coast, make_line
from rso_lidar.rpo.plans.two_impulse import solve_departure_m_s


def plan_arcs(name: str, n: float, times_s: np.ndarray, places_m: np.ndarray, stop: bool) -> Plan:
    """Make a plan of free arcs through places at times, from rest at the first.

    Parameters
    ----------
    name : name of the operation
    n : mean motion of the body [rad/s]
    times_s : times of departure and of arrivals (place,), the first 0 [s]
    places_m : (place, 3) in rtn axes [m]
    stop : whether a last impulse stops the craft at the last place, which it then holds

    Returns
    -------
    the plan
    """
    legs: list[Leg] = []
    impulses: list[PlannedImpulse] = []
    arrival = np.zeros(3)
    for k in range(len(times_s) - 1):
        begin_s, each_s = float(times_s[k]), float(times_s[k + 1] - times_s[k])
        departure = solve_departure_m_s(places_m[k], places_m[k + 1], each_s, n)
        legs.append(make_coast(begin_s, places_m[k], departure, n))
        impulses.append(PlannedImpulse(begin_s, departure - arrival))
        arrival = legs[-1].path(np.array([each_s]))[1][0]
    end_s = float(times_s[-1])
    if stop:
        legs.append(make_line(end_s, places_m[-1]))
        impulses.append(PlannedImpulse(end_s, -arrival))
    return Plan(name, n, end_s, tuple(legs), tuple(impulses))
