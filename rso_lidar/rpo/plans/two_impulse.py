"""Velocities that lead from place to place in given times, by Clohessy-Wiltshire (Vallado 4th ed. sec. 6.8)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from rso_lidar.errors import ScenarioError
from rso_lidar.rpo.plans.plan import Leg, Plan, PlannedImpulse, make_coast, make_line
from rso_lidar.rpo.relative.hill import clohessy_wiltshire

_SINGULAR = 1e-9  # ratio of the singular values below which a direction cannot be commanded
_MISSED = 1e-9  # miss distance allowed, as a fraction of the way


def solve_departure_m_s(
    from_m: np.ndarray, to_m: np.ndarray, duration_s: float, mean_motion_rad_s: float
) -> np.ndarray:
    """Return the departure velocity (3,) [m/s] of a transfer between two positions, in rtn axes.

    After whole half revolutions across the track, and after whole revolutions in the plane, not every position can be
    reached. If the aim is one of those that can, the smallest velocity is returned, such as that of Fehse's tangential
    hop along the V-bar.

    Parameters
    ----------
    from_m, to_m : (3,) positions in rtn axes [m]

    Raises
    ------
    ScenarioError
        if no velocity reaches the aim
    """
    if not duration_s > 0.0:
        raise ScenarioError(f"transfer: one in {duration_s:g} s needs infinite speed; give more than zero")
    start, aim, still = np.asarray(from_m, dtype=float), np.asarray(to_m, dtype=float), np.zeros(3)
    gap = aim - clohessy_wiltshire(start, still, duration_s, mean_motion_rad_s)[0]
    reach_s = clohessy_wiltshire(still, np.eye(3), duration_s, mean_motion_rad_s)[0].T
    size_m = float(max(np.abs(start).max(), np.abs(aim).max(), np.abs(gap).max()))
    velocity = np.zeros(3)
    for rows, name in ((slice(0, 2), "in the orbit's plane"), (slice(2, 3), "across the orbit's plane")):
        block = reach_s[rows, rows]
        scale_s = min(duration_s, 1.0 / mean_motion_rad_s)
        u, strength, w = np.linalg.svd(block / scale_s)
        usable = strength > _SINGULAR * max(1.0, strength[0])
        along = np.where(usable, (u.T * gap[rows]).sum(axis=1) / np.where(usable, strength, 1.0), 0.0)
        velocity[rows] = (w.T * along).sum(axis=1) / scale_s
        missed = float(np.abs((block * velocity[rows]).sum(axis=1) - gap[rows]).max())
        if missed > _MISSED * size_m:
            turns = duration_s * mean_motion_rad_s / math.tau
            raise ScenarioError(
                f"transfer: after {turns:.6g} revolutions of the body no departure velocity reaches the aim {name} "
                f"(whole {'' if rows.start == 0 else 'half '}revolutions do not); change the duration by a few percent"
            )
    return velocity


def plan_arcs(name: str, n: float, times_s: np.ndarray, places_m: np.ndarray, stop: bool) -> Plan:
    """Make a plan of free arcs through places at times, from rest at the first.

    Parameters
    ----------
    n : mean motion of the body [rad/s]
    times_s : times of departure and of arrivals (place,), the first 0 [s]
    places_m : (place, 3) in rtn axes [m]
    stop : whether a last impulse stops the craft at the last place, which it then holds
    """
    legs, impulses, arrival = fly_arcs(n, times_s[:-1].tolist(), np.diff(times_s).tolist(), places_m)
    end_s = float(times_s[-1])
    if stop:
        legs.append(make_line(end_s, places_m[-1]))
        impulses.append(PlannedImpulse(end_s, -arrival))
    return Plan(name, n, end_s, tuple(legs), tuple(impulses))


def fly_arcs(
    n: float, begins_s: Sequence[float], durations_s: Sequence[float], places_m: np.ndarray
) -> tuple[list[Leg], list[PlannedImpulse], np.ndarray]:
    """Return free arcs from place to place, the impulses that begin them, and the velocity (3,) [m/s] at the last place.

    Parameters
    ----------
    n : mean motion of the body [rad/s]
    places_m : (arc + 1, 3) in rtn axes [m], at the first of which the craft is at rest
    """
    legs: list[Leg] = []
    impulses: list[PlannedImpulse] = []
    arrival = np.zeros(3)
    for begin_s, each_s, (start, aim) in zip(begins_s, durations_s, pairwise(places_m), strict=True):
        departure = solve_departure_m_s(start, aim, each_s, n)
        legs.append(make_coast(begin_s, start, departure, n))
        impulses.append(PlannedImpulse(begin_s, departure - arrival))
        arrival = legs[-1].path(np.array([each_s]))[1][0]
    return legs, impulses, arrival
