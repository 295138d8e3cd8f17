"""Attraction of the Earth by spherical harmonics to any degree and order, in Earth-fixed axes.

Cunningham's recursion (Montenbruck & Gill, Satellite Orbits, sec. 3.2.4 and 3.2.5) in fully normalised functions. It has no
singularity at the poles.
"""

from __future__ import annotations

import math

import numpy as np

from rso_lidar.kernels import kernel, packed


class Harmonics:
    """A gravity field in Earth-fixed axes: the coefficients, fully normalised, and the factors of the recursion.

    Parameters
    ----------
    gm : of the field [m3/s2]
    radius_m : to which the coefficients belong [m]
    cosine, sine : (degree + 1, degree + 1) coefficients by degree and order
    """

    def __init__(self, gm: float, radius_m: float, cosine: np.ndarray, sine: np.ndarray) -> None:
        self.gm = gm
        top = len(cosine) - 1
        order = int(np.flatnonzero(((cosine != 0.0) | (sine != 0.0)).any(axis=0)).max(initial=0))
        factors = packed(_recursion_factors(top + 1)), packed(_gradient_factors(top))
        self._field = (gm, radius_m, order, packed(cosine, float), packed(sine, float), *factors)

    def perturb(self, x: float, y: float, z: float) -> tuple[float, float, float]:
        """Return the acceleration [m/s2] by degree 2 and above at a position [m]."""
        acceleration: tuple[float, float, float] = attract(x, y, z, *self._field)
        return acceleration

    def perturb_points(self, points: np.ndarray) -> np.ndarray:
        """Return the accelerations (point, 3) [m/s2] by degree 2 and above at positions (point, 3) [m]."""
        accelerations: np.ndarray = attract_points(packed(points), *self._field)
        return accelerations


def _recursion_factors(top: int) -> np.ndarray:
    """Return the factors (top + 1, top + 1, 2) of the two terms below a function, by degree and order.

    On the diagonal the first belongs to the function one degree and one order below.
    """
    factors = np.zeros((top + 1, top + 1, 2))
    for m in range(top + 1):
        if m:
            factors[m, m, 0] = math.sqrt((2 * m + 1) / (2 * m) * (2.0 if m == 1 else 1.0))
        for n in range(m + 1, top + 1):
            share = (2 * n + 1) / ((n - m) * (n + m))
            factors[n, m, 0] = math.sqrt(share * (2 * n - 1))
            factors[n, m, 1] = math.sqrt(share * (n + m - 1) * (n - m - 1) / (2 * n - 3)) if n > m + 1 else 0.0
    return factors


def _gradient_factors(top: int) -> np.ndarray:
    """Return the factors (top + 1, top + 1, 3) of functions one degree up, of order m + 1, m - 1 and m."""
    factors = np.zeros((top + 1, top + 1, 3))
    for n in range(top + 1):
        share = (2 * n + 1) / (2 * n + 3)
        for m in range(n + 1):
            factors[n, m, 0] = math.sqrt(share * (n + m + 1) * (n + m + 2) * (1.0 if m else 0.5)) * (0.5 if m else 1.0)
            if m:
                factors[n, m, 1] = 0.5 * math.sqrt(share * (n - m + 1) * (n - m + 2) * (2.0 if m == 1 else 1.0))
            factors[n, m, 2] = math.sqrt(share * (n + m + 1) * (n - m + 1))
    return factors


@kernel
def attract(
    x: float,
    y: float,
    z: float,
    gm: float,
    radius_m: float,
    order: int,
    cosine: np.ndarray,
    sine: np.ndarray,
    up: np.ndarray,
    slopes: np.ndarray,
) -> tuple[float, float, float]:
    """Return the acceleration [m/s2] by degree 2 and above, in Earth-fixed axes.

    Parameters
    ----------
    x, y, z : position in Earth-fixed axes [m]
    gm, radius_m, cosine, sine : as in `Harmonics`
    order : greatest one of the coefficients
    up, slopes : factors of the recursion and of its gradient
    """
    top = cosine.shape[0] - 1
    ratio = radius_m / (x * x + y * y + z * z)
    east, ahead, north, fall = x * ratio, y * ratio, z * ratio, radius_m * ratio
    last = min(order, top) + 1
    even = np.zeros((top + 2, last + 1))
    odd = np.zeros((top + 2, last + 1))
    even[0, 0] = radius_m / math.sqrt(x * x + y * y + z * z)
    for m in range(last + 1):
        if m > 0:
            k = up[m, m, 0]
            even[m, m] = k * (east * even[m - 1, m - 1] - ahead * odd[m - 1, m - 1])
            odd[m, m] = k * (east * odd[m - 1, m - 1] + ahead * even[m - 1, m - 1])
        for n in range(m + 1, top + 2):
            k, j = up[n, m, 0] * north, up[n, m, 1] * fall
            even[n, m] = k * even[n - 1, m]
            odd[n, m] = k * odd[n - 1, m]
            if n > m + 1:
                even[n, m] -= j * even[n - 2, m]
                odd[n, m] -= j * odd[n - 2, m]
    ax = ay = az = 0.0
    for n in range(top, 1, -1):
        for m in range(min(n, order) + 1):
            c, s = cosine[n, m], sine[n, m]
            if m == 0:
                ax -= c * slopes[n, 0, 0] * even[n + 1, 1]
                ay -= c * slopes[n, 0, 0] * odd[n + 1, 1]
            else:
                k, j = slopes[n, m, 0], slopes[n, m, 1]
                e, o, f, p = even[n + 1, m + 1], odd[n + 1, m + 1], even[n + 1, m - 1], odd[n + 1, m - 1]
                ax += j * (c * f + s * p) - k * (c * e + s * o)
                ay += j * (s * f - c * p) + k * (s * e - c * o)
            az -= slopes[n, m, 2] * (c * even[n + 1, m] + s * odd[n + 1, m])
    scale = gm / (radius_m * radius_m)
    return scale * ax, scale * ay, scale * az


@kernel
def attract_points(
    points: np.ndarray,
    gm: float,
    radius_m: float,
    order: int,
    cosine: np.ndarray,
    sine: np.ndarray,
    up: np.ndarray,
    slopes: np.ndarray,
) -> np.ndarray:
    """Return the accelerations (point, 3) [m/s2] by degree 2 and above, in Earth-fixed axes.

    Parameters
    ----------
    points : (point, 3) positions in Earth-fixed axes [m]
    gm, radius_m, cosine, sine : as in `Harmonics`
    order : greatest one of the coefficients
    up, slopes : factors of the recursion and of its gradient
    """
    total = np.empty((points.shape[0], 3))
    for k in range(points.shape[0]):
        x, y, z = attract(points[k, 0], points[k, 1], points[k, 2], gm, radius_m, order, cosine, sine, up, slopes)
        total[k, 0], total[k, 1], total[k, 2] = x, y, z
    return total
