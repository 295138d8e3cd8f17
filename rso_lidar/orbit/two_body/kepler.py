"""Two-body motion, by default about the Earth, from osculating elements or from a state, on every conic.

An ellipse is solved without iteration for the change of its eccentric anomaly. Every other conic is solved by universal
variables. Neither method has a singular eccentricity or inclination. Both have the Earth's GM; motion about another body is
that about the Earth with time in another unit. Source: Battin, An Introduction to the Mathematics and Methods of
Astrodynamics, secs. 4.3 and 4.5; Vallado 4th ed. alg. 8.
"""

from __future__ import annotations

import math
from typing import ClassVar, Literal, Self

import numpy as np
from pydantic import Field, model_validator

from rso_lidar import units
from rso_lidar.errors import PropagationError, warn
from rso_lidar.orbit.central_body import EARTH, CentralBody
from rso_lidar.orbit.epochs import Epochs
from rso_lidar.orbit.trajectory import two_body_rates
from rso_lidar.orbit.two_body.anomaly import start_eccentric_anomaly
from rso_lidar.orbit.two_body.orbit_axes import has_plane
from rso_lidar.orbit.two_body.universal_variables import (
    inverse_semi_major_axis,
    perigee_distance_m,
    propagate_universal,
)
from rso_lidar.part import Instant, NotNegative, Number, Part, Vector
from rso_lidar.pose import dot, length, rotate_vectors
from rso_lidar.records import BodyState

GM = units.EARTH_GM_M3_S2
_BLOCK = 4_096  # epochs solved at a time: fits a processor's cache
_NEAR_PARABOLA = 1e-7  # perigee distance over semi-major axis below which an ellipse is solved like an open orbit


class ClassicalElements(Part):
    """Base of motions that begin with the classical elements of a conic in GCRS axes at `epoch_utc`."""

    central_body: ClassVar[CentralBody] = EARTH

    epoch_utc: Instant = Field(description="Time at which the elements apply.")
    semi_major_axis_km: Number = Field(description="Semi-major axis [km], negative for a hyperbola.")
    eccentricity: NotNegative = Field(description="Eccentricity, not 1; use `state` for a parabola.")
    inclination_deg: Number = Field(description="Inclination to the equator of GCRS, 0 to 180 [deg].")
    raan_deg: Number = Field(description="Right ascension of the ascending node [deg].")
    argument_of_perigee_deg: Number = Field(description="Argument of perigee, from the ascending node [deg].")
    true_anomaly_deg: Number | None = Field(
        default=None, description="True anomaly [deg]; give exactly one of this and `mean_anomaly_deg`."
    )
    mean_anomaly_deg: Number | None = Field(
        default=None, description="Mean anomaly [deg]; give exactly one of this and `true_anomaly_deg`."
    )

    @model_validator(mode="after")
    def _one_conic(self) -> Self:
        a_km, e = self.semi_major_axis_km, self.eccentricity
        if e == 1.0:
            raise ValueError("eccentricity: a parabola has no semi-major axis; give its motion as type 'state'")
        if a_km == 0.0 or (a_km > 0.0) != (e < 1.0):
            sign = "positive for an ellipse (eccentricity < 1)" if e < 1.0 else "negative for a hyperbola"
            raise ValueError(f"semi_major_axis_km: {a_km:g} with eccentricity {e:g}; make it {sign}")
        if not 0.0 <= self.inclination_deg <= 180.0:
            raise ValueError(
                f"inclination_deg: {self.inclination_deg:g} is outside 0 to 180; turn raan_deg by 180 instead"
            )
        if (self.true_anomaly_deg is None) == (self.mean_anomaly_deg is None):
            raise ValueError("needs exactly one of true_anomaly_deg and mean_anomaly_deg; give one of them")
        body = self.central_body
        if self.perigee_m < body.radius_m:
            low_km = (body.radius_m - self.perigee_m) / units.KM
            raise ValueError(
                f"semi_major_axis_km: the perigee is {low_km:.1f} km below {body.name}'s surface; raise it"
            )
        far_km = body.reach_m / units.KM
        if max(a_km, self.perigee_m / units.KM) > far_km:
            raise ValueError(
                f"semi_major_axis_km: {a_km:.10g} km is beyond {far_km:g} km, where {body.name} holds no satellite; as "
                f"metres it would be {a_km / 1000.0:.8g} km; give kilometres"
            )
        if self.true_anomaly_deg is not None and 1.0 + e * math.cos(self.true_anomaly_deg * units.DEG) <= 0.0:
            limit = math.acos(-1.0 / e) / units.DEG
            raise ValueError(f"true_anomaly_deg: is beyond the asymptote; keep it within {limit:.3f} of perigee")
        return self

    @property
    def perigee_m(self) -> float:
        """Distance of perigee from the centre of the central body [m]."""
        return self.semi_major_axis_km * units.KM * (1.0 - self.eccentricity)

    def at_epoch(self) -> BodyState:
        """Return the state at `epoch_utc` about the central body, in GCRS axes (Vallado 4th ed. alg. 10)."""
        from scipy.spatial.transform import Rotation

        e, gm = self.eccentricity, self.central_body.gm_m3_s2
        parameter = self.perigee_m * (1.0 + e)
        anomaly = (self.true_anomaly_deg or 0.0) * units.DEG
        c, s = math.cos(anomaly), math.sin(anomaly)
        position = parameter / (1.0 + e * c) * np.array([c, s, 0.0])
        velocity = math.sqrt(gm / parameter) * np.array([-s, e + c, 0.0])
        if self.mean_anomaly_deg is not None:  # propagate there from perigee
            mean = self.mean_anomaly_deg if e > 1.0 else math.remainder(self.mean_anomaly_deg, 360.0)
            time_s = mean * units.DEG * math.sqrt(abs(self.semi_major_axis_km * units.KM) ** 3 / gm)
            positions, velocities = propagate_two_body(position, velocity, np.array([time_s]), gm)
            position, velocity = positions[0], velocities[0]
        angles = np.array([self.raan_deg, self.inclination_deg, self.argument_of_perigee_deg]) * units.DEG
        inertial_from_perifocal = Rotation.from_euler("ZXZ", angles)
        return BodyState(
            rotate_vectors(inertial_from_perifocal, position), rotate_vectors(inertial_from_perifocal, velocity)
        )


