"""Stars: a small catalogue, and their light in a band over that of the Sun.

The catalogue holds the Hipparcos stars to magnitude 6, without proper motion: most are within 2 arcseconds of their place in
2026, the fastest within 2 arcminutes. A star is a black body whose temperature follows from B-V (Ballesteros, EPL 97, 34008,
2012, eq. 14), as bright in V as the catalogue says. Over a band that is good to some 10 %, for cool stars and in the near
infrared to some 30 %.
"""

from __future__ import annotations

import csv
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from rso_lidar import scene, units
from rso_lidar.optics import Receiver, blur_steady_light
from rso_lidar.pose import ROOT, rotate_vectors
from rso_lidar.records import Truth
from rso_lidar.scene import Surface
from rso_lidar.shipped import shipped

_SUN_MAGNITUDE = -26.74  # V; Allen, Astrophysical Quantities, 3rd ed. (1973), sec. 66
_SUN_TEMPERATURE_K = 5772.0  # IAU 2015 resolution B3
_V_BAND_M = 550e-9  # middle of the V band
_SECOND_RADIATION_M_K = units.PLANCK_J_S * units.SPEED_OF_LIGHT_M_S / 1.380_649e-23  # h c / k
_MIDDLE_B_MINUS_V = 0.6  # assumed for the two stars without a colour
_SUBCELLS = 8  # along each side of a pixel, between whose middles the point spread function is interpolated


@dataclass(frozen=True, eq=False)
class StarCatalogue:
    """Stars by brightness: unit vectors (star, xyz) in ICRS, V magnitudes (star) and temperatures [K] (star)."""

    direction: np.ndarray
    magnitude: np.ndarray
    temperature_k: np.ndarray

    def irradiance_over_sun(self, wavelength_m: float) -> np.ndarray:
        """Return the spectral irradiance of each star (star) over that of the Sun at 1 au.

        Parameters
        ----------
        wavelength_m : of the light [m]
        """

        def colour(temperature_k: np.ndarray | float) -> np.ndarray:
            """Return the light of a black body at the wavelength, over that in the V band."""
            exponents = _SECOND_RADIATION_M_K / (np.array([_V_BAND_M, wavelength_m])[:, None] * temperature_k)
            in_v, here = np.expm1(exponents)
            ratio: np.ndarray = in_v / here
            return ratio

        over_sun: np.ndarray = 10.0 ** (-0.4 * (self.magnitude - _SUN_MAGNITUDE))
        over_sun *= colour(self.temperature_k) / colour(_SUN_TEMPERATURE_K)
        return over_sun


@lru_cache(maxsize=1)
def load_stars() -> StarCatalogue:
    """Load the shipped catalogue of stars."""
    with shipped("stars/hipparcos_6.csv").open(encoding="utf-8", newline="") as file:
        rows = [
            (*map(float, list(row.values())[1:4]), float(row["b_minus_v"] or _MIDDLE_B_MINUS_V))
            for row in csv.DictReader(file)
        ]
    ascension, declination, magnitude, b_minus_v = np.array(rows).T
    ascension, declination = ascension * units.DEG, declination * units.DEG
    across = np.cos(declination)
    direction = np.stack([across * np.cos(ascension), across * np.sin(ascension), np.sin(declination)], axis=1)
    temperature_k = 4600.0 * (1.0 / (0.92 * b_minus_v + 1.7) + 1.0 / (0.92 * b_minus_v + 0.62))
    return StarCatalogue(direction, magnitude, temperature_k)


def image_stars(
    receiver: Receiver, view: Truth, surfaces: Sequence[Surface], bodies: Sequence[tuple[np.ndarray, float]]
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Find the stars in the image that nothing hides.

    Parameters
    ----------
    receiver : lens and focal plane
    view : one epoch, with the camera in it as "lidar"
    surfaces : surfaces of the targets
    bodies : bodies of the sky that hide stars: vector to the centre (xyz) in camera axes [m], and radius [m]

    Returns
    -------
    Numbers of the stars, and the column, row and cosine of the angle from the boresight of each (star).
    """
    from_root = np.asarray(view.poses.place("lidar", ROOT)[1])
    toward = rotate_vectors(from_root, load_stars().direction)
    ahead = np.flatnonzero(toward[:, 2] > 1.0 / np.sqrt(1.0 + 2.0 * float(receiver.field_edge.max()) ** 2))
    toward = toward[ahead]
    col, row = receiver.image_of(toward[:, 0] / toward[:, 2], toward[:, 1] / toward[:, 2])
    is_inside = (col >= 0.0) & (col < receiver.n_cols) & (row >= 0.0) & (row < receiver.n_rows)
    for centre, radius_m in bodies:
        distance_m = float(np.linalg.norm(centre))
        if distance_m > radius_m:
            is_inside &= toward @ (centre / distance_m) < np.sqrt(1.0 - (radius_m / distance_m) ** 2)
    inside = np.flatnonzero(is_inside)
    inside = inside[~scene.find_hidden(toward[inside], surfaces, view)]
    return ahead[inside], col[inside], row[inside], toward[inside, 2]


def spread_stars(
    stars: tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray], receiver: Receiver, wavelength_m: float
) -> np.ndarray:
    """Return the light of stars on each pixel, over the irradiance of the Sun (row, col) [m²].

    Parameters
    ----------
    stars : from `image_stars`
    receiver : lens and focal plane
    wavelength_m : of the light [m]
    """
    number, col, row, cosine = stars
    gathered = receiver.aperture_area_m2 * receiver.transmission * cosine
    light = load_stars().irradiance_over_sun(wavelength_m)[number] * gathered
    down, across = np.floor(row).astype(np.int64), np.floor(col).astype(np.int64)
    pixel = down * receiver.n_cols + across
    if receiver.psf is not None and len(pixel):
        return blur_steady_light(pixel, light, (row - down, col - across), _SUBCELLS, receiver, wavelength_m)
    return np.bincount(pixel, light, receiver.n_rows * receiver.n_cols).reshape(receiver.shape)
