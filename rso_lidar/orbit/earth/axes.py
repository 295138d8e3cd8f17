"""Rotations between named axes, and states in them.

| name | axes |
| --- | --- |
| `gcrs` | the root of every scenario; `gcrf` and `icrf` have the same directions |
| `eme2000` | mean equator and equinox of J2000.0, 23 mas from GCRS; also called J2000 |
| `mod`, `tod` | mean, or true equator and equinox of date (IAU 2006/2000A) |
| `teme` | true equator, mean equinox of date: the axes of SGP4 |
| `itrs` | fixed in the Earth; ITRF and WGS84 agree with it within centimetres |
| `rtn`, `lvlh_ccsds`, `vnc`, `ntw`, `tnw` | of an orbit, whose states they need |
"""

from __future__ import annotations

from typing import Literal, get_args

import numpy as np

from rso_lidar import units
from rso_lidar.errors import ScenarioError
from rso_lidar.orbit.earth.earth_orientation import EarthOrientation
from rso_lidar.orbit.earth.earth_rotation import itrs_from_gcrs, itrs_from_gcrs_rate
from rso_lidar.orbit.epochs import Epochs
from rso_lidar.orbit.sky.axes_of_date import gcrs_from_axes_of_date
from rso_lidar.orbit.two_body.orbit_axes import (
    ORBIT_AXES,
    OrbitAxes,
    check_axes,
    orbit_axes_matrix,
    orbit_state_matrix,
    state_matrix,
)
from rso_lidar.pose import rotate_vectors
from rso_lidar.records import BodyState

EarthAxes = Literal["gcrs", "eme2000", "mod", "tod", "teme", "itrs"]
EARTH_AXES: tuple[EarthAxes, ...] = get_args(EarthAxes)


def gcrs_from_eme2000() -> np.ndarray:
    """Return the rotation matrix (3, 3) from EME2000 (mean equator and equinox of J2000.0) to GCRS: the frame bias, 23 mas.

    USNO Circular 179 (Kaplan 2005), sec. 3.5, with the IAU 2000A offsets d_alpha0 = -14.6, xi0 = -16.6170, eta0 =
    -6.8192 mas: EME2000 = R1(-eta0) R2(xi0) R3(d_alpha0) GCRS.
    """
    alpha, xi, eta = -0.014_600 * units.ARCSEC, -0.016_617_0 * units.ARCSEC, -0.006_819_2 * units.ARCSEC
    about_x = np.array([[1, 0, 0], [0, np.cos(-eta), np.sin(-eta)], [0, -np.sin(-eta), np.cos(-eta)]])
    about_y = np.array([[np.cos(xi), 0, -np.sin(xi)], [0, 1, 0], [np.sin(xi), 0, np.cos(xi)]])
    about_z = np.array([[np.cos(alpha), np.sin(alpha), 0], [-np.sin(alpha), np.cos(alpha), 0], [0, 0, 1]])
    matrix: np.ndarray = (about_x @ about_y @ about_z).T
    return matrix


def gcrs_from_axes(
    axes: EarthAxes | OrbitAxes,
    epochs: Epochs,
    states: BodyState | None = None,
    *,
    orientation: EarthOrientation | None = None,
) -> np.ndarray:
    """Return the rotation matrices from named axes to GCRS axes.

    Parameters
    ----------
    axes : "gcrs", "eme2000", "mod", "tod", "teme", "itrs"; or "rtn", "lvlh_ccsds", "vnc", "ntw", "tnw" of an orbit
    epochs : instants
    states : GCRS states (time, 3) of the orbit; axes of the Earth need none

    Other Parameters
    ----------------
    orientation : polar motion and UT1 for "itrs", see `itrs_from_gcrs`

    Returns
    -------
    (time, 3, 3)
        to rotate back, transpose them; from axes a to axes b, multiply the transpose of b's by a's

    Raises
    ------
    ScenarioError
        if the name is unknown, or orbital axes are given no states

    Examples
    --------
    >>> import datetime
    >>> start = datetime.datetime(2024, 9, 17, 12, tzinfo=datetime.UTC)
    >>> matrix = gcrs_from_axes("itrs", Epochs(start, np.zeros(1)))[0]
    >>> (matrix @ [0.0, 0.0, 1.0]).round(4)  # the pole, a quarter of a century after J2000
    array([0.0024, 0.    , 1.    ])
    """
    check_axes(axes, (*EARTH_AXES, *ORBIT_AXES))
    if axes == "itrs":
        return np.swapaxes(itrs_from_gcrs(epochs, orientation), -1, -2)
    if axes == "mod" or axes == "tod" or axes == "teme":
        return gcrs_from_axes_of_date(axes, epochs)
    if axes == "gcrs" or axes == "eme2000":
        matrix = np.eye(3) if axes == "gcrs" else gcrs_from_eme2000()
        return np.broadcast_to(matrix, (len(epochs), 3, 3))
    if states is None:
        raise ScenarioError(f"axes: '{axes}' are those of an orbit; give its states")
    return orbit_axes_matrix(axes, states.position_m, states.velocity_m_s)


