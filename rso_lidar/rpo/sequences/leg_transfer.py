"""The transfer that leads to the start of a leg: its duration, where a sequence does not state it."""

from __future__ import annotations

import math

import numpy as np

from rso_lidar.rpo.plans.keep_out import KeepOutSphere
from rso_lidar.rpo.relative.hill import clohessy_wiltshire

_SHORTEST, _LONGEST = 0.05, 0.95  # of the durations that are tried, in revolutions of the body
_DURATIONS = 90  # none is half a revolution, after which not every place across the orbit can be reached
_SAMPLES = 120  # of a transfer, for the keep-out sphere


def find_transfer_s(
    from_state: tuple[np.ndarray, np.ndarray],
    to_state: tuple[np.ndarray, np.ndarray],
    mean_motion_rad_s: float,
    keep_out: KeepOutSphere,
) -> float:
    """Find the duration of the cheapest two-impulse transfer between two states.

    90 durations from 0.05 to 0.95 revolutions are compared. Those whose path enters the keep-out sphere are left out,
    unless all do.

    Parameters
    ----------
    from_state, to_state : position [m] and velocity [m/s], (3,) each, before the first impulse and after the second
    mean_motion_rad_s : mean motion of the body that is approached [rad/s]
    keep_out : the sphere that the path may not enter

    Returns
    -------
    duration [s]
    """
    n = mean_motion_rad_s
    durations_s = np.linspace(_SHORTEST, _LONGEST, _DURATIONS) * math.tau / n
    (start, before), (aim, after) = from_state, to_state
    departure, arrival = solve_departures_m_s(start, aim, durations_s, n)
    cost = np.linalg.norm(departure - before, axis=1) + np.linalg.norm(after - arrival, axis=1)
    if keep_out.radius_m > 0.0:
        times_s = durations_s[:, None] * np.linspace(0.0, 1.0, _SAMPLES)
        flown, _ = clohessy_wiltshire(start, departure[:, None], times_s, n)
        enters = keep_out.clear_m(flown).min(axis=1) < 0.0
        if not enters.all():
            cost = np.where(enters, np.inf, cost)
    return float(durations_s[np.argmin(cost)])


def solve_departures_m_s(
    from_m: np.ndarray, to_m: np.ndarray, durations_s: np.ndarray, mean_motion_rad_s: float
) -> tuple[np.ndarray, np.ndarray]:
    """Solve two-impulse transfers of many durations or aims at once; unlike `solve_departure_m_s`, none is singular.

    Parameters
    ----------
    from_m, to_m : (…, 3) positions in rtn axes [m]
    durations_s : (…) times of the transfers [s], none a multiple of half a revolution
    mean_motion_rad_s : mean motion of the body that is approached [rad/s]

    Returns
    -------
    velocities of departure and of arrival, (…, 3) [m/s]
    """
    n, still = mean_motion_rad_s, np.zeros(3)
    gap = to_m - clohessy_wiltshire(from_m, still, durations_s, n)[0]
    reach_s = clohessy_wiltshire(still, np.eye(3), np.asarray(durations_s)[..., None], n)[0]
    departure = np.linalg.solve(np.swapaxes(reach_s, -1, -2), gap[..., None])[..., 0]
    return departure, clohessy_wiltshire(from_m, departure, durations_s, n)[1]
