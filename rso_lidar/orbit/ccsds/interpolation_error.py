"""Estimate of the error of interpolation in an ephemeris, by orbital motion between its rows.

The state of each row is integrated to the next row with the Earth's gravity and J2, or without J2 where that fits better.
Forces that are left out (drag, the Moon, higher terms of gravity, thrust) show as a miss at the next row. The cubic
polynomial that vanishes at the first row and equals the miss at the second is added to the path. In the middle of the
interval the path is then known far better than by the miss itself, and the interpolation is compared with it. Without
velocities the path is the one that meets both rows, and the forces left out follow from the kink between two such paths.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from rso_lidar import units
from rso_lidar.errors import ScenarioError
from rso_lidar.orbit.ccsds.ephemeris_arc import DEGREE, EphemerisArc
from rso_lidar.orbit.epochs import format_utc
from rso_lidar.pose import dot, length

NOTICED_M = 0.05  # precision of a range of the sensor (Fuller et al.)
# Share of the distance from the Earth's centre beyond which states are no orbit: 7 km in low orbit, more than a set of
# elements is off after two days.
IMPOSSIBLE = 1e-3
# Error of the comparison, as a share of the miss that forces left out cause in an interval. With the wavelengths of tesseral
# gravity, h^4 a'' / 384 of a h^2 / 2 is 2 % at 5 minutes in low orbit.
_DOUBT = 0.1
_LEFT_OUT_M_S2 = 2e-4  # by tesseral gravity in low orbit; two positions alone do not show it
_MODELS = (units.EARTH_J2, 0.0)  # a table may be of two-body motion; the model with the smaller miss is taken
_PROBED = 8  # intervals by which the model is chosen
_MOST_INTERVALS = 4096
_BLOCK = 512  # intervals integrated at once, of similar length
_LOWEST = 0.9  # Earth radii; rows below are no orbit, and are not judged
_LEAST_BURN_M = 1.0  # doubt from which a burn is mentioned: free flight in low orbit has 1 m at 10 minutes
_SHOTS = 5  # iterations of the path through two positions: each shrinks the miss by (angle)^2 / 6


class IntervalErrors(NamedTuple):
    """Errors of interpolation in the middle of intervals between rows, in the order of time.

    Parameters
    ----------
    first : (interval,) number of the row before
    off_m : (interval,) distance of the interpolation from orbital motion [m], inf where rows are too far apart to tell
    doubt_m : (interval,) what the comparison itself may be wrong by [m]
    """

    first: np.ndarray
    off_m: np.ndarray
    doubt_m: np.ndarray


def check_row_spacing(arcs: Sequence[EphemerisArc], interpolation: str | None, degree: int | None) -> str:
    """Check that the rows of an ephemeris are close enough for its interpolation.

    Parameters
    ----------
    interpolation, degree : choice of the part; None for that of the file

    Returns
    -------
    what to warn of where the interpolation is off by more than `NOTICED_M`; empty otherwise

    Raises
    ------
    ScenarioError
        if the interpolation is off by more than `IMPOSSIBLE` of the distance from the Earth's centre
    """
    worst_m, remark = 0.0, ""
    for arc in arcs:
        method, order = arc.choose(interpolation, degree)
        errors = estimate_errors(arc, method, order)
        if not len(errors.first):
            continue
        sure_m = errors.off_m - errors.doubt_m
        radius_m = length(arc.position_m[errors.first])
        k = int(np.argmax(sure_m / radius_m))
        if sure_m[k] > IMPOSSIBLE * radius_m[k]:
            raise ScenarioError(f"{arc.where}: {_describe(arc, errors, k)}; {_advise(arc, method, order, errors, k)}")
        k = int(np.argmax(sure_m))
        if sure_m[k] > max(NOTICED_M, worst_m):
            worst_m, remark = float(sure_m[k]), f"{_describe(arc, errors, k)}; {_advise(arc, method, order, errors, k)}"
    return remark


def estimate_errors(arc: EphemerisArc, method: str, degree: int) -> IntervalErrors:
    """Estimate the error of interpolation in intervals between the rows of a segment, in its usable span.

    Of more than 4096 intervals, those that cover the greatest angles are taken and as many evenly spread.
    """
    span_s = np.diff(arc.time_s)
    middle_s = arc.time_s[:-1] + 0.5 * span_s
    radius_m = length(arc.position_m)
    low_m = np.minimum(radius_m[:-1], radius_m[1:])
    usable = (middle_s >= arc.begin_s) & (middle_s <= arc.end_s)
    if not usable.any():
        usable = (arc.time_s[:-1] <= arc.begin_s) & (arc.time_s[1:] >= arc.end_s)
    chosen = np.flatnonzero(usable & (low_m > _LOWEST * units.EARTH_RADIUS_M))
    angle = span_s * np.sqrt(units.EARTH_GM_M3_S2 / np.maximum(low_m, 1.0) ** 3)
    if len(chosen) > _MOST_INTERVALS:
        greatest = chosen[np.argsort(-angle[chosen], kind="stable")[: _MOST_INTERVALS // 2]]
        spread = chosen[np.linspace(0, len(chosen) - 1, _MOST_INTERVALS // 2).round().astype(int)]
        chosen = np.union1d(greatest, spread)
    if not len(chosen):
        return IntervalErrors(chosen, np.zeros(0), np.zeros(0))
    far = _are_far_apart(arc, chosen, angle[chosen])
    off_m, doubt_m = np.full(len(chosen), np.inf), np.zeros(len(chosen))
    near = chosen[~far]
    if len(near):
        position_m, velocity_m_s = _make_inertial(arc, method, degree)
        there = arc.interpolate(middle_s[near], method, degree)[0]
        if arc.frame == "itrs":
            there = _turn(there, middle_s[near] - arc.time_s[0])
        follow = _follow_states if arc.velocity_m_s is not None else _follow_positions
        some = near[:: -(-len(near) // _PROBED)]
        doubts_m = [float(follow(some, span_s, position_m, velocity_m_s, j2)[1].sum()) for j2 in _MODELS]
        j2 = _MODELS[int(np.argmin(doubts_m))]
        expected, doubt_m[~far] = follow(near, span_s, position_m, velocity_m_s, j2)
        off_m[~far] = length(there - expected)
    return IntervalErrors(chosen, off_m, doubt_m)


def _are_far_apart(arc: EphemerisArc, chosen: np.ndarray, angle: np.ndarray) -> np.ndarray:
    """Return where rows are more than a revolution apart; without velocities, a quarter of a circular one.

    Parameters
    ----------
    chosen : (interval,) number of the row before
    angle : (interval,) of a circular orbit at the height of the rows [rad]
    """
    if arc.velocity_m_s is None:
        return np.asarray(angle > 0.5 * np.pi)
    position_m, velocity_m_s = arc.position_m[chosen], arc.velocity_m_s[chosen]
    if arc.frame == "itrs":
        velocity_m_s = velocity_m_s + _cross_pole(position_m)
    per_m = 2.0 / length(position_m) - dot(velocity_m_s, velocity_m_s) / units.EARTH_GM_M3_S2
    motion_rad_s = np.sqrt(units.EARTH_GM_M3_S2 * np.maximum(per_m, 0.0) ** 3)  # 0 for an open orbit
    return np.asarray(motion_rad_s * (arc.time_s[chosen + 1] - arc.time_s[chosen]) > 2.0 * np.pi)


def _make_inertial(arc: EphemerisArc, method: str, degree: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the rows in axes that do not turn; missing velocities are those of the interpolation."""
    position_m = arc.position_m
    velocity_m_s = arc.velocity_m_s
    if velocity_m_s is None:
        velocity_m_s = arc.interpolate(arc.time_s, method, degree)[1]
    if arc.frame != "itrs":
        return position_m, velocity_m_s
    since_s = arc.time_s - arc.time_s[0]
    return _turn(position_m, since_s), _turn(velocity_m_s + _cross_pole(position_m), since_s)


