"""The rotation of the Earth: from inertial axes to axes fixed in the Earth."""

from __future__ import annotations

import numpy as np

from rso_lidar.orbit.epochs import Epochs


def itrs_from_gcrs(epochs: Epochs) -> np.ndarray:
    """Return rotation matrices from GCRS to Earth-fixed (ITRS) coordinates.

    Precession (IAU 2006), nutation (IAU 2000A) and Earth rotation are skyfield's, with its built-in UT1. Polar motion
    is left out: up to 0.6 arcsecond, 20 m on the ground. Where UT1 has been observed it is good to half a millisecond,
    0.2 m at the equator. Where it is predicted it is good to some 20 ms. Each epoch takes a quarter of a millisecond.

    Parameters
    ----------
    epochs : instants

    Returns
    -------
    (time, 3, 3)
    """
    from skyfield.framelib import itrs

    matrix = np.empty((len(epochs), 3, 3))
    for k in range(len(epochs)):  # one by one, because the bits of skyfield's sums depend on the number of epochs
        matrix[k] = itrs.rotation_at(epochs.at(slice(k, k + 1)).skyfield_time())[..., 0]
    return matrix
