"""Two-body motion about the Earth: from osculating elements, or from a state; one solver for every conic.

The universal form of Kepler's equation with Stumpff functions (Battin, An Introduction to the Mathematics and Methods of
Astrodynamics, 4.5; Vallado 4th ed. alg. 8) has no singular eccentricity or inclination. GM is `units.EARTH_GM_M3_S2`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal, Self

import numpy as np
from pydantic import model_validator
from scipy.spatial.transform import Rotation

from rso_lidar import units
from rso_lidar.errors import PropagationError
from rso_lidar.motion.epochs import Epochs
from rso_lidar.part import Instant, NotNegative, Number, Part, Vector
from rso_lidar.pose import turned
from rso_lidar.records import BodyState

GM = units.EARTH_GM_M3_S2
_EPS = float(np.finfo(float).eps)
_MAX_STEPS = 100
_BLOCK = 16_384  # epochs solved at a time: what fits a processor's cache


class Kepler(Part):
    """Two-body motion from osculating elements in GCRS axes at `epoch_utc`. A hyperbola has e > 1 and a negative a."""

    type: Literal["kepler"] = "kepler"
    epoch_utc: Instant
    semi_major_axis_km: Number
    eccentricity: NotNegative
    inclination_deg: Number
    raan_deg: Number
    argument_of_perigee_deg: Number
    true_anomaly_deg: Number | None = None
    mean_anomaly_deg: Number | None = None

    @model_validator(mode="after")
    def _one_conic(self) -> Self:
        a_km, e = self.semi_major_axis_km, self.eccentricity
        if e == 1.0:
            raise ValueError("eccentricity: a parabola has no semi-major axis: give its motion as type 'state'")
        if a_km == 0.0 or (a_km > 0.0) != (e < 1.0):
            sign = "positive for an ellipse (eccentricity < 1)" if e < 1.0 else "negative for a hyperbola"
            raise ValueError(f"semi_major_axis_km: {a_km:g} with eccentricity {e:g}: make it {sign}")
        if not 0.0 <= self.inclination_deg <= 180.0:
            raise ValueError(
                f"inclination_deg: {self.inclination_deg:g} is outside 0 to 180: turn raan_deg by 180 instead"
            )
        if (self.true_anomaly_deg is None) == (self.mean_anomaly_deg is None):
            raise ValueError("needs exactly one of true_anomaly_deg and mean_anomaly_deg: give one of them")
        if self.perigee_m < units.EARTH_RADIUS_M:
            low_km = (units.EARTH_RADIUS_M - self.perigee_m) / units.KM
            raise ValueError(
                f"semi_major_axis_km: the perigee lies {low_km:.1f} km below the Earth's surface: raise it"
            )
        if self.true_anomaly_deg is not None and 1.0 + e * math.cos(self.true_anomaly_deg * units.DEG) <= 0.0:
            limit = math.acos(-1.0 / e) / units.DEG
            raise ValueError(f"true_anomaly_deg: lies beyond the asymptote: keep it within {limit:.3f} of perigee")
        return self

    @property
    def perigee_m(self) -> float:
        """Return the perigee's distance from the Earth's centre [m]."""
        return self.semi_major_axis_km * units.KM * (1.0 - self.eccentricity)

    def at_epoch(self) -> BodyState:
        """Return the state at `epoch_utc` (Vallado 4th ed. alg. 10)."""
        e = self.eccentricity
        parameter = self.perigee_m * (1.0 + e)
        anomaly = (self.true_anomaly_deg or 0.0) * units.DEG
        c, s = math.cos(anomaly), math.sin(anomaly)
        position = parameter / (1.0 + e * c) * np.array([c, s, 0.0])
        velocity = math.sqrt(GM / parameter) * np.array([-s, e + c, 0.0])
        if self.mean_anomaly_deg is not None:  # fly there from perigee
            mean = self.mean_anomaly_deg if e > 1.0 else math.remainder(self.mean_anomaly_deg, 360.0)
            time_s = mean * units.DEG * math.sqrt(abs(self.semi_major_axis_km * units.KM) ** 3 / GM)
            positions, velocities = propagate(position, velocity, np.array([time_s]))
            position, velocity = positions[0], velocities[0]
        angles = np.array([self.raan_deg, self.inclination_deg, self.argument_of_perigee_deg]) * units.DEG
        inertial_from_perifocal = Rotation.from_euler("ZXZ", angles)
        return BodyState(turned(inertial_from_perifocal, position), turned(inertial_from_perifocal, velocity))

    def states(self, epochs: Epochs) -> BodyState:
        """Return position [m] and velocity [m/s] (time, 3) in GCRS axes."""
        start = self.at_epoch()
        return BodyState(*propagate(start.position_m, start.velocity_m_s, epochs.since(self.epoch_utc)))


class State(Part):
    """Two-body motion from a position and a velocity in GCRS axes at `epoch_utc`."""

    type: Literal["state"] = "state"
    epoch_utc: Instant
    position_m: Vector
    velocity_m_s: Vector

    @model_validator(mode="after")
    def _in_space(self) -> Self:
        radius = float(np.linalg.norm(self.position_m))
        if radius < units.EARTH_RADIUS_M:
            raise ValueError(
                f"position_m: is {radius:g} m from the Earth's centre, inside the Earth: give metres from the centre"
            )
        speed = float(np.linalg.norm(self.velocity_m_s))
        if np.linalg.norm(np.cross(self.position_m, self.velocity_m_s)) <= 1e-9 * radius * speed:
            raise ValueError("velocity_m_s: is along position_m, a fall through the Earth's centre: give it a side")
        return self

    def states(self, epochs: Epochs) -> BodyState:
        """Return position [m] and velocity [m/s] (time, 3) in GCRS axes."""
        position, velocity = np.array(self.position_m), np.array(self.velocity_m_s)
        return BodyState(*propagate(position, velocity, epochs.since(self.epoch_utc)))


def semi_major_axis_m(position_m: np.ndarray, velocity_m_s: np.ndarray) -> float:
    """Return the osculating semi-major axis [m], negative on a hyperbola (vis-viva)."""
    alpha = _inverse_axis(np.asarray(position_m, dtype=float), np.asarray(velocity_m_s, dtype=float))
    return 1.0 / alpha if alpha else math.inf


def _inverse_axis(position_m: np.ndarray, velocity_m_s: np.ndarray) -> float:
    return float(2.0 / np.linalg.norm(position_m) - velocity_m_s @ velocity_m_s / GM)


@dataclass(frozen=True)
class Elements:
    """Osculating elements for printing. On a circle the perigee stands at the node, on the equator the node at +x."""

    semi_major_axis_m: float
    eccentricity: float
    inclination_rad: float
    raan_rad: float
    argument_of_perigee_rad: float
    true_anomaly_rad: float
    period_s: float
    perigee_altitude_m: float
    apogee_altitude_m: float


def elements(position_m: np.ndarray, velocity_m_s: np.ndarray) -> Elements:
    """Return the osculating elements of a state in GCRS axes (Vallado 4th ed. alg. 9); infinite where a conic is open."""
    r, v = np.asarray(position_m, dtype=float), np.asarray(velocity_m_s, dtype=float)
    h = np.cross(r, v)
    pole = h / np.linalg.norm(h)
    to_perigee = np.cross(v, h) / GM - r / np.linalg.norm(r)
    e = float(np.linalg.norm(to_perigee))
    to_node = np.array([-pole[1], pole[0], 0.0])
    flat = np.linalg.norm(to_node) < 8.0 * _EPS  # the node of an equatorial orbit is nowhere: take +x
    to_node = np.array([1.0, 0.0, 0.0]) if flat else to_node
    if e < 8.0 * _EPS:
        to_perigee = to_node

    def angle(start: np.ndarray, end: np.ndarray) -> float:
        """Return the angle from start to end about the pole [rad], in [0, 2 pi)."""
        return float(np.arctan2(pole @ np.cross(start, end), start @ end) % math.tau)

    alpha = _inverse_axis(r, v)
    perigee = float(h @ h) / GM / (1.0 + e)
    closed = alpha > 0.0
    return Elements(
        semi_major_axis_m=semi_major_axis_m(r, v),
        eccentricity=e,
        inclination_rad=float(np.arctan2(np.hypot(pole[0], pole[1]), pole[2])),
        raan_rad=float(np.arctan2(to_node[1], to_node[0]) % math.tau),
        argument_of_perigee_rad=angle(to_node, to_perigee),
        true_anomaly_rad=angle(to_perigee, r),
        period_s=math.tau / math.sqrt(GM * alpha**3) if closed else math.inf,
        perigee_altitude_m=perigee - units.EARTH_RADIUS_M,
        apogee_altitude_m=2.0 / alpha - perigee - units.EARTH_RADIUS_M if closed else math.inf,
    )


def propagate(position_m: np.ndarray, velocity_m_s: np.ndarray, dt_s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return positions [m] and velocities [m/s] (time, 3) after `dt_s` (time) [s] of two-body motion, either way in time.

    An epoch whose Kepler equation did not converge raises `PropagationError` with the mask of those.

    >>> radius = 42_164e3
    >>> speed = (units.EARTH_GM_M3_S2 / radius) ** 0.5
    >>> quarter = 0.5 * math.pi * radius / speed
    >>> there, _ = propagate(np.array([radius, 0, 0]), np.array([0, speed, 0]), np.array([quarter]))
    >>> bool(np.allclose(there, [[0, radius, 0]], atol=1e-6))
    True
    """
    r0_vector, v0_vector = np.asarray(position_m, dtype=float), np.asarray(velocity_m_s, dtype=float)
    dt = np.atleast_1d(np.asarray(dt_s, dtype=float))
    alpha = _inverse_axis(r0_vector, v0_vector)
    if alpha > 0.0:
        period = math.tau / math.sqrt(GM * alpha**3)
        if math.isfinite(period):
            dt = dt - period * np.round(dt / period)
    else:  # count from perigee: across it the terms of an open orbit would cancel
        r0_vector, v0_vector, since_perigee_s = _from_perigee(r0_vector, v0_vector, alpha)
        dt = dt + since_perigee_s
    r0 = float(np.linalg.norm(r0_vector))
    sigma0 = 0.0 if alpha <= 0.0 else float(r0_vector @ v0_vector) / math.sqrt(GM)
    perigee = _perigee(r0_vector, v0_vector)
    blocks = [dt[k : k + _BLOCK] for k in range(0, len(dt), _BLOCK)] or [dt]
    solved = [_universal_anomaly(block, r0, sigma0, perigee, alpha) for block in blocks]
    chi, bad = (np.concatenate(column) for column in zip(*solved, strict=True))
    if bad.any():
        first = float(np.atleast_1d(dt_s)[np.argmax(bad)])
        raise PropagationError(
            f"kepler: no state at {int(bad.sum())} of {len(bad)} epochs, first {first:g} s from the epoch of the elements: "
            "ask for epochs nearer to it",
            bad,
        )
    u0, u1, u2, _ = _universal_functions(chi, alpha)
    r = r0 * u0 + sigma0 * u1 + u2
    f, g = 1.0 - u2 / r0, (r0 * u1 + sigma0 * u2) / math.sqrt(GM)
    f_dot, g_dot = -math.sqrt(GM) * u1 / (r * r0), 1.0 - u2 / r
    positions = f[:, None] * r0_vector + g[:, None] * v0_vector
    velocities = f_dot[:, None] * r0_vector + g_dot[:, None] * v0_vector
    return positions, velocities