def _cross_pole(position_m: np.ndarray) -> np.ndarray:
    """Return the velocity [m/s] of places that turn with the Earth, omega x r."""
    x, y, _ = position_m.T
    return np.stack([-y, x, np.zeros_like(x)], axis=-1) * units.EARTH_ROTATION_RAD_S


def _turn(vectors: np.ndarray, since_s: np.ndarray) -> np.ndarray:
    """Turn vectors in Earth-fixed axes to the axes at a start; polar motion and precession do not matter for errors."""
    c, s = np.cos(units.EARTH_ROTATION_RAD_S * since_s), np.sin(units.EARTH_ROTATION_RAD_S * since_s)
    x, y, z = vectors.T
    return np.stack([c * x - s * y, s * x + c * y, z], axis=-1)


def _follow_states(
    first: np.ndarray, span_s: np.ndarray, position_m: np.ndarray, velocity_m_s: np.ndarray, j2: float
) -> tuple[np.ndarray, np.ndarray]:
    """Return the place in the middle of intervals (interval, 3) [m], and its doubt (interval,) [m].

    Parameters
    ----------
    first : (interval,) number of the row before
    span_s : (row - 1,) time between rows [s]
    position_m, velocity_m_s : (row, 3) in axes that do not turn
    j2 : of the Earth's gravity [1]; 0 leaves it out
    """
    h = span_s[first][:, None]
    middle, end, end_velocity = _integrate(position_m[first], velocity_m_s[first], span_s[first], j2)
    miss, change = position_m[first + 1] - end, velocity_m_s[first + 1] - end_velocity
    return middle + 0.5 * miss - 0.125 * h * change, _DOUBT * length(miss)