def convert_states(
    states: BodyState,
    epochs: Epochs,
    *,
    from_axes: EarthAxes = "gcrs",
    to_axes: EarthAxes = "gcrs",
    orientation: EarthOrientation | None = None,
) -> BodyState:
    """Convert states about the Earth from named axes to others.

    A velocity in `itrs` is relative to the rotating Earth. Into and out of all other axes a velocity is only rotated:
    those of date turn by 1e-11 rad/s at most, which is 0.1 mm/s in low orbit.

    Parameters
    ----------
    states : positions [m] and velocities [m/s] (time, 3)
    epochs : their instants

    Other Parameters
    ----------------
    from_axes, to_axes : "gcrs", "eme2000", "mod", "tod", "teme" or "itrs"
    orientation : polar motion and UT1 for "itrs", see `itrs_from_gcrs`

    Returns
    -------
    BodyState

    Raises
    ------
    ScenarioError
        if a name is unknown

    Examples
    --------
    >>> import datetime
    >>> epochs = Epochs(datetime.datetime(2024, 9, 17, 12, tzinfo=datetime.UTC), np.zeros(1))
    >>> still = BodyState(np.array([[42_164e3, 0.0, 0.0]]), np.zeros((1, 3)))  # over the Gulf of Guinea, in ITRS
    >>> moving = convert_states(still, epochs, from_axes="itrs")
    >>> float(np.linalg.norm(moving.velocity_m_s).round(1))
    3074.6
    """
    for axes in (from_axes, to_axes):
        check_axes(axes, EARTH_AXES)
    if from_axes == to_axes:
        return states
    position_m, velocity_m_s = np.asarray(states.position_m, dtype=float), np.asarray(states.velocity_m_s, dtype=float)
    if from_axes == "itrs":
        matrix = itrs_from_gcrs(epochs, orientation)
        back, change = np.swapaxes(matrix, -1, -2), itrs_from_gcrs_rate(epochs, orientation)
        position_m = rotate_vectors(back, position_m)
        velocity_m_s = rotate_vectors(back, velocity_m_s - rotate_vectors(change, position_m))
    elif from_axes != "gcrs":
        matrix = gcrs_from_axes(from_axes, epochs)
        position_m, velocity_m_s = rotate_vectors(matrix, position_m), rotate_vectors(matrix, velocity_m_s)
    if to_axes == "itrs":
        matrix, change = itrs_from_gcrs(epochs, orientation), itrs_from_gcrs_rate(epochs, orientation)
        velocity_m_s = rotate_vectors(matrix, velocity_m_s) + rotate_vectors(change, position_m)
        position_m = rotate_vectors(matrix, position_m)
    elif to_axes != "gcrs":
        matrix = np.swapaxes(gcrs_from_axes(to_axes, epochs), -1, -2)
        position_m, velocity_m_s = rotate_vectors(matrix, position_m), rotate_vectors(matrix, velocity_m_s)
    return BodyState(position_m, velocity_m_s)


def gcrs_state_matrix(
    axes: EarthAxes | OrbitAxes,
    epochs: Epochs,
    states: BodyState | None = None,
    *,
    rotating: bool = False,
    orientation: EarthOrientation | None = None,
) -> np.ndarray:
    """Return the matrices that take positions and velocities in named axes to those in GCRS axes.

    They are the derivatives of one state by the other, so a covariance P becomes M P M^T. As in `convert_states`, velocities
    in "itrs" are relative to the rotating Earth, and all other axes of the Earth count as not turning.

    Parameters
    ----------
    axes : "gcrs", "eme2000", "mod", "tod", "teme", "itrs"; or "rtn", "lvlh_ccsds", "vnc", "ntw", "tnw" of an orbit
    epochs : instants
    states : GCRS states (time, 3) of the orbit; axes of the Earth need none

    Other Parameters
    ----------------
    rotating : whether velocities along orbital axes are relative to these axes as they turn by two-body motion, rather than
        to inertial axes
    orientation : polar motion and UT1 for "itrs", see `itrs_from_gcrs`

    Returns
    -------
    (time, 6, 6)
        `invert_state_matrix` gives the way back

    Raises
    ------
    ScenarioError
        if the name is unknown, or orbital axes are given no states
    """
    check_axes(axes, (*EARTH_AXES, *ORBIT_AXES))
    if axes in ORBIT_AXES:
        if states is None:
            raise ScenarioError(f"axes: '{axes}' are those of an orbit; give its states")
        return orbit_state_matrix(axes, states.position_m, states.velocity_m_s, rotating=rotating)
    matrix = state_matrix(gcrs_from_axes(axes, epochs, orientation=orientation))
    if axes == "itrs":  # v = R^T (v' - dR/dt r) with r = R^T r'
        back = matrix[:, :3, :3]
        matrix[:, 3:, :3] = -back @ itrs_from_gcrs_rate(epochs, orientation) @ back
    return matrix
