"""Izzo's solution of Lambert's problem in scaled time: x of every orbit that takes a given time.

Izzo, Revisiting Lambert's problem, Celest. Mech. Dyn. Astr. 121 (2015); equation numbers are his. Lancaster and
Blanchard's x is found by Householder steps inside a bracket.
"""

from __future__ import annotations

import math
from typing import Literal

import numpy as np

Branch = Literal["low", "high"]

_NEAR_PARABOLA = 0.1  # |x - 1| within which Battin's series replaces the closed form
_STEPS = 100
_EPS = float(np.finfo(float).eps)


def compute_scaled_time(x: float, q: float, lam: float, revolutions: int) -> float:
    """Return Izzo's scaled time T of an orbit (eqs. 18 and 20); q is chord over half perimeter, 1 - lambda^2."""
    y = math.sqrt(q + lam * lam * x * x)
    eta = y - lam * x if lam * x <= 0.0 else q / (y + lam * x)
    if abs(x - 1.0) < _NEAR_PARABOLA:
        one_less = 1.0 - lam if lam <= 0.0 else q / (1.0 + lam)
        at, term, series = 0.5 * (one_less - x * eta), 1.0, 1.0
        for k in range(80):  # 2F1(3, 1; 5/2; at), |at| < 0.24
            term *= (3.0 + k) / (2.5 + k) * at
            series += term
            if abs(term) < 0.1 * _EPS:
                break
        time = 0.5 * (4.0 / 3.0 * eta**3 * series + 4.0 * lam * eta)
        return time if revolutions == 0 else time + revolutions * math.pi / (1.0 - x * x) ** 1.5
    if x < 1.0:
        root = math.sqrt((1.0 - x) * (1.0 + x))
        angle = math.atan2(eta * root, x * y + lam * root * root) + revolutions * math.pi
        return (angle / root - x + lam * y) / (root * root)
    root = math.sqrt((x - 1.0) * (x + 1.0))
    less = x - lam * y if lam <= 0.0 else q * ((1.0 + lam * lam) * x * x - lam * lam) / (x + lam * y)
    return (less - math.asinh(eta * root) / root) / (root * root)


def _slopes(x: float, time: float, q: float, lam: float) -> tuple[float, float, float]:
    """Return T', T'' and T''' at x (eq. 22)."""
    y = math.sqrt(q + lam * lam * x * x)
    across = (1.0 - x) * (1.0 + x)
    if abs(across) < 1e-7:  # the limit at the parabola is enough for a step
        return 0.4 * (lam**5 - 1.0), 1.0, 0.0
    first = (3.0 * time * x - 2.0 + 2.0 * lam**3 * x / y) / across
    second = (3.0 * time + 5.0 * x * first + 2.0 * q * lam**3 / y**3) / across
    third = (7.0 * x * second + 8.0 * first - 6.0 * q * lam**5 * x / y**5) / across
    return first, second, third


def find_all_orbits(time: float, q: float, lam: float) -> list[tuple[int, Branch | None, float]]:
    """Find every orbit that takes the scaled time: revolutions, branch and x."""
    roots: list[tuple[int, Branch | None, float]] = []
    for revolutions in range(int(time / math.pi) + 1):
        orbits = find_orbits(time, q, lam, revolutions)
        if not orbits:
            break
        roots += [(revolutions, branch, x) for branch, x in orbits]
    return roots


def find_orbits(time: float, q: float, lam: float, revolutions: int) -> list[tuple[Branch | None, float]]:
    """Find the orbits of this number of whole revolutions that take the scaled time: none, one or two, as branch and x."""
    if revolutions == 0:
        return [(None, _solve_single(time, q, lam))]
    least_x = _find_least_time(q, lam, revolutions)
    if time < compute_scaled_time(least_x, q, lam, revolutions):
        return []
    turn = revolutions * math.pi
    slow = ((turn + math.pi) / (8.0 * time)) ** (2.0 / 3.0)
    fast = (8.0 * time / turn) ** (2.0 / 3.0)
    pair = [
        _solve(time, q, lam, revolutions, (slow - 1.0) / (slow + 1.0), (-1.0, least_x), -1.0),
        _solve(time, q, lam, revolutions, (fast - 1.0) / (fast + 1.0), (least_x, 1.0), 1.0),
    ]
    pair.sort(key=abs)  # the energy is (x^2 - 1) gm / s
    return [("low", pair[0]), ("high", pair[1])]


def _solve_single(time: float, q: float, lam: float) -> float:
    """Find x of the orbit of less than one revolution. T falls from infinity at x = -1 to 0 at infinity."""
    at_0, at_1 = compute_scaled_time(0.0, q, lam, 0), compute_scaled_time(1.0, q, lam, 0)
    if time >= at_0:
        start = (at_0 / time) ** (2.0 / 3.0) - 1.0
    elif time > at_1:
        start = 2.0 ** (math.log(time / at_0) / math.log(at_1 / at_0)) - 1.0
    else:
        start = 1.0 + 2.5 * at_1 * (at_1 - time) / (time * max(1.0 - lam**5, _EPS))
    beyond = max(2.0, 2.0 * start)
    while compute_scaled_time(beyond, q, lam, 0) > time:
        beyond *= 4.0
    return _solve(time, q, lam, 0, start, (-1.0, beyond), -1.0)


def _solve(
    time: float, q: float, lam: float, revolutions: int, start: float, bracket: tuple[float, float], slope: float
) -> float:
    """Solve T(x) = `time` inside a bracket (low and high x) by Householder's third-order method."""
    low, high = bracket
    x = start if low < start < high else 0.5 * (low + high)
    for _ in range(_STEPS):
        now = compute_scaled_time(x, q, lam, revolutions)
        miss = now - time
        if (miss > 0.0) == (slope > 0.0):
            high = x
        else:
            low = x
        first, second, third = _slopes(x, now, q, lam)
        below = first * (first * first - miss * second) + third * miss * miss / 6.0
        after = x - miss * (first * first - 0.5 * miss * second) / below if below else math.nan
        if not low < after < high:
            after = 0.5 * (low + high)
        if abs(after - x) <= 2.0 * _EPS * max(abs(x), 1e-3) or miss == 0.0:
            return x if miss == 0.0 else after
        x = after
    return x


def _find_least_time(q: float, lam: float, revolutions: int) -> float:
    """Find x of the least T for this number of revolutions: T' = 0, where T'' > 0 throughout."""
    low, high, x = -1.0, 1.0, 0.0
    for _ in range(_STEPS):
        first, second, third = _slopes(x, compute_scaled_time(x, q, lam, revolutions), q, lam)
        if first > 0.0:
            high = x
        else:
            low = x
        after = x - 2.0 * first * second / (2.0 * second * second - first * third)  # Halley
        if not low < after < high:
            after = 0.5 * (low + high)
        if abs(after - x) <= 4.0 * _EPS:
            return after
        x = after
    return x