def _follow_positions(
    first: np.ndarray, span_s: np.ndarray, position_m: np.ndarray, velocity_m_s: np.ndarray, j2: float
) -> tuple[np.ndarray, np.ndarray]:
    """Return the place in the middle of intervals (interval, 3) [m], and its doubt (interval,) [m].

    Parameters
    ----------
    first, span_s, position_m, j2 : as for `_follow_states`
    velocity_m_s : (row, 3) where the search for a path begins
    """
    # The next interval, or the one before for the last, shows the kink.
    rows = len(span_s)
    beside = np.where(first + 1 < rows, first + 1, first - 1) if rows > 1 else first
    flown = np.union1d(first, beside)
    start, target, h = np.array(velocity_m_s[flown]), position_m[flown + 1], span_s[flown]
    for _ in range(_SHOTS):
        end = _integrate(position_m[flown], start, h, j2)[1]
        start += (target - end) / h[:, None]
    middle, end, end_velocity = _integrate(position_m[flown], start, h, j2)
    at = np.searchsorted(flown, first)
    miss = length(target - end)[at]
    h1 = span_s[first]
    if rows == 1:
        return middle[at], miss + _LEFT_OUT_M_S2 * h1**2 / 8.0
    low = np.searchsorted(flown, np.minimum(first, beside))
    kink = start[low + 1] - end_velocity[low]
    push = kink / (0.5 * (h[low] + h[low + 1]))[:, None]
    bow = push * (h1**2 / 8.0)[:, None]
    return middle[at] - bow, miss + _DOUBT * length(bow)


