"""The lit Earth as a Lambertian sphere of its equatorial radius, without an atmosphere."""

import math

import numpy as np

from rso_lidar import units


def earth_radiance(direction: np.ndarray, earth: np.ndarray, sun: np.ndarray, albedo: float) -> np.ndarray:
    """Return the radiance (…) of the Earth over the Sun's irradiance [1/sr]: albedo / π times the cosine of incidence.

    It is 0 on the night side, and meaningless for a direction that misses the Earth.

    Parameters
    ----------
    direction : (…, 3) unit vectors
    earth, sun : (xyz) vectors to the centres of the Earth and the Sun [m]
    """
    along = np.sum(direction * earth, axis=-1)
    inside = along**2 - float(earth @ earth) + units.EARTH_RADIUS_M**2
    point = (along - np.sqrt(np.maximum(inside, 0.0)))[..., None] * direction - earth
    to_sun = sun - earth
    cosine = np.sum(point * to_sun, axis=-1) / (units.EARTH_RADIUS_M * float(np.linalg.norm(to_sun)))
    lit: np.ndarray = albedo / math.pi * np.maximum(cosine, 0.0)
    return lit
