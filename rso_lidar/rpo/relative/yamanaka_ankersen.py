"""Relative motion about an orbit of any eccentricity below 1, to first order, by Yamanaka and Ankersen's closed form.

Yamanaka & Ankersen, New State Transition Matrix for Relative Motion on an Arbitrary Elliptical Orbit, Journal of
Guidance, Control, and Dynamics 25 (2002), 60-66. Their axes (x along the track, y against the orbit normal, z toward
the Earth) are y, -z and -x of rtn.
"""

from __future__ import annotations

import math
from typing import ClassVar, Literal

import numpy as np

from rso_lidar import units
from rso_lidar.errors import ScenarioError
from rso_lidar.orbit import EARTH, Epochs, Trajectory, find_center, solve_kepler
from rso_lidar.part import Vector
from rso_lidar.rpo.relative.hill import FAR_M, GM, describe_flattening, find_eccentricity, find_start_state
from rso_lidar.rpo.relative.relative_motion import RelativeState

_BLOCK = 4096  # epochs computed at a time: fits a processor's cache


class YamanakaAnkersen(RelativeState):
    """Linear motion about a chief on an elliptic orbit, in its rtn axes.

    The chief's anomaly is that of its osculating two-body orbit at `start_utc`, so this is two-body motion to first
    order. With rho the greatest separation and q the distance of perigee, the error per revolution is up to some

        6 pi rho^2 / q sqrt((1 + e) / (1 - e)) / (1 - e)^2,

    which is 2.7 m at 1 km about a circle in low orbit, and 7.5 m at e = 0.3. Perturbations that act differently on the
    two bodies are left out.
    """

    any_center: ClassVar[bool] = True
    type: Literal["yamanaka_ankersen"] = "yamanaka_ankersen"

    def relative(self, epochs: Epochs, chief: Trajectory) -> tuple[np.ndarray, np.ndarray]:
        """Return position [m] and velocity [m/s] (time, 3) in the chief's rotating rtn axes."""
        start, gm = find_start_state(chief, epochs.start_utc), find_center(chief).gm_m3_s2
        return propagate_yamanaka_ankersen(self.position_m, self.velocity_m_s, epochs.time_s, *start, gm)

    def validity(self, epochs: Epochs, chief: Trajectory) -> list[str]:
        """Return one sentence for each limit of the model that these epochs exceed, with a better choice."""
        start, center = find_start_state(chief, epochs.start_utc), find_center(chief)
        position, _ = self.relative(epochs, chief)
        farthest_m = float(np.linalg.norm(position, axis=1).max(initial=0.0))
        sentences = []
        if farthest_m > FAR_M:
            off_m = _estimate_second_order_m(farthest_m, *start, center.gm_m3_s2)
            sentences.append(
                f"yamanaka_ankersen: the separation reaches {farthest_m / units.KM:.1f} km; beyond {FAR_M / units.KM:g} km "
                f"the neglected second order, here up to some {off_m:.3g} m for each "
                f"revolution, matters; use nonlinear{' or relative_elements' if center is EARTH else ''}"
            )
        return sentences + describe_flattening("yamanaka_ankersen", epochs, *start, center=center)


def propagate_yamanaka_ankersen(
    position_m: np.ndarray | Vector,
    velocity_m_s: np.ndarray | Vector,
    time_s: np.ndarray,
    chief_m: np.ndarray,
    chief_m_s: np.ndarray,
    gm_m3_s2: float = GM,
) -> tuple[np.ndarray, np.ndarray]:
    """Propagate a relative state by Yamanaka and Ankersen's equations.

    Parameters
    ----------
    position_m, velocity_m_s : (3,) initial state in rtn axes [m], [m/s]
    time_s : (time,) time since the initial state [s]
    chief_m, chief_m_s : (3,) state of the chief about its central body at the start, in GCRS axes [m], [m/s]
    gm_m3_s2 : gravitational parameter of that body [m3/s2], by default the Earth's

    Returns
    -------
    position_m, velocity_m_s : (time, 3) in rtn axes [m], [m/s]
    """
    time = np.atleast_1d(np.asarray(time_s, dtype=float))
    orbit = _ChiefOrbit(np.asarray(chief_m, dtype=float), np.asarray(chief_m_s, dtype=float), gm_m3_s2)
    start = (*np.asarray(position_m, dtype=float), *np.asarray(velocity_m_s, dtype=float))
    constants = orbit.constants(*start)
    position, velocity = np.empty((len(time), 3)), np.empty((len(time), 3))
    for k in range(0, len(time), _BLOCK):
        orbit.fly(constants, time[k : k + _BLOCK], position[k : k + _BLOCK], velocity[k : k + _BLOCK])
    return position, velocity