class _TwoBodyMotion:
    """Base of two-body motions."""

    def state_rates(self, state: BodyState) -> tuple[np.ndarray, np.ndarray]:
        """Return the derivatives (…, 3) of position [m/s] and velocity [m/s2], by point-mass gravity.

        Parameters
        ----------
        state : position and velocity (…, 3) in inertial axes
        """
        return two_body_rates(state)


class Kepler(_TwoBodyMotion, ClassicalElements):
    """Two-body motion from osculating elements in GCRS axes at `epoch_utc`. A hyperbola has e > 1 and a negative a."""

    type: Literal["kepler"] = "kepler"

    def states(self, epochs: Epochs) -> BodyState:
        """Return position [m] and velocity [m/s] (time, 3) in GCRS axes."""
        start = self.at_epoch()
        return BodyState(*propagate_two_body(start.position_m, start.velocity_m_s, epochs.since(self.epoch_utc)))


class State(_TwoBodyMotion, Part):
    """Two-body motion from a position and a velocity in GCRS axes at `epoch_utc`."""

    type: Literal["state"] = "state"
    epoch_utc: Instant = Field(description="Time at which the state applies.")
    position_m: Vector = Field(description="Position from the Earth's centre in GCRS axes [m].")
    velocity_m_s: Vector = Field(description="Velocity in GCRS axes [m/s].")

    @model_validator(mode="after")
    def _in_space(self) -> Self:
        check_start(self.position_m, self.velocity_m_s, EARTH)
        return self

    def states(self, epochs: Epochs) -> BodyState:
        """Return position [m] and velocity [m/s] (time, 3) in GCRS axes."""
        position, velocity = np.array(self.position_m), np.array(self.velocity_m_s)
        return BodyState(*propagate_two_body(position, velocity, epochs.since(self.epoch_utc)))


