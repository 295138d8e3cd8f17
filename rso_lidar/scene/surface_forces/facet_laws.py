"""Laws of a facet: the momentum that sunlight and thin air leave on it.

Each law gives two coefficients: a facet of area A, with unit normal n on the side that is struck and unit vector d toward
the source, takes the force -A p (along d + normal n). Light and molecules that a facet throws off and that strike another
facet are left out.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class GasLaw:
    """Free-molecular flow about a facet (Sentman 1961), molecules thrown off diffusely.

    Attributes
    ----------
    speed_ratio : speed over the most probable thermal speed of the molecules
    temperature_ratio : temperature of the wall over that of the air
    accommodation : share of the molecules' surplus of energy that the wall takes, from 0 to 1
    """

    speed_ratio: float
    temperature_ratio: float
    accommodation: float

    @property
    def rebound(self) -> float:
        """Speed of the molecules thrown off over that of flight, by Koppenwallner's accommodation of energy.

        Koppenwallner, Energy accommodation coefficient and momentum transfer modeling, HTG-TN-08-11, 2009. Moe's form has
        2/3 in place of 1/2 and T / (2/3 s^2 T_air); at full accommodation the two are the same.
        """
        cooled = self.accommodation * (2.0 * self.temperature_ratio / self.speed_ratio**2 - 1.0)
        return math.sqrt(0.5 * (1.0 + cooled))

    def find_coefficients(self, cosine: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the coefficients along the flight and along the normal; the pressure is the dynamic one.

        Parameters
        ----------
        cosine : of the angle from the normal to the flight, from -1 to 1 (facet)

        Returns
        -------
        (facet) and (facet)
        """
        from scipy.special import erf

        s = self.speed_ratio
        thermal = np.exp(-((cosine * s) ** 2)) / s
        share = 1.0 + erf(cosine * s)
        # of molecules, times 2 sqrt(pi) over density and speed
        flux = cosine * math.sqrt(math.pi) * share + thermal
        return flux / math.sqrt(math.pi), share / (2.0 * s * s) + 0.5 * self.rebound * flux


def find_light_coefficients(
    cosine: np.ndarray, specular: np.ndarray, diffuse: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return the coefficients of sunlight toward the Sun and along the normal.

    The mirror is that of Montenbruck & Gill, eq. 3.73. Light that leaves by Lambert's law has a mean cosine of 2/3, and
    pushes along the normal by that share.

    Parameters
    ----------
    cosine : of the angle of incidence, from 0 to 1 (facet)
    specular : share that is reflected as by a mirror (facet)
    diffuse : share that leaves by Lambert's law: reflected, or absorbed and given off as heat at once (facet)

    Returns
    -------
    (facet) and (facet)
    """
    return cosine * (1.0 - specular), 2.0 * cosine * (specular * cosine + diffuse / 3.0)