class _ChiefOrbit:
    """The chief's two-body ellipse.

    `e` is its eccentricity and `k2` the paper's k^2 = sqrt(GM / p^3); the anomalies are those at the start.

    Parameters
    ----------
    r, v : state (3,) about the central body [m], [m/s]
    gm : gravitational parameter of that body [m3/s2]
    """

    def __init__(self, r: np.ndarray, v: np.ndarray, gm: float) -> None:
        radius = float(np.linalg.norm(r))
        momentum = np.cross(r, v)
        p = float(np.sum(momentum * momentum)) / gm
        alpha = 2.0 / radius - float(np.sum(v * v)) / gm
        e_cos, e_sin = p / radius - 1.0, math.sqrt(p / gm) * float(np.sum(r * v)) / radius
        self.e = math.hypot(e_cos, e_sin)
        if alpha <= 0.0 or self.e >= 1.0:
            raise ScenarioError(
                "relative_to: its orbit is open, and yamanaka_ankersen is for ellipses; use motion 'nonlinear'"
            )
        self.true_rad = math.atan2(e_sin, e_cos)
        self.k2 = math.sqrt(gm / p**3)
        self.mean_motion_rad_s = math.sqrt(gm * alpha**3)
        self.axes_ratio = math.sqrt(p * alpha)  # sqrt(1 - e^2)
        eccentric = math.atan2(self.axes_ratio * math.sin(self.true_rad), self.e + math.cos(self.true_rad))
        self.mean_rad = eccentric - self.e * math.sin(eccentric)

    def constants(self, x: float, y: float, z: float, u: float, v: float, w: float) -> tuple[float, ...]:
        """Return the constants of a motion from its state in rtn axes at the start (Yamanaka & Ankersen, eqs. 82 and 85).

        Parameters
        ----------
        x, y, z : position [m]
        u, v, w : velocity [m/s]
        """
        e, sin, cos = self.e, math.sin(self.true_rad), math.cos(self.true_rad)
        rho = 1.0 + e * cos
        s, c = rho * sin, rho * cos

        def tilde(value: float, rate: float) -> tuple[float, float]:
            return rho * value, rate / (self.k2 * rho) - e * sin * value

        (x1, v1), (z1, w1), (y1, u1) = tilde(y, v), tilde(-x, -u), tilde(z, w)
        closed = self.axes_ratio**2
        return (
            x1
            + (3.0 * e * s * (1.0 / rho + 1.0 / rho**2) * z1 - e * s * (1.0 + 1.0 / rho) * v1 + (2.0 - e * c) * w1)
            / closed,
            (-3.0 * s * (1.0 / rho + e**2 / rho**2) * z1 + s * (1.0 + 1.0 / rho) * v1 + (c - 2.0 * e) * w1) / closed,
            (-3.0 * (c / rho + e) * z1 + (c * (1.0 + 1.0 / rho) + e) * v1 - s * w1) / closed,
            ((3.0 * rho + e**2 - 1.0) * z1 - rho**2 * v1 + e * s * w1) / closed,
            y1 * cos - u1 * sin,
            y1 * sin + u1 * cos,
        )

    def fly(self, constants: tuple[float, ...], time_s: np.ndarray, position: np.ndarray, velocity: np.ndarray) -> None:
        """Write the propagated motion (Yamanaka & Ankersen, eq. 84) into two arrays.

        Parameters
        ----------
        time_s : (time,) time since the start [s]
        position, velocity : (time, 3) arrays to write into [m], [m/s]
        """
        k1, k2, k3, k4, k5, k6 = constants
        e = self.e
        sin_e, cos_e = solve_kepler(self.mean_rad + self.mean_motion_rad_s * time_s, e)
        shrunk = 1.0 / (1.0 - e * cos_e)  # a / r
        sin, cos = self.axes_ratio * sin_e * shrunk, (cos_e - e) * shrunk
        rho, e_sin, j = 1.0 + e * cos, e * sin, self.k2 * time_s
        s, c = rho * sin, rho * cos
        s_slope, c_slope = cos + e * (cos * cos - sin * sin), -sin - 2.0 * e_sin * cos

        def put(axis: int, sign: float, tilde: np.ndarray, slope: np.ndarray) -> None:
            """Convert one component from scaled coordinates and store it.

            Parameters
            ----------
            axis : index of the component
            sign : sign of the component in the paper's axes
            tilde : (time,) scaled component
            slope : (time,) its derivative by the true anomaly
            """
            position[:, axis] = sign * tilde / rho
            velocity[:, axis] = (sign * self.k2) * (rho * slope + e_sin * tilde)

        turn = k4 * j
        put(
            1,
            1.0,
            k1 + (1.0 + rho) * (k3 * sin - k2 * cos) + 3.0 * rho * rho * turn,
            2.0 * k2 * s + k3 * (2.0 * c - e) + 3.0 * k4 - 6.0 * e * s * turn,
        )
        put(
            0,
            -1.0,
            k2 * s + k3 * c + 2.0 * k4 - 3.0 * e * s * turn,
            k2 * s_slope + k3 * c_slope - 3.0 * e * (s_slope * turn + k4 * sin / rho),
        )
        put(2, 1.0, k5 * cos + k6 * sin, k6 * cos - k5 * sin)


def _estimate_second_order_m(
    separation_m: float, position_m: np.ndarray, velocity_m_s: np.ndarray, gm_m3_s2: float
) -> float:
    """Bound the neglected second order [m] in one revolution about a chief's state (3,), by propagating both bodies."""
    e = float(find_eccentricity(position_m, velocity_m_s, gm_m3_s2))
    h = np.cross(position_m, velocity_m_s)
    perigee_m = float(h @ h) / gm_m3_s2 / (1.0 + e)
    return 6.0 * math.pi * separation_m**2 / perigee_m * math.sqrt((1.0 + e) / (1.0 - e)) / (1.0 - e) ** 2
