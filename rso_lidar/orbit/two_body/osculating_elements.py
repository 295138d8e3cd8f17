"""Classical osculating elements and states, in both directions, for every conic and inclination.

Vallado 4th ed. alg. 9 and 10, but without inverse cosines: each angle is the argument of two components, so no precision is
lost near the nodes, at perigee, on a circle or on the equator. All operations are element by element, so a state gives the
same bits alone and within an array.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from rso_lidar.orbit.central_body import EARTH, CentralBody
from rso_lidar.orbit.two_body.anomaly import eccentric_from_true, mean_from_eccentric
from rso_lidar.pose import cross, length

ROUND = 8.0 * float(
    np.finfo(float).eps
)  # an eccentricity or sine of inclination below this is rounding, and counts as zero


@dataclass(frozen=True, eq=False)
class OsculatingElements:
    """Osculating elements of one state, or of many as arrays of one shape.

    On a circle the perigee is placed at the node, and on the equator the node is placed at +x. `semi_major_axis_m` is
    negative where e > 1. `semi_latus_rectum_m` is kept because near a parabola it no longer follows from the semi-major
    axis and the eccentricity; where it is left out, it is computed from them.

    Parameters
    ----------
    semi_major_axis_m : [m]
    eccentricity : 0 or more
    inclination_rad : [rad]
    raan_rad : right ascension of the ascending node [rad]
    argument_of_perigee_rad : [rad]
    true_anomaly_rad : [rad]
    semi_latus_rectum_m : [m]
    central_body : the body of the orbit
    """

    semi_major_axis_m: np.ndarray | float
    eccentricity: np.ndarray | float
    inclination_rad: np.ndarray | float
    raan_rad: np.ndarray | float
    argument_of_perigee_rad: np.ndarray | float
    true_anomaly_rad: np.ndarray | float
    semi_latus_rectum_m: np.ndarray | float | None = None
    central_body: CentralBody = EARTH

    @property
    def _p(self) -> np.ndarray:
        if self.semi_latus_rectum_m is not None:
            return np.asarray(self.semi_latus_rectum_m, dtype=float)
        e = np.asarray(self.eccentricity, dtype=float)
        return np.asarray(self.semi_major_axis_m * (1.0 - e) * (1.0 + e))

    @property
    def period_s(self) -> np.ndarray | float:
        """Orbital period [s], infinite on an open conic."""
        a = np.asarray(self.semi_major_axis_m, dtype=float)
        closed, gm = (a > 0.0) & np.isfinite(a), self.central_body.gm_m3_s2
        return _unwrap_scalar(np.where(closed, math.tau * np.sqrt(np.where(closed, a, 1.0) ** 3 / gm), math.inf))

    @property
    def perigee_altitude_m(self) -> np.ndarray | float:
        """Altitude of perigee above the equatorial radius [m]."""
        return _unwrap_scalar(self._p / (1.0 + self.eccentricity) - self.central_body.radius_m)

    @property
    def apogee_altitude_m(self) -> np.ndarray | float:
        """Altitude of apogee above the equatorial radius [m], infinite on an open conic."""
        a = np.asarray(self.semi_major_axis_m, dtype=float)
        perigee = self._p / (1.0 + self.eccentricity)
        return _unwrap_scalar(np.where(a > 0.0, 2.0 * a - perigee - self.central_body.radius_m, math.inf))

    @property
    def mean_anomaly_rad(self) -> np.ndarray | float:
        """Mean anomaly [rad]: e sinh H - H on a hyperbola, NaN on a parabola."""
        anomaly = eccentric_from_true(self.true_anomaly_rad, self.eccentricity)
        return _unwrap_scalar(mean_from_eccentric(anomaly, self.eccentricity))


def elements_from_state(
    position_m: np.ndarray, velocity_m_s: np.ndarray, central_body: CentralBody = EARTH
) -> OsculatingElements:
    """Compute the osculating elements of states about the Earth, or about another body.

    Parameters
    ----------
    position_m : (…, 3) from the centre of the body [m]
    velocity_m_s : (…, 3) relative to it [m/s]
    central_body : the body

    Returns
    -------
    OsculatingElements
        in the axes of the states, angles in [0, 2 pi)
    """
    r, v = np.asarray(position_m, dtype=float), np.asarray(velocity_m_s, dtype=float)
    hx, hy, hz = np.moveaxis(cross(r, v), -1, 0)
    radius = length(r)
    h = np.sqrt(hx * hx + hy * hy + hz * hz)
    gm = central_body.gm_m3_s2
    p = h * h / gm
    alpha = 2.0 / radius - (v[..., 0] ** 2 + v[..., 1] ** 2 + v[..., 2] ** 2) / gm
    with np.errstate(divide="ignore"):
        a = np.where(alpha == 0.0, math.inf, 1.0 / alpha)
    # the eccentricity vector along the radius and across it: e cos nu and e sin nu
    out = p / radius - 1.0
    across = h / gm * (r[..., 0] * v[..., 0] + r[..., 1] * v[..., 1] + r[..., 2] * v[..., 2]) / radius
    e = np.hypot(out, across)
    circle = e < ROUND
    sine = np.hypot(hx, hy) / h
    flat = sine < ROUND
    inclination = np.where(flat, np.where(hz < 0.0, math.pi, 0.0), np.arctan2(np.hypot(hx, hy), hz))
    node_x, node_y = np.where(flat, 1.0, -hy), np.where(flat, 0.0, hx)
    raan = np.arctan2(node_y, node_x)
    # argument of latitude: in the orbit plane, from the node
    cosine, node = np.cos(inclination), np.hypot(node_x, node_y)
    ahead = node_x * r[..., 0] + node_y * r[..., 1]
    aside = (node_x * r[..., 1] - node_y * r[..., 0]) * cosine + r[..., 2] * np.sin(inclination) * node
    latitude = np.arctan2(aside, ahead)
    anomaly = np.where(circle, latitude, np.arctan2(across, out))
    perigee = np.where(circle, 0.0, latitude - anomaly)
    return OsculatingElements(
        _unwrap_scalar(a),
        _unwrap_scalar(np.where(circle, 0.0, e)),
        _unwrap_scalar(inclination),
        _unwrap_scalar(_wrap_turn(raan)),
        _unwrap_scalar(_wrap_turn(perigee)),
        _unwrap_scalar(_wrap_turn(anomaly)),
        _unwrap_scalar(p),
        central_body,
    )


def state_from_elements(of: OsculatingElements) -> tuple[np.ndarray, np.ndarray]:
    """Compute the states of osculating elements (Vallado 4th ed. alg. 10).

    Parameters
    ----------
    of : the elements

    Returns
    -------
    position_m, velocity_m_s : (…, 3) [m], [m/s] in the axes of the elements
    """
    p, e = of._p, np.asarray(of.eccentricity, dtype=float)
    nu, argument = np.asarray(of.true_anomaly_rad), np.asarray(of.argument_of_perigee_rad)
    raan, inclination = np.asarray(of.raan_rad), np.asarray(of.inclination_rad)
    speed = np.sqrt(of.central_body.gm_m3_s2 / p)
    c, s = np.cos(nu), np.sin(nu)
    radius = p / (1.0 + e * c)
    x, y, u, w = radius * c, radius * s, -speed * s, speed * (e + c)
    cw, sw, ci, si = np.cos(argument), np.sin(argument), np.cos(inclination), np.sin(inclination)
    co, so = np.cos(raan), np.sin(raan)

    def rotate(along: np.ndarray, aside: np.ndarray) -> np.ndarray:
        """Rotate a vector of the orbit plane (along perigee, and 90 degrees ahead of it) into the axes of the elements."""
        ahead, up = cw * along - sw * aside, sw * along + cw * aside
        return np.stack(np.broadcast_arrays(co * ahead - so * ci * up, so * ahead + co * ci * up, si * up), axis=-1)

    return rotate(x, y), rotate(u, w)


def _wrap_turn(angle: np.ndarray) -> np.ndarray:
    """Wrap an angle into [0, 2 pi)."""
    turned = np.where(angle < 0.0, angle + math.tau, angle)
    turned = np.where(turned < 0.0, turned + math.tau, turned)
    return np.where(turned >= math.tau, 0.0, turned)


def _unwrap_scalar(value: np.ndarray) -> np.ndarray | float:
    """Return an array, or a float where it holds one number."""
    return float(value) if np.ndim(value) == 0 else value
