"""A rigid body free of torque, in closed form (Euler, Jacobi)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from scipy.spatial.transform import Rotation


def rotate_freely(inertia: np.ndarray, rate: np.ndarray, time: np.ndarray) -> tuple[Rotation, np.ndarray]:
    """Compute attitudes and body rates of a torque-free rigid body in closed form (Euler, Jacobi).

    The principal axes a, b, c are right-handed; b is the intermediate axis. The angular momentum circles axis c in the
    body. Landau & Lifshitz, Mechanics, section 37: w_a = A cn u, w_b = B sn u, w_c = C dn u, with u = lambda t + u0 and
    parameter m.

    The attitude is composed of two rotations. The smallest rotation that takes the direction l of the angular momentum
    in the body to axis c comes first. A rotation psi about the angular momentum follows, with the rate
    d psi / dt = w . (l + e_c) / (1 + l . e_c). This rate is regular for every motion and depends on dn alone. Its
    integral over half a period is therefore tabulated once.

    Near the separatrix the time of the next flip is ill-conditioned: the last bit of the input changes it.

    Parameters
    ----------
    inertia : inertia tensor (3, 3) in body axes, in any unit
    rate : body rates (3,) at t = 0 [rad/s]
    time : instants (time) [s]

    Returns
    -------
    first_body_from_body (time), and body rates (time, 3) [rad/s] in body axes
    """
    from scipy.spatial.transform import Rotation

    speed = float(np.linalg.norm(rate))
    moments, axes = np.linalg.eigh(inertia / np.abs(inertia).max())  # ascending moments
    w = axes.T @ (rate / speed) if speed else np.zeros(3)
    least, middle, most = moments
    circling_most = most * (most - middle) * w[2] ** 2
    circling_least = least * (middle - least) * w[0] ** 2
    if circling_most == circling_least == 0.0:  # a sphere, a body at rest, or a spin about a principal axis
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
    m1 = max(beyond / (i_c * abs(i_c - i_b) * amplitude_c**2), 1e-32)  # 1 - m, at least the square of rounding
    m1 = min(m1, 1.0)

    functions = _JacobiFunctions(m1, i_c * amplitude_c)
    sine, cosine = (w_b / amplitude_b, w_a / amplitude_a) if amplitude_a else (0.0, 1.0)
    u0 = functions.find_argument(sine, cosine)
    u = np.append(0.0, slowness * speed * time) + u0  # the first entry belongs to t = 0
    sn, cn, dn = functions.values(u)
    momentum = np.stack([i_a * amplitude_a * cn, i_b * amplitude_b * sn, i_c * amplitude_c * dn], axis=-1)
    size = float(np.linalg.norm(moments[[a, b, c]] * [w_a, w_b, w_c]))

    # psi = L t / I_c + (2 E - L^2 / I_c) * integral of dt / (L + I_c w_c); the bracket is a sum of terms of one sign
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


class _JacobiFunctions:
    """Jacobi's sn, cn, dn with parameter 1 - m1 for any argument, and the integral of 1 / (size + weight dn)."""

    NODES = 24  # the integrand is analytic for |Im u| < pi/2: the error in a panel of width 1 is 6.4^-24 < 1e-18

    def __init__(self, m1: float, weight: float) -> None:
        from scipy.special import ellipkm1

        self.m1, self.weight = float(m1), float(weight)
        self.quarter = float(ellipkm1(self.m1))  # K, a quarter period

    def find_argument(self, sine: float, cosine: float) -> float:
        """Find u in [-2K, 2K] with sn u = sine and cn u = cosine (Carlson's R_F, DLMF 19.25.5)."""
        from scipy.special import elliprf

        u = sine * float(elliprf(cosine**2, cosine**2 + self.m1 * sine**2, sine**2 + cosine**2))
        return u if cosine >= 0.0 else float(np.copysign(2.0 * self.quarter, sine)) - u

    def reduce(self, u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Split `u` into whole half periods and a remainder in [-K, K]."""
        turns = np.rint(u / (2.0 * self.quarter))
        return turns, u - 2.0 * self.quarter * turns

    def values(self, u: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Evaluate sn, cn, dn at `u`."""
        from scipy.special import ellipj

        turns, v = self.reduce(u)
        sign = 1.0 - 2.0 * np.mod(turns, 2.0)
        if self.m1 >= 0.5:
            sn, cn, dn, _ = ellipj(v, 1.0 - self.m1)
            return sign * sn, sign * cn, dn
        # Near the separatrix ellipj loses digits: fold at K/2, then ascend (A&S 16.14) until sech and tanh are exact.
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
        """Integrate dv / (size + weight dn v) from 0 to `u`: over panels in [0, K], then over periods."""
        from numpy.polynomial import chebyshev

        panels = max(1, int(np.ceil(self.quarter)))
        width = self.quarter / panels
        nodes = chebyshev.chebpts1(self.NODES)
        dn = self.values(((np.arange(panels)[:, None] + (nodes + 1.0) / 2.0) * width).ravel())[2]
        values = (1.0 / (size + self.weight * dn)).reshape(panels, self.NODES)
        pieces = chebyshev.chebint(chebyshev.chebfit(nodes, values.T, self.NODES - 1), lbnd=-1.0, scl=width / 2.0)
        ends = np.cumsum(chebyshev.chebval(1.0, pieces))
        pieces[0, 1:] += ends[:-1]

        turns, v = self.reduce(u)
        scaled = np.abs(v) / width
        panel = np.minimum(scaled.astype(int), panels - 1)
        part = chebyshev.chebval(2.0 * (scaled - panel) - 1.0, pieces[:, panel], tensor=False)
        total: np.ndarray = 2.0 * ends[-1] * turns + np.copysign(part, v)
        return total
