"""The transfer that leads to the start of a leg: its duration and its place, where a sequence does not state them."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from rso_lidar.rpo.plans.keep_out import KeepOutSphere
from rso_lidar.rpo.relative.hill import clohessy_wiltshire

_SHORTEST, _LONGEST = 0.05, 0.95  # of the durations that are tried, in revolutions of the body
_DURATIONS = 90  # none is half a revolution, after which not every place across the orbit can be reached
_PHASES = 72
_ROUNDS = 8  # of finer phases and durations
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
    """
    n = mean_motion_rad_s
    durations_s = np.linspace(_SHORTEST, _LONGEST, _DURATIONS) * math.tau / n
    cost = _find_costs(from_state, to_state, durations_s, n, keep_out)
    return float(durations_s[np.argmin(cost)])


def find_insertion(
    from_state: tuple[np.ndarray, np.ndarray],
    find_states: Callable[[np.ndarray, float], tuple[np.ndarray, np.ndarray]],
    mean_motion_rad_s: float,
    keep_out: KeepOutSphere,
    duration_s: float | None,
) -> tuple[float, float]:
    """Find the cheapest two-impulse transfer onto an ellipse: the phase at which it arrives [deg], and its duration [s].

    72 phases are compared at the durations of `find_transfer_s`, then more of both about the best, four times finer
    each time. Transfers that enter the keep-out sphere are left out, unless all do.

    Parameters
    ----------
    from_state : position [m] and velocity [m/s], (3,) each, before the first impulse
    find_states : function of phases (…) [deg] and the mean motion that returns the states (…, 3) on the ellipse
    duration_s : duration of the transfer; None for the cheapest [s]
    """
    n = mean_motion_rad_s
    revolution_s = math.tau / n
    phases_deg = np.arange(0.0, 360.0, 360.0 / _PHASES)
    durations_s = np.linspace(_SHORTEST, _LONGEST, _DURATIONS) * revolution_s
    if duration_s is not None:
        durations_s = np.array([duration_s])
    wide_deg, wide_s = 360.0 / _PHASES, (_LONGEST - _SHORTEST) / (_DURATIONS - 1) * revolution_s
    best = 0.0, 0.0
    for _ in range(_ROUNDS):
        aims, after = find_states(phases_deg[:, None], n)
        cost = _find_costs(
            from_state, (aims, after), np.broadcast_to(durations_s, aims.shape[:1] + durations_s.shape), n, keep_out
        )
        phase, duration = np.unravel_index(int(np.argmin(cost)), cost.shape)
        best = float(phases_deg[phase]), float(durations_s[duration])
        phases_deg = best[0] + wide_deg * np.linspace(-1.0, 1.0, 9)
        wide_deg /= 4.0
        if duration_s is None:
            durations_s = np.clip(
                best[1] + wide_s * np.linspace(-1.0, 1.0, 9), _SHORTEST * revolution_s, _LONGEST * revolution_s
            )
            wide_s /= 4.0
    return best[0] % 360.0, best[1]


def _find_costs(
    from_state: tuple[np.ndarray, np.ndarray],
    to_state: tuple[np.ndarray, np.ndarray],
    durations_s: np.ndarray,
    mean_motion_rad_s: float,
    keep_out: KeepOutSphere,
) -> np.ndarray:
    """Return the delta-v of transfers (…) [m/s], infinite for those that enter the keep-out sphere, unless all do.

    Parameters
    ----------
    from_state : position [m] and velocity [m/s], (3,) each, before the first impulse
    to_state : positions [m] and velocities [m/s], (…, 3) each, after the second impulse
    durations_s : (…) times of the transfers [s]
    """
    n, (start, before), (aim, after) = mean_motion_rad_s, from_state, to_state
    departure, arrival = solve_departures_m_s(start, aim, durations_s, n)
    cost: np.ndarray = np.linalg.norm(departure - before, axis=-1) + np.linalg.norm(after - arrival, axis=-1)
    if keep_out.radius_m > 0.0:
        times_s = durations_s[..., None] * np.linspace(0.0, 1.0, _SAMPLES)
        flown, _ = clohessy_wiltshire(start, departure[..., None, :], times_s, n)
        enters = keep_out.clear_m(flown).min(axis=-1) < 0.0
        if not enters.all():
            cost = np.where(enters, np.inf, cost)
    return cost


def solve_departures_m_s(
    from_m: np.ndarray, to_m: np.ndarray, durations_s: np.ndarray, mean_motion_rad_s: float
) -> tuple[np.ndarray, np.ndarray]:
    """Solve two-impulse transfers of many durations or aims at once; unlike `solve_departure_m_s`, none is singular.

    Parameters
    ----------
    from_m, to_m : (…, 3) positions in rtn axes [m]
    durations_s : (…) times of the transfers [s], none a multiple of half a revolution

    Returns
    -------
    velocities of departure and of arrival, (…, 3) [m/s]
    """
    n, still = mean_motion_rad_s, np.zeros(3)
    gap = to_m - clohessy_wiltshire(from_m, still, durations_s, n)[0]
    reach_s = clohessy_wiltshire(still, np.eye(3), np.asarray(durations_s)[..., None], n)[0]
    departure = np.linalg.solve(np.swapaxes(reach_s, -1, -2), gap[..., None])[..., 0]
    return departure, clohessy_wiltshire(from_m, departure, durations_s, n)[1]
