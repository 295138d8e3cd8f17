"""Propagation of mean elements with the secular rates of J2, and the first-order map between mean and osculating elements.

Mean elements are Brouwer's without his long-period part (Brouwer 1959, Astron. J. 64, 378): what is left of an orbit when
the short-period oscillation of J2 is removed. Here they are rows

    [a_m, latitude_rad, ex, ey, inclination_rad, raan_rad]        (…, 6)

with latitude = argument of perigee + mean anomaly and (ex, ey) = e (cos, sin) of the argument of perigee, in axes whose z
is the Earth's pole. The map is canonical, x = x' + {x', S}, with Brouwer's generator S as a function of position and
velocity. There it is smooth, so the map has no singularity on a circle, on the equator, or at any inclination. Then the
speed is set so that the energy, J2 included, equals that of the mean elements to second order. The rates are Brouwer's to
second order.

Accuracy against a numerical integration with J2 alone, over a day: 45 m at 7000 km for e up to 0.02, 35 m at 8500 km and
e = 0.2, 90 m at 23,000 km and e = 0.7. Half of it is present at the epoch (J2 squared times the radius is 8 m); the rest is
the long-period change of e and perigee. J3 and all other forces are left out: 1 to 10 km a day in low orbit.
"""

from __future__ import annotations

from typing import Literal, Self

import numpy as np
from pydantic import Field, model_validator

from rso_lidar import units
from rso_lidar.errors import PropagationError
from rso_lidar.orbit.epochs import Epochs
from rso_lidar.orbit.sky.precession import equator_axes
from rso_lidar.orbit.two_body.anomaly import mean_from_true, true_from_mean
from rso_lidar.orbit.two_body.kepler import ClassicalElements
from rso_lidar.orbit.two_body.osculating_elements import OsculatingElements, elements_from_state, state_from_elements
from rso_lidar.pose import dot, rotate_vectors
from rso_lidar.records import BodyState

GM = units.EARTH_GM_M3_S2
_K2 = 0.5 * units.EARTH_J2 * units.EARTH_ZONAL_RADIUS_M**2  # Brouwer's k2 [m2]
_ROUNDS = 12  # iterations of the inverse map; each reduces the error to some 10 J2 of it
_STEP = 1e-30  # relative size of the complex step of the derivative
_LONG_DAYS = 3.0
_LOW_M = 450e3


class J2(ClassicalElements):
    """Propagation of `elements` at `epoch_utc` with the secular rates of J2 and its short-period oscillation.

    The elements are in GCRS axes; J2 acts about the pole of date. J3 and all other forces are left out: 1 to 10 km a
    day in low orbit.
    """

    type: Literal["j2"] = "j2"
    elements: Literal["mean", "osculating"] = Field(
        default="mean",
        description=(
            "Kind of elements: `mean` of J2 (Brouwer's, without long-period terms), or `osculating` of the state at "
            "`epoch_utc`."
        ),
    )

    @model_validator(mode="after")
    def _check_closed(self) -> Self:
        if self.eccentricity >= 1.0:
            raise ValueError("eccentricity: an open orbit has no mean elements; give its motion as type 'numerical'")
        return self

    def states(self, epochs: Epochs) -> BodyState:
        """Return position [m] and velocity [m/s] (time, 3) in GCRS axes."""
        turn = equator_axes(Epochs(self.epoch_utc, np.zeros(1)))[0]
        start = self.at_epoch()
        position, velocity = rotate_vectors(turn, start.position_m), rotate_vectors(turn, start.velocity_m_s)
        mean = quasi_nonsingular_from_state(position, velocity)
        if self.elements == "osculating":
            mean = mean_from_osculating(position, velocity)
        position, velocity = osculating_from_mean(propagate_j2_secular(mean, epochs.since(self.epoch_utc)))
        return BodyState(rotate_vectors(turn.T, position), rotate_vectors(turn.T, velocity))

    def validity(self, epochs: Epochs) -> list[str]:
        """Return one sentence for each limit of the model that the epochs exceed, with a better choice.

        Parameters
        ----------
        epochs : instants
        """
        sentences = []
        days = float(np.abs(epochs.since(self.epoch_utc)).max(initial=0.0)) / units.DAY_S
        if days > _LONG_DAYS:
            sentences.append(
                f"j2: propagated {days:.1f} days from its epoch; what it leaves out (J3, drag, Sun and Moon) moves a "
                "low orbit by 1 to 10 km a day; use type 'numerical'"
            )
        height_m = self.perigee_m - units.EARTH_RADIUS_M
        if height_m < _LOW_M:
            sentences.append(
                f"j2: the perigee is {height_m / units.KM:.0f} km high; below {_LOW_M / units.KM:g} km drag, which it "
                "leaves out, matters within a day; use type 'numerical' with forces.drag"
            )
        return sentences


