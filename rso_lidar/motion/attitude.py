"""How a body is turned: fixed, with the orbit, toward a name, spinning, or tumbling free of torque.

A body's axes are x forward, y left, z up. Body rates are relative to the axes that the body is turned in, in body axes.
At one epoch the answer has the same bits whichever other epochs are asked for.
"""

from __future__ import annotations

from typing import Annotated, Any, Literal, Self

import numpy as np
from pydantic import BeforeValidator, model_validator
from scipy.spatial.transform import Rotation

from rso_lidar import units
from rso_lidar.errors import ScenarioError
from rso_lidar.part import Direction, Number, Part, Quaternion, Text, Vector
from rso_lidar.pose import euler_zyx

# Columns: x, y, z of the CCSDS axes in rtn. z to nadir is rtn -x, y along -(r x v) is rtn -z, x = y x z is rtn +y.
RTN_FROM_LVLH_CCSDS = Rotation.from_matrix([[0.0, 0.0, -1.0], [1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])

PARALLEL_RAD = 1e-6  # a line of sight nearer than this to `up` leaves the roll open

_IDENTITY = (0.0, 0.0, 0.0, 1.0)


class FixedAttitude(Part):
    """Turned once and for all in the axes that the body's motion is given in: the root, or the body it is fixed to."""

    type: Literal["fixed"] = "fixed"
    quaternion_xyzw: Quaternion | None = None
    euler_zyx_deg: Vector | None = None

    @model_validator(mode="after")
    def _one_rotation(self) -> Self:
        if self.quaternion_xyzw is not None and self.euler_zyx_deg is not None:
            raise ValueError("quaternion_xyzw and euler_zyx_deg both turn the body: keep one")
        return self

    @property
    def rotation(self) -> Rotation:
        """Return axes_from_body; the identity where nothing is given."""
        if self.euler_zyx_deg is not None:
            return euler_zyx(self.euler_zyx_deg)
        return Rotation.from_quat(self.quaternion_xyzw or _IDENTITY)

    def orientation(self, time_s: np.ndarray | float) -> tuple[Rotation, np.ndarray]:
        """Return axes_from_body, single, and the body rates (…, 3) [rad/s], zero, at `time_s` (…) [s]."""
        return self.rotation, np.zeros((*np.shape(time_s), 3))


class Rtn(Part):
    """Turned with the body's own rtn axes (x radially out, z along r x v, y = z x x), then by `euler_zyx_deg`."""

    type: Literal["rtn"] = "rtn"
    euler_zyx_deg: Vector = (0.0, 0.0, 0.0)

    def rtn_from_body(self) -> Rotation:
        """Return the constant rotation of the body in its rtn axes.

        >>> Rtn(euler_zyx_deg=(90, 0, 0)).rtn_from_body().apply([1, 0, 0]).round(12)  # body +x along-track
        array([0., 1., 0.])
        """
        return euler_zyx(self.euler_zyx_deg)


class LvlhCcsds(Part):
    """Turned with CCSDS's local-vertical axes (z to nadir, y along -(r x v), x = y x z), then by `euler_zyx_deg`."""

    type: Literal["lvlh_ccsds"] = "lvlh_ccsds"
    euler_zyx_deg: Vector = (0.0, 0.0, 0.0)

    def rtn_from_body(self) -> Rotation:
        """Return the constant rotation of the body in its rtn axes.

        >>> LvlhCcsds().rtn_from_body().apply([0, 0, 1]).round(12) + 0.0  # body +z to nadir
        array([-1.,  0.,  0.])
        """
        return RTN_FROM_LVLH_CCSDS * euler_zyx(self.euler_zyx_deg)


class LookAt(Part):
    """Body +x toward the name `at`, body +z as near `up` (root axes) as can be.

    `up` is the orbit normal, rtn +z, where it is left out, and the root's +z in a local world.
    """

    type: Literal["look_at"] = "look_at"
    at: Text
    up: Direction | None = None


class Spin(Part):
    """Spinning at a constant rate about an axis in body axes; `quaternion_xyzw` is inertial_from_body at t = 0."""

    type: Literal["spin"] = "spin"
    axis: Direction
    rate_deg_s: Number
    quaternion_xyzw: Quaternion = _IDENTITY

    @property
    def body_rate_rad_s(self) -> np.ndarray:
        """Return the constant body rates (3,) [rad/s] in body axes."""
        axis = np.asarray(self.axis, dtype=float)
        rate: np.ndarray = axis / np.linalg.norm(axis) * (self.rate_deg_s * units.DEG)
        return rate

    def orientation(self, time_s: np.ndarray | float) -> tuple[Rotation, np.ndarray]:
        """Return inertial_from_body and the body rates (…, 3) [rad/s] at `time_s` (…) [s].

        >>> rotation, _ = Spin(axis=(0, 0, 1), rate_deg_s=90.0).orientation(1.0)
        >>> rotation.apply([1, 0, 0]).round(12)
        array([0., 1., 0.])
        """
        rate = self.body_rate_rad_s
        turned = Rotation.from_rotvec(np.multiply.outer(np.asarray(time_s, dtype=float), rate))
        return Rotation.from_quat(self.quaternion_xyzw) * turned, np.broadcast_to(rate, (*np.shape(time_s), 3)).copy()


def _three_or_nine(inertia: Any) -> Any:
    rows = list(inertia) if isinstance(inertia, list | tuple) else []
    tables = [list(row) if isinstance(row, list | tuple) else None for row in rows]
    square = all(row is not None and len(row) == 3 for row in tables)
    if len(rows) != 3 or not (square or all(row is None for row in tables)):
        raise ValueError("needs the three principal moments along the body axes, or three rows of three numbers")
    for value in [value for row in tables for value in row or ()] or rows:
        if isinstance(value, bool) or not isinstance(value, int | float) or not np.isfinite(value):
            raise ValueError(f"needs numbers, not {value!r}")
    return inertia


class Tumble(Part):
    """Tumbling free of torque: a rigid body of any inertia, in Jacobi's closed form.

    `inertia_kg_m2` is three principal moments along the body axes, or a symmetric 3 x 3 tensor in body axes;
    `body_rate_deg_s` and `quaternion_xyzw` (inertial_from_body) hold at t = 0.
    """

    type: Literal["tumble"] = "tumble"
    inertia_kg_m2: Annotated[Vector | tuple[Vector, Vector, Vector], BeforeValidator(_three_or_nine)]
    body_rate_deg_s: Vector
    quaternion_xyzw: Quaternion = _IDENTITY

    @model_validator(mode="after")
    def _possible(self) -> Self:
        tensor = self.inertia_tensor_kg_m2
        if np.abs(tensor - tensor.T).max() > 1e-9 * np.abs(tensor).max():
            raise ValueError("inertia_kg_m2: the tensor is not symmetric; write each product of inertia twice, equal")
        least, middle, most = np.linalg.eigvalsh(tensor)
        if least <= 0.0:
            raise ValueError(f"inertia_kg_m2: a principal moment is {least:.6g}; all three must be positive")
        if most > (least + middle) * (1.0 + 1e-9):  # a flat plate has equality, to rounding
            raise ValueError(
                f"inertia_kg_m2: no body has the principal moments {least:.6g}, {middle:.6g} and {most:.6g}, "
                "for the largest exceeds the sum of the others; check units, axes and signs"
            )
        return self

    @property
    def inertia_tensor_kg_m2(self) -> np.ndarray:
        """Return the inertia tensor (3, 3) [kg m2] in body axes."""
        given = np.asarray(self.inertia_kg_m2, dtype=float)
        return np.diag(given) if given.ndim == 1 else given

    def orientation(self, time_s: np.ndarray | float) -> tuple[Rotation, np.ndarray]:
        """Return inertial_from_body and the body rates (…, 3) [rad/s] at `time_s` (…) [s]."""
        time = np.atleast_1d(np.ascontiguousarray(time_s, dtype=float))
        rate = np.asarray(self.body_rate_deg_s, dtype=float) * units.DEG
        turned, rates = _free_rotation(self.inertia_tensor_kg_m2, rate, time)
        rotation = Rotation.from_quat(self.quaternion_xyzw) * turned
        return (rotation[0], rates[0]) if np.ndim(time_s) == 0 else (rotation, rates)


def look_at(
    line_of_sight: np.ndarray, line_of_sight_rate: np.ndarray, up: np.ndarray, up_rate: np.ndarray | None = None
) -> tuple[Rotation, np.ndarray]:
    """Return inertial_from_body and body rates (…, 3) [rad/s] of a body that turns its +x to a target, +z nearest `up`.

    Parameters
    ----------
    line_of_sight : (…, 3) from the body to its target, root axes [m]
    line_of_sight_rate : (…, 3) its rate in root axes [m/s]
    up : (…, 3) direction of any length, root axes
    up_rate : (…, 3) its rate [1/s in the unit of `up`]; None for a direction that stands still

    >>> rotation, rates = look_at(np.array([10.0, 0, 0]), np.array([0, 1.0, 0]), np.array([0, 0, 1.0]))
    >>> rates + 0.0  # the target moves to the left: the body turns about +z
    array([0. , 0. , 0.1])
    """
    line_of_sight, up = np.asarray(line_of_sight, dtype=float), np.asarray(up, dtype=float)
    distance = np.linalg.norm(line_of_sight, axis=-1, keepdims=True)
    if not np.all(distance > 0.0):
        raise ScenarioError("look_at: the target is where the body is: look at another name, or move one of them")
    x = line_of_sight / distance
    x_rate = (line_of_sight_rate - x * _dot(x, line_of_sight_rate)) / distance

    across = np.cross(up, x)
    length = np.linalg.norm(across, axis=-1, keepdims=True)
    if not np.all(length > PARALLEL_RAD * np.linalg.norm(up, axis=-1, keepdims=True)):
        raise ScenarioError(
            f"look_at: up is parallel to the line of sight (within {PARALLEL_RAD:g} rad): "
            "give an `up` (root axes) that stands across it"
        )
    across_rate = np.cross(up, x_rate)
    if up_rate is not None:
        across_rate = across_rate + np.cross(up_rate, x)
    y = across / length
    y_rate = (across_rate - y * _dot(y, across_rate)) / length
    z = np.cross(x, y)

    # omega = 1/2 sum e x de/dt, in the body's own axes; the z column follows from the other two
    rates = np.concatenate([_dot(y_rate, z), -_dot(x_rate, z), _dot(x_rate, y)], axis=-1)
    columns = np.stack(np.broadcast_arrays(x, y, z), axis=-1)
    return Rotation.from_matrix(columns), rates


def _dot(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    product: np.ndarray = np.sum(a * b, axis=-1, keepdims=True)
    return product


# ------------------------------------------------------------------------------------------------- free of torque


def _free_rotation(inertia: np.ndarray, rate: np.ndarray, time: np.ndarray) -> tuple[Rotation, np.ndarray]:
    """Return first_body_from_body (time) and body rates (time, 3) [rad/s] of a torque-free rigid body (Euler, Jacobi).

    In principal axes a, b, c, right-handed, b the middle one and c the one that the body keeps circling (Landau &
    Lifshitz, Mechanics, section 37): w_a = A cn u, w_b = B sn u, w_c = C dn u with u = lambda t + u0 and parameter m.
    The attitude is a turn psi about the angular momentum after the least rotation that brings it from its place in the
    body to axis c; then d psi / dt = w . (l + e_c) / (1 + l . e_c), with l its direction in the body, is regular for
    every motion. It depends on dn alone, so that its integral over half a period is tabulated once.

    Within rounding of the separatrix the last bit of the input decides when the next flip comes, as a breath would.
    """
    speed = float(np.linalg.norm(rate))
    moments, axes = np.linalg.eigh(inertia / np.abs(inertia).max())  # rising moments
    w = axes.T @ (rate / speed) if speed else np.zeros(3)
    least, middle, most = moments
    circling_most = most * (most - middle) * w[2] ** 2
    circling_least = least * (middle - least) * w[0] ** 2
    if circling_most == circling_least == 0.0:  # a sphere, no rate, or a spin about a principal axis
        return Rotation.from_rotvec(np.multiply.outer(time, rate)), np.broadcast_to(rate, (time.size, 3)).copy()

    a, b, c = (0, 1, 2) if circling_most >= circling_least else (2, 1, 0)
    sign_c = 1.0 if w[c] >= 0.0 else -1.0  # c points along the momentum
    e_a, e_c = axes[:, a], axes[:, c] * sign_c
    e_b = np.cross(e_c, e_a)
    i_a, i_b, i_c = moments[[a, b, c]]
    w_a, w_b, w_c = (float(e @ rate) / speed for e in (e_a, e_b, e_c))

    # Amplitudes from the first integrals; each sum has terms of one sign, so nothing cancels.
    amplitude_a = np.sqrt(w_a**2 + w_b**2 * (i_b * (i_c - i_b)) / (i_a * (i_c - i_a)))
    amplitude_b = amplitude_a * np.sqrt(i_a * (i_c - i_a) / (i_b * (i_c - i_b))) * np.sign(i_c - i_a)
    amplitude_c = np.sqrt(w_c**2 + w_b**2 * (i_b * (i_b - i_a)) / (i_c * (i_c - i_a)))
    slowness = np.sqrt((i_c - i_a) * (i_c - i_b) / (i_a * i_b)) * amplitude_c  # lambda
    beyond = abs(circling_most - circling_least)
    m1 = max(beyond / (i_c * abs(i_c - i_b) * amplitude_c**2), 1e-32)  # 1 - m; its floor is rounding, squared
    m1 = min(m1, 1.0)

    functions = _Jacobi(m1, i_c * amplitude_c)
    sine, cosine = (w_b / amplitude_b, w_a / amplitude_a) if amplitude_a else (0.0, 1.0)
    u0 = functions.argument(sine, cosine)
    u = np.append(0.0, slowness * speed * time) + u0  # the first is t = 0
    sn, cn, dn = functions.values(u)
    momentum = np.stack([i_a * amplitude_a * cn, i_b * amplitude_b * sn, i_c * amplitude_c * dn], axis=-1)
    size = float(np.linalg.norm(moments[[a, b, c]] * [w_a, w_b, w_c]))

    # psi = L t / I_c + (2 E - L^2 / I_c) * integral of dt / (L + I_c w_c); the bracket as a sum of one sign
    bracket = (i_a * (i_c - i_a) * w_a**2 + i_b * (i_c - i_b) * w_b**2) / i_c
    integral = functions.integral(u, size)
    psi = size / i_c * np.append(0.0, speed * time) + bracket / slowness * (integral - integral[0])

    direction = momentum / np.linalg.norm(momentum, axis=-1, keepdims=True)
    zero = np.zeros_like(psi)
    least_turn = Rotation.from_quat(np.stack([direction[:, 1], -direction[:, 0], zero, 1.0 + direction[:, 2]], axis=-1))
    momentum_from_principal = (
        Rotation.from_quat(np.stack([zero, zero, np.sin(psi / 2), np.cos(psi / 2)], axis=-1)) * least_turn
    )
    body_from_principal = Rotation.from_matrix(np.stack([e_a, e_b, e_c], axis=-1))
    first = body_from_principal * momentum_from_principal[0].inv()
    turned = first * momentum_from_principal[1:] * body_from_principal.inv()
    parts = momentum[1:] / (i_a, i_b, i_c) * speed
    return turned, parts[:, :1] * e_a + parts[:, 1:2] * e_b + parts[:, 2:] * e_c


class _Jacobi:
    """Jacobi's sn, cn, dn of parameter 1 - m1 for any argument, and the integral of 1 / (size + weight dn)."""

    NODES = 24  # in a panel of width 1 the integrand, analytic to |Im u| < pi/2, is met to 6.4^-24 < 1e-18

    def __init__(self, m1: float, weight: float) -> None:
        from scipy.special import ellipkm1

        self.m1, self.weight = float(m1), float(weight)
        self.quarter = float(ellipkm1(self.m1))  # K, a quarter of a period

    def argument(self, sine: float, cosine: float) -> float:
        """Return u where sn u = sine and cn u = cosine, in [-2K, 2K] (Carlson's R_F, DLMF 19.25.5)."""
        from scipy.special import elliprf

        u = sine * float(elliprf(cosine**2, cosine**2 + self.m1 * sine**2, sine**2 + cosine**2))
        return u if cosine >= 0.0 else float(np.copysign(2.0 * self.quarter, sine)) - u

    def reduced(self, u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return how many half periods to leave out of `u`, and what then remains in [-K, K]."""
        turns = np.rint(u / (2.0 * self.quarter))
        return turns, u - 2.0 * self.quarter * turns

    def values(self, u: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return sn, cn, dn at `u`."""
        from scipy.special import ellipj

        turns, v = self.reduced(u)
        sign = 1.0 - 2.0 * np.mod(turns, 2.0)
        if self.m1 >= 0.5:
            sn, cn, dn, _ = ellipj(v, 1.0 - self.m1)
            return sign * sn, sign * cn, dn
        # Near the separatrix: fold at K/2, then Gauss's ascending steps until sech and tanh are exact (A&S 16.14).
        far = np.abs(v) > self.quarter / 2
        v_near = np.where(far, self.quarter - np.abs(v), np.abs(v))
        roots, m1 = [], self.m1
        while m1 > 1e-34:
            root = m1 / (1.0 + np.sqrt(1.0 - m1)) ** 2
            v_near = v_near / (1.0 + root)
            roots.append(root)
            m1 = root * root
        sn, dn = np.tanh(v_near), 1.0 / np.cosh(v_near)
        cn = dn
        for root in reversed(roots):
            sn, cn, dn = (
                (1.0 + root) * sn * cn / dn,
                (dn * dn - root) / ((1.0 - root) * dn),
                (dn * dn + root) / ((1.0 + root) * dn),
            )
        k1 = np.sqrt(self.m1)
        sn, cn, dn = np.where(far, cn / dn, sn), np.where(far, k1 * sn / dn, cn), np.where(far, k1 / dn, dn)
        return sign * np.copysign(sn, v), sign * cn, dn

    def integral(self, u: np.ndarray, size: float) -> np.ndarray:
        """Return the integral of dv / (size + weight dn v) from 0 to `u`: panels over [0, K], then periods."""
        from numpy.polynomial import chebyshev

        panels = max(1, int(np.ceil(self.quarter)))
        width = self.quarter / panels
        nodes = chebyshev.chebpts1(self.NODES)
        dn = self.values(((np.arange(panels)[:, None] + (nodes + 1.0) / 2.0) * width).ravel())[2]
        values = (1.0 / (size + self.weight * dn)).reshape(panels, self.NODES)
        pieces = chebyshev.chebint(chebyshev.chebfit(nodes, values.T, self.NODES - 1), lbnd=-1.0, scl=width / 2.0)
        ends = np.cumsum(chebyshev.chebval(1.0, pieces))
        pieces[0, 1:] += ends[:-1]

        turns, v = self.reduced(u)
        scaled = np.abs(v) / width
        panel = np.minimum(scaled.astype(int), panels - 1)
        part = chebyshev.chebval(2.0 * (scaled - panel) - 1.0, pieces[:, panel], tensor=False)
        total: np.ndarray = 2.0 * ends[-1] * turns + np.copysign(part, v)
        return total