def _integrate(
    position_m: np.ndarray, velocity_m_s: np.ndarray, span_s: np.ndarray, j2: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Integrate states (interval, 3) with the Earth's gravity, of a mass and `j2`, over spans (interval,).

    Parameters
    ----------
    position_m, velocity_m_s : (interval, 3) states at the begin
    span_s : (interval,) [s]
    j2 : of the Earth's gravity [1]; 0 leaves it out

    Returns
    -------
    position in the middle, position and velocity at the end (interval, 3) [m], [m/s]
    """
    from scipy.integrate import solve_ivp

    order = np.argsort(span_s / length(position_m) ** 1.5, kind="stable")
    tables = np.empty((3, len(span_s), 3))
    for k in range(0, len(order), _BLOCK):
        rows = order[k : k + _BLOCK]
        h = span_s[rows][None, :, None]
        shape = 2, len(rows), 3

        def derivative(_: float, x: np.ndarray, h: np.ndarray = h, shape: tuple[int, ...] = shape) -> np.ndarray:
            place, speed = x.reshape(shape)
            rates: np.ndarray = np.stack([speed, _gravity(place, j2)]) * h
            return rates.ravel()

        x = np.stack([position_m[rows], velocity_m_s[rows]])
        close = np.broadcast_to(np.array([1e-4, 1e-7])[:, None, None], shape).ravel()  # [m], [m/s]
        halves = []
        for _ in range(2):
            solution = solve_ivp(
                derivative, (0.0, 0.5), x.ravel(), method="DOP853", rtol=1e-11, atol=close, t_eval=[0.5]
            )
            x = solution.y[:, -1].reshape(shape)
            halves.append(x)
        tables[:, rows] = halves[0][0], *halves[1]
    return tables[0], tables[1], tables[2]


def _gravity(position_m: np.ndarray, j2: float) -> np.ndarray:
    """Return the acceleration by the Earth's mass and its flattening about z (…, 3) [m/s2] (Vallado 4th ed., eq. 8-30)."""
    # A path through the Earth is no orbit; the limit keeps its acceleration finite.
    r2 = np.maximum(dot(position_m, position_m), (0.5 * units.EARTH_RADIUS_M) ** 2)[..., None]
    flat = 1.5 * j2 * units.EARTH_RADIUS_M**2 / r2
    polar = 5.0 * position_m[..., 2:] ** 2 / r2
    factor = 1.0 - flat * (polar - np.array([1.0, 1.0, 3.0]))
    acceleration: np.ndarray = -units.EARTH_GM_M3_S2 / (r2 * np.sqrt(r2)) * position_m * factor
    return acceleration


def _describe(arc: EphemerisArc, errors: IntervalErrors, k: int) -> str:
    """Describe the error in one interval, which lies between two rows."""
    first = int(errors.first[k])
    begin_s, gap_s = float(arc.time_s[first]), float(arc.time_s[first + 1] - arc.time_s[first])
    since = f"time_s = {begin_s:g}" if arc.start_utc is None else format_utc(arc.start_utc, begin_s)
    rows = f"between the row of {since} and the next, {gap_s:g} s later"
    if np.isinf(errors.off_m[k]):
        return f"no orbit can be interpolated {rows}"
    return f"interpolation is off by some {_format_length(errors.off_m[k])} {rows}"


def _advise(arc: EphemerisArc, method: str, degree: int, errors: IntervalErrors, k: int) -> str:
    """Return what to do about the error in one interval: another degree where that helps, else other rows."""
    natural = "lagrange" if arc.velocity_m_s is None else "hermite"
    for other in dict.fromkeys((method, natural)):
        choice, order = arc.choose(other, DEGREE)
        if (choice, order) == (method, degree) or (choice == method and order < degree):
            continue
        off_m = estimate_errors(arc, choice, order).off_m[k]
        if off_m < 0.5 * errors.off_m[k]:
            change = "" if choice == method else f"`interpolation` to '{choice}' and "
            return f"set {change}`degree` to {order}, for an error of {_format_length(off_m)}"
    # The polynomial reaches over a burn from the intervals beside it, whose own rows show none.
    beside = np.abs(errors.first - errors.first[k]) <= (degree + 1) // 2
    is_burn = errors.doubt_m[k] < errors.off_m[k] and errors.doubt_m[beside].max() > _LEAST_BURN_M
    burn = ", begin a new segment at each burn" if is_burn else ""
    return f"take a finer table{burn}, or 'numerical' from one of its states"


def _format_length(length_m: float) -> str:
    if length_m < units.KM:
        return f"{length_m:.2g} m"
    return f"{length_m / units.KM:,.{0 if length_m >= 100.0 * units.KM else 1}f} km"
