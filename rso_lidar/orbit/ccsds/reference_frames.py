"""Reference frames of CCSDS messages, and their rotation to GCRS axes."""

from __future__ import annotations

import numpy as np

from rso_lidar import units
from rso_lidar.errors import ScenarioError
from rso_lidar.orbit.epochs import Epochs
from rso_lidar.orbit.sets.teme import gcrs_from_teme

_GCRS = ("GCRF", "GCRS", "ICRF", "ICRF1", "ICRF2", "ICRF3", "ICRS")  # equal axes; the centre is the Earth's here
_EME2000 = ("EME2000", "J2000", "EMEJ2000", "J2000.0")
_TEME = ("TEME", "TEMEOFDATE")
ARCSEC = units.DEG / 3600.0


def gcrs_from_eme2000() -> np.ndarray:
    """Return the rotation matrix (3, 3) from EME2000 (mean equator and equinox of J2000.0) to GCRS: the frame bias, 23 mas.

    USNO Circular 179 (Kaplan 2005), sec. 3.5, with the IAU 2000A offsets d_alpha0 = -14.6, xi0 = -16.6170, eta0 =
    -6.8192 mas: EME2000 = R1(-eta0) R2(xi0) R3(d_alpha0) GCRS.
    """
    alpha, xi, eta = -0.014_600 * ARCSEC, -0.016_617_0 * ARCSEC, -0.006_819_2 * ARCSEC
    about_x = np.array([[1, 0, 0], [0, np.cos(-eta), np.sin(-eta)], [0, -np.sin(-eta), np.cos(-eta)]])
    about_y = np.array([[np.cos(xi), 0, -np.sin(xi)], [0, 1, 0], [np.sin(xi), 0, np.cos(xi)]])
    about_z = np.array([[np.cos(alpha), np.sin(alpha), 0], [-np.sin(alpha), np.cos(alpha), 0], [0, 0, 1]])
    matrix: np.ndarray = (about_x @ about_y @ about_z).T
    return matrix


def parse_frame(name: str, where: str) -> str:
    """Parse the name of a frame: "gcrs", "eme2000" or "teme".

    Raises
    ------
    ScenarioError
        if the frame is unknown, or rotates with the Earth
    """
    plain = name.upper().replace(" ", "").replace("_", "").replace("-", "")
    for frame, names in (("gcrs", _GCRS), ("eme2000", _EME2000), ("teme", _TEME)):
        if plain in names:
            return frame
    turning = plain.startswith(("ITRF", "GRC", "TDR", "GTOD", "WGS")) or plain in ("ECEF", "EFG", "ECR")
    why = "turns with the Earth" if turning else "is not supported"
    raise ScenarioError(f"{where}: reference frame {name} {why}: write the file in GCRF, EME2000 or TEME")


def gcrs_from_frame(frame: str, epochs: Epochs) -> np.ndarray | None:
    """Return the rotation matrices (time, 3, 3) or (3, 3) from a parsed frame to GCRS axes; None where it is GCRS."""
    if frame == "gcrs":
        return None
    if frame == "eme2000":
        return gcrs_from_eme2000()
    return gcrs_from_teme(epochs)
