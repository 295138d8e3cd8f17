"""How the Earth is turned: the rotation from inertial axes to those fixed in the Earth."""

from __future__ import annotations

import numpy as np

from rso_lidar.orbit.epochs import Epochs


def itrs_from_gcrs(epochs: Epochs) -> np.ndarray:
    """Return rotation matrices (time, 3, 3) that take GCRS coordinates to Earth-fixed (ITRS) ones.

    Precession (IAU 2006), nutation (IAU 2000A) and Earth rotation as skyfield has them, with its built-in UT1. Polar motion
    is left out: up to 0.6 arcsecond, 20 m on the ground. UT1 is good to half a millisecond where it has been observed, 0.2 m
    at the equator, and to some 20 ms where it is predicted. A quarter of a millisecond of work for each epoch.
    """
    from skyfield.framelib import itrs

    matrix = np.empty((len(epochs), 3, 3))
    for k in range(len(epochs)):  # one by one: skyfield's sums give an epoch other bits alone than among many
        matrix[k] = itrs.rotation_at(epochs.at(slice(k, k + 1)).skyfield_time())[..., 0]
    return matrix