def quasi_nonsingular_from_state(position_m: np.ndarray, velocity_m_s: np.ndarray) -> np.ndarray:
    """Convert states to quasi-nonsingular elements.

    On the equator the node is at +x. The conversion is purely geometric: a mean state gives mean elements.

    Parameters
    ----------
    position_m, velocity_m_s : (…, 3) states in axes whose z is the Earth's pole [m], [m/s]

    Returns
    -------
    (…, 6) rows [a_m, latitude_rad, ex, ey, inclination_rad, raan_rad]
    """
    of = elements_from_state(position_m, velocity_m_s)
    perigee = np.asarray(of.argument_of_perigee_rad)
    latitude = perigee + mean_from_true(of.true_anomaly_rad, of.eccentricity)
    ex, ey = of.eccentricity * np.cos(perigee), of.eccentricity * np.sin(perigee)
    return np.stack([of.semi_major_axis_m, latitude, ex, ey, of.inclination_rad, of.raan_rad], axis=-1)


def state_from_quasi_nonsingular(rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Convert quasi-nonsingular elements to states; the inverse of `quasi_nonsingular_from_state`.

    Parameters
    ----------
    rows : (…, 6) rows [a_m, latitude_rad, ex, ey, inclination_rad, raan_rad] in axes whose z is the Earth's pole

    Returns
    -------
    position_m, velocity_m_s : (…, 3) in the same axes [m], [m/s]
    """
    a, latitude, ex, ey, inclination, raan = np.moveaxis(np.asarray(rows, dtype=float), -1, 0)
    e, perigee = np.hypot(ex, ey), np.arctan2(ey, ex)
    return state_from_elements(
        OsculatingElements(a, e, inclination, raan, perigee, true_from_mean(latitude - perigee, e))
    )


def osculating_from_mean(mean: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Convert mean elements of J2 to osculating states.

    Parameters
    ----------
    mean : (…, 6) rows [a_m, latitude_rad, ex, ey, inclination_rad, raan_rad] in axes whose z is the Earth's pole

    Returns
    -------
    position_m, velocity_m_s : (…, 3) in the same axes [m], [m/s]
    """
    position, velocity = state_from_quasi_nonsingular(mean)
    moved, changed = _short_period(position, velocity)
    position, velocity = position + moved, velocity + changed
    speed2 = dot(velocity, velocity)
    factor = np.sqrt(np.maximum(1.0 + 2.0 * (_mean_energy(mean) - _energy(position, speed2)) / speed2, 0.0))
    return position, velocity * factor[..., None]


def mean_from_osculating(position_m: np.ndarray, velocity_m_s: np.ndarray) -> np.ndarray:
    """Convert osculating states to mean elements of J2, by iteration of `osculating_from_mean`.

    Parameters
    ----------
    position_m, velocity_m_s : (…, 3) states in axes whose z is the Earth's pole [m], [m/s]

    Returns
    -------
    (…, 6) rows [a_m, latitude_rad, ex, ey, inclination_rad, raan_rad]

    Raises
    ------
    PropagationError
        if an orbit is open, or the iteration does not converge; its `bad` masks those states
    """
    wanted_r, wanted_v = np.asarray(position_m, dtype=float), np.asarray(velocity_m_s, dtype=float)
    r, v = wanted_r, wanted_v
    apart = np.full(r.shape[:-1], np.inf)
    with np.errstate(all="ignore"):
        for _ in range(_ROUNDS):
            mean = quasi_nonsingular_from_state(r, v)
            got_r, got_v = osculating_from_mean(mean)
            r, v = r + (wanted_r - got_r), v + (wanted_v - got_v)
            apart = np.sqrt(dot(wanted_r - got_r, wanted_r - got_r) / dot(wanted_r, wanted_r))
        mean = quasi_nonsingular_from_state(r, v)
    bad = ~(apart < 1e-9)
    if bad.any():
        raise PropagationError(
            "mean elements: this state has none (an open orbit, or one inside the Earth); use type 'numerical'",
            np.atleast_1d(bad),
        )
    return mean


def secular_rates(mean: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the rates (…) [rad/s] of mean anomaly, argument of perigee and node (Brouwer 1959, to J2 squared)."""
    first, second = _rates(mean)
    motion = np.sqrt(GM / np.asarray(mean)[..., 0] ** 3)
    return motion + first[0] + second[0], first[1] + second[1], first[2] + second[2]


def propagate_j2_secular(mean: np.ndarray, dt_s: np.ndarray | float) -> np.ndarray:
    """Propagate mean elements with their secular rates.

    Parameters
    ----------
    mean : (…, 6) rows [a_m, latitude_rad, ex, ey, inclination_rad, raan_rad]
    dt_s : (…) time [s]; one row and many times, or as many of both

    Returns
    -------
    (…, 6) rows after that time
    """
    anomaly, perigee, node = secular_rates(mean)
    rows, dt = np.asarray(mean, dtype=float), np.asarray(dt_s, dtype=float)
    c, s = np.cos(perigee * dt), np.sin(perigee * dt)
    ex, ey = rows[..., 2], rows[..., 3]
    columns = (
        rows[..., 0],
        rows[..., 1] + (anomaly + perigee) * dt,
        ex * c - ey * s,
        ex * s + ey * c,
        rows[..., 4],
        rows[..., 5] + node * dt,
    )
    return np.stack(np.broadcast_arrays(*columns), axis=-1)


def _rates(mean: np.ndarray) -> tuple[tuple[np.ndarray, ...], tuple[np.ndarray, ...]]:
    """Return the contributions of J2, and of J2 squared, to the rates [rad/s] of mean anomaly, perigee and node."""
    a, _, ex, ey, inclination, _ = np.moveaxis(np.asarray(mean, dtype=float), -1, 0)
    motion = np.sqrt(GM / a**3)
    t = np.cos(inclination)
    n2 = 1.0 - ex * ex - ey * ey  # eta squared
    n = np.sqrt(n2)
    g = _K2 / (a * n2) ** 2  # Brouwer's gamma2'
    t2 = t * t
    t4 = t2 * t2
    f = motion * g
    first = (1.5 * f * n * (3.0 * t2 - 1.0), 1.5 * f * (5.0 * t2 - 1.0), -3.0 * f * t)
    f = f * g
    anomaly = -15.0 + 16.0 * n + 25.0 * n2 + (30.0 - 96.0 * n - 90.0 * n2) * t2 + (105.0 + 144.0 * n + 25.0 * n2) * t4
    perigee = -35.0 + 24.0 * n + 25.0 * n2 + (90.0 - 192.0 * n - 126.0 * n2) * t2 + (385.0 + 360.0 * n + 45.0 * n2) * t4
    node = (-5.0 + 12.0 * n + 9.0 * n2) * t - (35.0 + 36.0 * n + 5.0 * n2) * t * t2
    return first, (0.09375 * f * n * anomaly, 0.09375 * f * perigee, 0.375 * f * node)


def _mean_energy(mean: np.ndarray) -> np.ndarray:
    """Return the energy [m2/s2] of mean elements to J2 squared.

    The terms of the averaged Hamiltonian are homogeneous in Delaunay's momenta L, G, H, of degree -6 and -10. Their
    derivatives are the rates, so Euler's theorem recovers the terms from the rates.
    """
    rows = np.asarray(mean, dtype=float)
    a = rows[..., 0]
    big_l = np.sqrt(GM * a)
    big_g = big_l * np.sqrt(1.0 - rows[..., 2] ** 2 - rows[..., 3] ** 2)
    big_h = big_g * np.cos(rows[..., 4])
    first, second = (big_l * m + big_g * p + big_h * o for m, p, o in _rates(rows))
    energy: np.ndarray = -0.5 * GM / a - first / 6.0 - second / 10.0
    return energy


def _energy(position_m: np.ndarray, speed2: np.ndarray) -> np.ndarray:
    """Return the energy [m2/s2] of a state about a point mass with J2."""
    r2 = dot(position_m, position_m)
    r = np.sqrt(r2)
    energy: np.ndarray = 0.5 * speed2 - GM / r + GM * _K2 / (r * r2) * (3.0 * position_m[..., 2] ** 2 / r2 - 1.0)
    return energy


def _short_period(position_m: np.ndarray, velocity_m_s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return {x, S}: the first-order change (…, 3) of position, dS/dv [m], and of velocity, -dS/dr [m/s]."""
    state = np.concatenate([position_m, velocity_m_s], axis=-1)
    slopes = []
    for k in range(6):
        there = [state[..., j].astype(complex) for j in range(6)]
        size = np.where(k < 3, 1e7, 1e4)
        there[k] = there[k] + 1j * _STEP * size
        slopes.append(_generator(*there).imag / (_STEP * size))
    return np.stack(slopes[3:], axis=-1), -np.stack(slopes[:3], axis=-1)


def _generator(x: np.ndarray, y: np.ndarray, z: np.ndarray, u: np.ndarray, v: np.ndarray, w: np.ndarray) -> np.ndarray:
    """Return Brouwer's first-order short-period generator [m2/s] of a state, which may be complex for its derivative.

    n dS/dM = V - <V> with V = GM k2 (3 sin^2 latitude - 1) / r^3, in e cos f, e sin f and the components of sin i along and
    across the radius, all of them smooth in the state.

    Parameters
    ----------
    x, y, z : position [m]
    u, v, w : velocity [m/s]
    """
    r = np.sqrt(x * x + y * y + z * z)
    hx, hy, hz = y * w - z * v, z * u - x * w, x * v - y * u
    h2 = hx * hx + hy * hy + hz * hz
    h = np.sqrt(h2)
    radial = (x * u + y * v + z * w) / r
    ec, es = h2 / (GM * r) - 1.0, h * radial / GM  # e cos f, e sin f
    axis = 1.0 / (2.0 / r - (u * u + v * v + w * w) / GM)
    eta = h / np.sqrt(GM * axis)
    xc, xs = (hx * y - hy * x) / (h * r), z / r  # sin i cos u, sin i sin u
    inside = r * radial / np.sqrt(GM * axis)  # e sin E
    centre = 2.0 * np.arctan(inside / (eta + r / axis)) + inside  # f - M; 1 + eta - e cos E = eta + r / a
    double, other = 2.0 * xc * xs, xc * xc - xs * xs  # sin^2 i times sin 2u and cos 2u
    sine2 = (hx * hx + hy * hy) / h2
    wave = 0.5 * double + (2.0 / 3.0) * double * ec - other * es / 3.0
    generator: np.ndarray = _K2 * GM * GM / (h2 * h) * ((1.5 * sine2 - 1.0) * (centre + es) - 1.5 * wave)
    return generator
