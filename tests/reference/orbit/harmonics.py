"""The gradient of the potential of spherical harmonics, through SciPy's associated Legendre functions and their slopes: the
oracle of `rso_lidar.orbit.propagation.harmonics.attract` and `rso_lidar.orbit.propagation.harmonics.attract_points`.
"""

import math

import numpy as np
from scipy.special import assoc_legendre_p_all


def attract_points(points, gm, radius_m, cosine, sine):
    """Return accelerations (point, 3) [m/s2] by degree 2 and above; the poles are singular here.

    In spherical coordinates (Montenbruck & Gill eq. 3.28): the slopes along radius, latitude and longitude.
    """
    top = len(cosine) - 1
    total = []
    for x, y, z in points:
        r, across = math.sqrt(x * x + y * y + z * z), math.hypot(x, y)
        angle = math.atan2(y, x)
        # orthonormal over -1 to 1, with the phase of Condon and Shortley, which geodesy leaves out
        value, slope = assoc_legendre_p_all(top, top, z / r, norm=True, diff_n=1)
        outward = north = east = 0.0
        for n in range(2, top + 1):
            for m in range(n + 1):
                scale = gm / r * (radius_m / r) ** n * (-1) ** m * math.sqrt(2.0 * (2.0 if m else 1.0))
                c, s = math.cos(m * angle), math.sin(m * angle)
                even, odd = cosine[n, m] * c + sine[n, m] * s, sine[n, m] * c - cosine[n, m] * s
                outward -= scale * (n + 1) / r * value[n, m] * even
                north += scale / r * slope[n, m] * across / r * even
                east += scale / across * value[n, m] * m * odd
        up = np.array([x, y, z]) / r
        along = np.array([-y, x, 0.0]) / across
        total.append(outward * up + north * np.cross(up, along) + east * along)
    return np.array(total)


def attract(x, y, z, gm, radius_m, cosine, sine):
    """Return the acceleration (3,) [m/s2] at one point."""
    return attract_points(np.array([[x, y, z]]), gm, radius_m, cosine, sine)[0]
