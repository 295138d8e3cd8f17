"""Two-body motion in universal variables: one form of Kepler's equation for every conic, the parabola included.

Battin, An Introduction to the Mathematics and Methods of Astrodynamics, sec. 4.5, with Stumpff functions (Vallado 4th ed.
alg. 8).
"""

from __future__ import annotations

import math

import numpy as np

from rso_lidar import units

GM = units.EARTH_GM_M3_S2
_EPS = float(np.finfo(float).eps)
_MAX_STEPS = 100
_BLOCK = 4_096  # epochs solved at a time: fits a processor's cache


def inverse_semi_major_axis(position_m: np.ndarray, velocity_m_s: np.ndarray) -> float:
    """Return 1 / a [1/m] by the vis-viva equation: zero on a parabola, negative on a hyperbola."""
    return float(2.0 / np.linalg.norm(position_m) - velocity_m_s @ velocity_m_s / GM)


def propagate_universal(
    r0_vector: np.ndarray, v0_vector: np.ndarray, dt_s: np.ndarray, alpha: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Propagate one state by universal variables, on any conic.

    Parameters
    ----------
    r0_vector, v0_vector : (3,) state at the epoch [m], [m/s]
    dt_s : (time,) time since the epoch [s]
    alpha : inverse semi-major axis [1/m]

    Returns
    -------
    positions, velocities : (time, 3) [m], [m/s]
    bad : (time,) mask of epochs that did not converge
    """
    dt = dt_s
    if alpha > 0.0:
        period = math.tau / math.sqrt(GM * alpha**3)
        if math.isfinite(period):
            dt = dt - period * np.round(dt / period)
    else:  # count from perigee, because across it the terms of an open orbit cancel
        r0_vector, v0_vector, since_perigee_s = _shift_to_perigee(r0_vector, v0_vector, alpha)
        dt = dt + since_perigee_s
    r0 = float(np.linalg.norm(r0_vector))
    sigma0 = 0.0 if alpha <= 0.0 else float(r0_vector @ v0_vector) / math.sqrt(GM)
    perigee = perigee_distance_m(r0_vector, v0_vector)
    blocks = [dt[k : k + _BLOCK] for k in range(0, len(dt), _BLOCK)] or [dt]
    solved = [_universal_anomaly(block, r0, sigma0, perigee, alpha) for block in blocks]
    chi, bad = (np.concatenate(column) for column in zip(*solved, strict=True))
    u0, u1, u2, _ = _universal_functions(chi, alpha)
    r = r0 * u0 + sigma0 * u1 + u2
    f, g = 1.0 - u2 / r0, (r0 * u1 + sigma0 * u2) / math.sqrt(GM)
    f_dot, g_dot = -math.sqrt(GM) * u1 / (r * r0), 1.0 - u2 / r
    positions = f[:, None] * r0_vector + g[:, None] * v0_vector
    velocities = f_dot[:, None] * r0_vector + g_dot[:, None] * v0_vector
    return positions, velocities, bad


def perigee_distance_m(position_m: np.ndarray, velocity_m_s: np.ndarray) -> float:
    """Return the distance of perigee from the Earth's centre [m]."""
    h = np.cross(position_m, velocity_m_s)
    e = np.linalg.norm(np.cross(velocity_m_s, h) / GM - position_m / np.linalg.norm(position_m))
    return float(h @ h / GM / (1.0 + e))


def _shift_to_perigee(r: np.ndarray, v: np.ndarray, alpha: float) -> tuple[np.ndarray, np.ndarray, float]:
    """Move the epoch of an open orbit to its perigee: position [m] and velocity [m/s] there, and the time since it [s].

    Parameters
    ----------
    r, v : (3,) state [m], [m/s]
    alpha : inverse semi-major axis [1/m]
    """
    h = np.cross(r, v)
    to_perigee = np.cross(v, h) / GM - r / np.linalg.norm(r)
    e = float(np.linalg.norm(to_perigee))
    perigee = float(h @ h) / GM / (1.0 + e)
    x = to_perigee / e
    y = np.cross(h / np.linalg.norm(h), x)
    root = math.sqrt(-alpha)
    sigma = float(r @ v) / math.sqrt(GM)  # = e U1
    chi = math.asinh(sigma * root / e) / root if root else sigma / e
    _, u1, _, u3 = _universal_functions(np.array([chi]), alpha)
    speed = float(np.linalg.norm(h)) / perigee
    return perigee * x, speed * y, float((perigee * u1 + u3)[0]) / math.sqrt(GM)


def _universal_anomaly(
    dt_s: np.ndarray, r0: float, sigma0: float, perigee: float, alpha: float
) -> tuple[np.ndarray, np.ndarray]:
    """Solve for the universal anomaly.

    Newton's method on Battin eq. 4.87, sqrt(GM) dt = r0 U1 + sigma0 U2 + U3. Its slope is the radius, which is
    positive, so the root is bracketed by 0 and sqrt(GM) dt / perigee. A step that leaves the bracket is replaced by a
    bisection.

    Parameters
    ----------
    dt_s : (time,) time since the epoch [s]
    r0 : distance at the epoch [m]
    sigma0 : r v / sqrt(GM) at the epoch [sqrt(m)]
    perigee : distance of perigee [m]
    alpha : inverse semi-major axis [1/m]

    Returns
    -------
    chi : (time,) [sqrt(m)]
    bad : (time,) mask of epochs that did not converge
    """
    target = math.sqrt(GM) * dt_s
    far = target / perigee
    if alpha > 0.0:  # half a revolution in time is less than one in eccentric anomaly
        far = np.clip(far, -math.tau / math.sqrt(alpha), math.tau / math.sqrt(alpha))
        start = target * alpha if alpha * r0 > 1e-6 else target / r0
    else:  # from perigee M = e sinh H - H >= H^3 / 6, and >= sinh H / 2 where H > 2.2: Newton converges from above
        start = far = np.copysign(np.minimum(np.abs(far), np.cbrt(6.0 * np.abs(target))), target)
        if alpha < 0.0:
            root = math.sqrt(-alpha)
            most = np.maximum(np.arcsinh(2.0 * np.abs(target) * root**3), 2.2) / root
            start = far = np.clip(far, -most, most)
    low, high = np.minimum(far, 0.0), np.maximum(far, 0.0)
    chi = np.clip(start, low, high)
    open_ = np.arange(len(dt_s))
    for _ in range(_MAX_STEPS):
        x, goal = chi[open_], target[open_]
        u0, u1, u2, u3 = _universal_functions(x, alpha)
        terms = (r0 * u1, sigma0 * u2, u3)
        miss = terms[0] + terms[1] + terms[2] - goal
        noise = np.abs(terms[0]) + np.abs(terms[1]) + np.abs(terms[2]) + np.abs(goal)
        low[open_] = np.where(miss <= 0.0, x, low[open_])
        high[open_] = np.where(miss >= 0.0, x, high[open_])
        stepped = x - miss / (r0 * u0 + sigma0 * u1 + u2)
        middle = 0.5 * (low[open_] + high[open_])
        inside = (stepped >= low[open_]) & (stepped <= high[open_])
        after = np.where(inside, stepped, middle)
        rounding = 4.0 * _EPS * (1.0 + math.sqrt(abs(alpha)) * np.abs(x))  # rounding of the argument grows in sinh
        done = (np.abs(miss) <= rounding * noise) | (np.abs(after - x) <= 4.0 * _EPS * np.abs(x))
        chi[open_] = after
        open_ = open_[~done]
        if not len(open_):
            break
    bad = np.zeros(len(dt_s), dtype=bool)
    bad[open_] = True
    return chi, bad | ~np.isfinite(chi)


def _universal_functions(chi: np.ndarray, alpha: float) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return Battin's U0 to U3 of chi (time,): chi^k times Stumpff's c_k(alpha chi^2)."""
    c2, c3 = stumpff(alpha * chi * chi)
    u2, u3 = chi * chi * c2, chi * chi * chi * c3
    return 1.0 - alpha * u2, chi - alpha * u3, u2, u3


def stumpff(z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Evaluate Stumpff's functions c2 and c3 for an argument of either sign.

    c2(z) = (1 - cos sqrt z) / z, c3(z) = (sqrt z - sin sqrt z) / sqrt z^3. Within |z| = 1 they are series to z^8, exact to
    rounding; beyond they are in closed form.
    """
    z = np.asarray(z, dtype=float)
    c2, c3 = np.full_like(z, np.nan), np.full_like(z, np.nan)
    near = np.abs(z) <= 1.0
    if near.any():
        small = z[near]
        even, odd = np.zeros_like(small), np.zeros_like(small)
        for k in range(8, -1, -1):
            even = 1.0 / math.factorial(2 * k + 2) - small * even
            odd = 1.0 / math.factorial(2 * k + 3) - small * odd
        c2[near], c3[near] = even, odd
    for sign, wave in ((1.0, np.sin), (-1.0, np.sinh)):
        beyond = sign * z > 1.0
        if beyond.any():
            size = sign * z[beyond]
            root = np.sqrt(size)
            c2[beyond] = 2.0 * wave(0.5 * root) ** 2 / size
            c3[beyond] = sign * (root - wave(root)) / (size * root)
    return c2, c3