def _perigee(position_m: np.ndarray, velocity_m_s: np.ndarray) -> float:
    h = np.cross(position_m, velocity_m_s)
    e = np.linalg.norm(np.cross(velocity_m_s, h) / GM - position_m / np.linalg.norm(position_m))
    return float(h @ h / GM / (1.0 + e))


def _from_perigee(r: np.ndarray, v: np.ndarray, alpha: float) -> tuple[np.ndarray, np.ndarray, float]:
    """Return an open orbit's position [m] and velocity [m/s] at perigee, and the time since it [s]."""
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
    """Return the universal anomaly chi (time) [sqrt(m)] at dt, and the mask of epochs that did not converge.

    Newton on Battin eq. 4.87, sqrt(GM) dt = r0 U1 + sigma0 U2 + U3, whose slope is the radius: it only grows, so a root is
    bracketed by 0 and sqrt(GM) dt / perigee, and a step that leaves the bracket is replaced by a bisection.
    """
    target = math.sqrt(GM) * dt_s
    far = target / perigee
    if alpha > 0.0:  # reduced to half a revolution in time, which is less than one in eccentric anomaly
        far = np.clip(far, -math.tau / math.sqrt(alpha), math.tau / math.sqrt(alpha))
        start = target * alpha if alpha * r0 > 1e-6 else target / r0
    else:  # from perigee mean = e sinh H - H, at least H^3 / 6, and sinh H / 2 where H > 2.2: Newton comes down to it
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
        rounding = 4.0 * _EPS * (1.0 + math.sqrt(abs(alpha)) * np.abs(x))  # an argument's rounding grows in sinh
        done = (np.abs(miss) <= rounding * noise) | (np.abs(after - x) <= 4.0 * _EPS * np.abs(x))
        chi[open_] = after
        open_ = open_[~done]
        if not len(open_):
            break
    bad = np.zeros(len(dt_s), dtype=bool)
    bad[open_] = True
    return chi, bad | ~np.isfinite(chi)


def _universal_functions(chi: np.ndarray, alpha: float) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return Battin's U0 to U3 of chi (time): chi^k times Stumpff's c_k(alpha chi^2)."""
    c2, c3 = stumpff(alpha * chi * chi)
    u2, u3 = chi * chi * c2, chi * chi * chi * c3
    return 1.0 - alpha * u2, chi - alpha * u3, u2, u3


def stumpff(z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return Stumpff's c2(z) = (1 - cos sqrt z) / z and c3(z) = (sqrt z - sin sqrt z) / sqrt z^3, for z of either sign.

    Within |z| = 1 by their series to z^8, exact to rounding; beyond in closed form.
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