def check_start(position_m: Vector, velocity_m_s: Vector, body: CentralBody) -> None:
    """Check that a state begins an orbit: outside the central body, within its reach, and not along the radius.

    Warn of a speed so low that the body falls, while the same number of kilometres per second would be an orbit.

    Parameters
    ----------
    position_m, velocity_m_s : from the centre of the body [m], [m/s]

    Raises
    ------
    ValueError
        if it does not
    """
    radius = float(np.linalg.norm(position_m))
    if radius < body.radius_m:
        slip = f"; as kilometres it would be {1000.0 * radius:g} m"
        raise ValueError(
            f"position_m: is {radius:g} m from {body.name}'s centre, inside {body.name}"
            f"{slip if body.radius_m <= 1000.0 * radius <= body.reach_m else ''}; give metres from the centre"
        )
    if radius > body.reach_m:
        raise ValueError(
            f"position_m: is {radius:g} m from {body.name}'s centre, beyond {body.reach_m:g} m, where it holds no "
            "satellite; give metres from the centre"
        )
    speed = float(np.linalg.norm(velocity_m_s))
    if not has_plane(np.array(position_m), np.array(velocity_m_s)):
        raise ValueError(
            f"velocity_m_s: is parallel to position_m, a fall through {body.name}'s centre; give it a component across"
        )
    escape = math.sqrt(2.0 * body.gm_m3_s2 / radius)
    if 0.1 * escape < 1000.0 * speed < escape:  # ten times slower, kilometres per second would be no orbit either
        warn(
            f"velocity_m_s: {speed:g} m/s is a fall into {body.name}; as kilometres per second it would be an orbit, of "
            f"{1000.0 * speed:g} m/s; give metres per second"
        )


def semi_major_axis_m(position_m: np.ndarray, velocity_m_s: np.ndarray) -> float:
    """Return the osculating semi-major axis [m] by the vis-viva equation, negative on a hyperbola."""
    alpha = inverse_semi_major_axis(np.asarray(position_m, dtype=float), np.asarray(velocity_m_s, dtype=float))
    return 1.0 / alpha if alpha else math.inf


def propagate_two_body(
    position_m: np.ndarray, velocity_m_s: np.ndarray, dt_s: np.ndarray, gm_m3_s2: float = GM
) -> tuple[np.ndarray, np.ndarray]:
    """Propagate one state by two-body motion to many times, forward or backward.

    With time in units of sqrt(GM_Earth / GM), motion about a body of any GM is that about the Earth.

    Parameters
    ----------
    position_m, velocity_m_s : (3,) state at the epoch [m], [m/s]
    dt_s : (time,) time since the epoch [s]
    gm_m3_s2 : gravitational parameter of the central body [m3/s2], by default the Earth's

    Returns
    -------
    position_m, velocity_m_s : (time, 3) [m], [m/s]

    Raises
    ------
    PropagationError
        if Kepler's equation did not converge at some times; its `bad` masks them

    Examples
    --------
    >>> radius = 42_164e3
    >>> speed = (units.EARTH_GM_M3_S2 / radius) ** 0.5
    >>> quarter = 0.5 * math.pi * radius / speed
    >>> there, _ = propagate_two_body(np.array([radius, 0, 0]), np.array([0, speed, 0]), np.array([quarter]))
    >>> bool(np.allclose(there, [[0, radius, 0]], atol=1e-6))
    True
    """
    r0_vector, v0_vector = np.asarray(position_m, dtype=float), np.asarray(velocity_m_s, dtype=float)
    dt = np.atleast_1d(np.asarray(dt_s, dtype=float))
    if gm_m3_s2 != GM:
        unit = math.sqrt(GM / gm_m3_s2)
        moved, faster = propagate_two_body(r0_vector, unit * v0_vector, dt / unit)
        return moved, faster / unit
    alpha = inverse_semi_major_axis(r0_vector, v0_vector)
    positions, velocities, bad = np.empty((len(dt), 3)), np.empty((len(dt), 3)), np.zeros(len(dt), dtype=bool)
    if alpha > 0.0 and alpha * perigee_distance_m(r0_vector, v0_vector) > _NEAR_PARABOLA:
        conic = _Ellipse(r0_vector[None, :], v0_vector[None, :])
        for k in range(0, len(dt), _BLOCK):
            rows = slice(k, k + _BLOCK)
            bad[rows] = conic.propagate_into(dt[rows], positions[rows], velocities[rows])
        for row in np.flatnonzero(bad):
            after = propagate_universal(r0_vector, v0_vector, dt[row : row + 1], alpha)
            positions[row], velocities[row], bad[row] = (values[0] for values in after)
    else:
        positions, velocities, bad = propagate_universal(r0_vector, v0_vector, dt, alpha)
    if bad.any():
        raise _convergence_error(bad, dt)
    return positions, velocities


def _convergence_error(bad: np.ndarray, dt_s: np.ndarray) -> PropagationError:
    """Make the error for times at which Kepler's equation did not converge."""
    first = float(dt_s[np.argmax(bad)])
    return PropagationError(
        f"kepler: no state at {int(bad.sum())} of {len(bad)} epochs, first {first:g} s from the epoch of the elements; "
        "ask for epochs nearer to it",
        bad,
    )


class _Ellipse:
    """The ellipse of a state (1, 3): Kepler's equation solved for the change x of eccentric anomaly.

    n dt = x - e cos E0 sin x + e sin E0 (1 - cos x) (Battin eq. 4.43) has no singularity at e = 0. Markley's starting value
    (1995) is within 1e-3 of the root; one step of fifth order and one of Newton's method follow, without a loop.
    """

    def __init__(self, r: np.ndarray, v: np.ndarray) -> None:
        self.r, self.v = r, v
        self.r0 = length(r)
        alpha = 2.0 / self.r0 - dot(v, v) / GM
        self.a = 1.0 / alpha
        self.n = np.sqrt(GM * alpha) * alpha
        self.sigma = dot(r, v) / math.sqrt(GM)
        self.es = self.sigma * np.sqrt(alpha)  # e sin E0
        # 1 - e cos E0 = r0 / a, which is exact where e cos E0 is near 1
        self.less, self.ec = self.r0 * alpha, 1.0 - self.r0 * alpha
        self.e = np.minimum(np.hypot(self.ec, self.es), 1.0 - 0.5 * _NEAR_PARABOLA)
        self.e0 = np.arctan2(self.es, self.ec)
        self.m0 = self.e0 - self.es

    def propagate_into(self, dt: np.ndarray, positions: np.ndarray, velocities: np.ndarray) -> np.ndarray:
        """Write positions [m] and velocities [m/s] after some times; return the mask (time,) of times that did not converge.

        Parameters
        ----------
        dt : (time,) time since the epoch [s]
        positions, velocities : (time, 3) arrays to write into [m], [m/s]
        """
        turn = math.tau / self.n
        goal = self.n * (dt - turn * np.round(dt / turn))  # change of mean anomaly, within half a turn
        mean = self.m0 + goal
        whole = math.tau * np.round(mean / math.tau)
        x = start_eccentric_anomaly(mean - whole, self.e) + whole - self.e0
        # one step of fifth order (Markley eqs. 21-25, applied to this form of the equation)
        half = 0.5 * x
        s, c = np.sin(half), np.cos(half)
        sine, versine = 2.0 * s * c, 2.0 * s * s
        second = self.ec * sine + self.es * (1.0 - versine)
        slope = self.less + self.ec * versine + self.es * sine
        third = 1.0 - slope
        miss = self.less * sine + (x - sine) + self.es * versine - goal
        d3 = -miss / (slope - 0.5 * miss * second / slope)
        d4 = -miss / (slope + d3 * (0.5 * second + d3 * third / 6.0))
        d5 = -miss / (slope + d4 * (0.5 * second + d4 * (third / 6.0 - d4 * second / 24.0)))
        x = x + d5
        # and one step of Newton's method
        half = 0.5 * x
        s, c = np.sin(half), np.cos(half)
        sine, versine = 2.0 * s * c, 2.0 * s * s
        slope = self.less + self.ec * versine + self.es * sine
        left = (goal - (self.less * sine + (x - sine) + self.es * versine)) / slope
        sine, versine = sine + left * (1.0 - versine), versine + left * sine
        slope = self.less + self.ec * versine + self.es * sine
        # Lagrange's coefficients
        radius, root = self.a * slope, np.sqrt(GM * self.a)
        f = 1.0 - versine / self.less
        g = (self.less * sine + self.es * versine) / self.n
        f_dot, g_dot = -root * sine / (radius * self.r0), 1.0 - versine / slope
        for k in range(3):
            positions[:, k] = f * self.r[:, k] + g * self.v[:, k]
            velocities[:, k] = f_dot * self.r[:, k] + g_dot * self.v[:, k]
        return ~(np.abs(left) < 1e-6)
