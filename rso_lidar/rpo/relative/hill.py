"""Relative motion near a circular orbit by Clohessy and Wiltshire's closed form, in rotating rtn axes.

rtn: x radially outward, z along r x v, y = z x x (along-track). V-bar is +y, R-bar is -x. Equations: Clohessy & Wiltshire
(1960), as in Vallado 4th ed. alg. 48; with a constant acceleration as in Fehse, Automated Rendezvous and Docking of
Spacecraft, app. A.
"""

from __future__ import annotations

import datetime
import math
from typing import ClassVar, Literal

import numpy as np
from pydantic import Field

from rso_lidar import units
from rso_lidar.errors import ScenarioError
from rso_lidar.orbit import EARTH, CentralBody, Epochs, Trajectory, find_center, find_center_states, subtract_center
from rso_lidar.part import Flag, Vector
from rso_lidar.pose import dot
from rso_lidar.records import BodyState
from rso_lidar.rpo.relative import curvilinear
from rso_lidar.rpo.relative.relative_motion import RelativeState

FAR_M = 10_000.0
ECCENTRIC = 0.005
TURNED = 0.05  # share of the separation
_FLATTENED = 8.0  # greatest rate over J2 (R / p)^2 n, by numerical integration of many formations with and without J2
STRAIGHT, CURVED = 6.0, 15.0  # neglected second order per revolution over pi rho^2 / r: in x, y, z; in height and arcs
GM = units.EARTH_GM_M3_S2
_BLOCK = 8192  # epochs computed at a time: fits a processor's cache


class Hill(RelativeState):
    """Clohessy-Wiltshire motion about a chief on a near-circular orbit, with a constant acceleration in rtn axes.

    The mean motion is that of the chief's osculating orbit at `start_utc`, for any model of the chief. Let rho be
    the greatest separation and r the orbit's radius. The error against two-body motion per revolution is up to
    6 pi rho^2 / r, which is 2.7 m at 1 km in low orbit. An eccentricity e up to 0.5 adds up to 30 e rho.

    With `curvilinear` the equations hold for height, arc along the track and arc across it instead of x, y, z. Then the
    error is up to 15 pi h^2 / r per revolution, with h the greatest height or arc across. The arc along the track does
    not matter. The acceleration is then along the axes at the body.
    """

    any_center: ClassVar[bool] = True
    type: Literal["hill"] = "hill"
    acceleration_m_s2: Vector = Field(
        default=(0.0, 0.0, 0.0),
        description=(
            "Constant acceleration in the rtn axes of the body [m/s²]; with `curvilinear`, in the rtn axes of the "
            "craft itself."
        ),
    )
    curvilinear: Flag = Field(
        default=False,
        description=(
            "Whether coordinates are height, arc along-track and arc cross-track instead of straight lines. It suits "
            "bodies far apart along the orbit."
        ),
    )

    def relative(self, epochs: Epochs, chief: Trajectory) -> tuple[np.ndarray, np.ndarray]:
        """Return position [m] and velocity [m/s] (time, 3) in the chief's rotating rtn axes."""
        flown = self._propagate_equations(epochs, chief)
        return curvilinear.to_rectilinear(*flown, *_find_radius(chief, epochs)) if self.curvilinear else flown

    def _propagate_equations(self, epochs: Epochs, chief: Trajectory) -> tuple[np.ndarray, np.ndarray]:
        """Return positions and velocities in the coordinates of the equations: along x, y, z, or height and arcs."""
        n = find_mean_motion_rad_s(chief, epochs.start_utc)
        start = np.array(self.position_m), np.array(self.velocity_m_s)
        if self.curvilinear:
            radius_m, radial_m_s = _find_radius(chief, Epochs(epochs.start_utc, np.zeros(1)))
            start = curvilinear.to_curvilinear(*start, radius_m[0], radial_m_s[0])
        return clohessy_wiltshire(*start, epochs.time_s, n, self.acceleration_m_s2)

    def validity(self, epochs: Epochs, chief: Trajectory) -> list[str]:
        """Return one sentence for each limit of the model that these epochs exceed, with a better choice."""
        position, _ = self._propagate_equations(epochs, chief)
        start, center = find_start_state(chief, epochs.start_utc), find_center(chief)
        if self.curvilinear:
            better = "use relative_elements or nonlinear"
            sentences = describe_validity(position[:, ::2], *start, better=better, factor=CURVED, center=center)
        else:
            sentences = describe_validity(position, *start, center=center)
        return sentences + describe_flattening("hill", epochs, *start, center=center)


def describe_validity(
    position_m: np.ndarray,
    chief_m: np.ndarray,
    chief_m_s: np.ndarray,
    *,
    better: str = "set curvilinear = true, or use relative_elements or nonlinear",
    factor: float = STRAIGHT,
    center: CentralBody = EARTH,
) -> list[str]:
    """Return one sentence for each limit of Clohessy-Wiltshire's equations that a motion exceeds.

    Parameters
    ----------
    position_m : (time, 3) rtn positions [m]
    chief_m, chief_m_s : (3,) state of the chief about the centre of that body [m], [m/s]
    factor : the neglected second order is `factor` pi rho^2 / r per revolution
    """
    farthest_m = float(np.linalg.norm(np.atleast_2d(position_m), axis=-1).max(initial=0.0))
    e = find_eccentricity(chief_m, chief_m_s, center.gm_m3_s2)
    sentences = []
    elements = ", relative_elements" if center is EARTH else ""  # they have the Earth's J2
    if center is not EARTH:
        better = "use nonlinear"
    if farthest_m > FAR_M:
        off_m = factor * math.pi * farthest_m**2 / float(np.linalg.norm(chief_m))
        what = "the separation" if factor == STRAIGHT else "the height, or the arc across,"
        sentences.append(
            f"hill: {what} reaches {farthest_m / units.KM:.1f} km; beyond {FAR_M / units.KM:g} km the neglected second "
            f"order, here up to {off_m:.3g} m for each revolution, matters: {better}"
        )
    if e > ECCENTRIC:
        sentences.append(
            f"hill: the chief's eccentricity is {e:.4f}; above {ECCENTRIC:g} Clohessy-Wiltshire, which takes it as "
            f"circular, is off by up to {30.0 * e:.0%} of the separation for each revolution; "
            f"use yamanaka_ankersen{elements} or nonlinear"
        )
    return sentences


def clohessy_wiltshire(
    position_m: np.ndarray | Vector,
    velocity_m_s: np.ndarray | Vector,
    time_s: np.ndarray | float,
    mean_motion_rad_s: np.ndarray | float,
    acceleration_m_s2: np.ndarray | Vector = (0.0, 0.0, 0.0),
) -> tuple[np.ndarray, np.ndarray]:
    """Propagate relative states by Clohessy and Wiltshire's equations; all inputs are broadcast against each other.

    Parameters
    ----------
    position_m, velocity_m_s : (…, 3) initial states in rtn axes [m], [m/s]
    time_s : (…) time since the initial state [s]
    mean_motion_rad_s : (…) mean motion of the chief [rad/s]
    acceleration_m_s2 : (…, 3) constant acceleration in rtn axes [m/s2]

    Returns
    -------
    position_m, velocity_m_s : (…, 3) in rtn axes [m], [m/s]

    Examples
    --------
    >>> rest = clohessy_wiltshire((0.0, -3000.0, 0.0), (0.0, 0.0, 0.0), np.array([3600.0]), 7.292e-5)
    >>> rest[0].tolist()
    [[0.0, -3000.0, 0.0]]
    """
    start = [np.asarray(vector, dtype=float) for vector in (position_m, velocity_m_s, acceleration_m_s2)]
    time, n = np.asarray(time_s, dtype=float), np.asarray(mean_motion_rad_s, dtype=float)
    shape = np.broadcast_shapes(*(vector.shape[:-1] for vector in start), time.shape, n.shape)
    position, velocity = np.empty((*shape, 3)), np.empty((*shape, 3))
    if len(shape) == 1 and time.ndim == 1 and max(vector.ndim for vector in start) == 1 and n.ndim == 0:
        for k in range(0, len(time), _BLOCK):
            _propagate(start, time[k : k + _BLOCK], n, position[k : k + _BLOCK], velocity[k : k + _BLOCK])
    else:
        _propagate(start, time, n, position, velocity)
    return position, velocity


def _propagate(
    start: list[np.ndarray], time_s: np.ndarray, n: np.ndarray, position: np.ndarray, velocity: np.ndarray
) -> None:
    """Write the closed form into two arrays.

    Parameters
    ----------
    start : position [m], velocity [m/s] and acceleration [m/s2], each (…, 3)
    time_s : (…) time since the start [s]
    n : (…) mean motion [rad/s]
    position, velocity : (…, 3) arrays to write into [m], [m/s]
    """
    (x0, y0, z0), (u0, v0, w0) = (np.moveaxis(vector, -1, 0) for vector in start[:2])
    x, y, z = (position[..., k] for k in range(3))
    u, v, w = (velocity[..., k] for k in range(3))
    nt = n * time_s
    s = np.sin(nt)
    k = np.sin(0.5 * nt)
    k = 2.0 * k * k  # 1 - cos, without cancellation
    c = 1.0 - k
    x[...] = x0 + k * (3.0 * x0 + 2.0 * v0 / n) + s * (u0 / n)
    y[...] = y0 + s * (6.0 * x0 + 4.0 * v0 / n) - nt * (6.0 * x0 + 3.0 * v0 / n) - k * (2.0 * u0 / n)
    z[...] = c * z0 + s * (w0 / n)
    u[...] = s * (3.0 * n * x0 + 2.0 * v0) + c * u0
    v[...] = v0 - k * (6.0 * n * x0 + 4.0 * v0) - s * (2.0 * u0)
    w[...] = c * w0 - s * (n * z0)
    if not start[2].any():
        return
    a, b, q = np.moveaxis(start[2], -1, 0) / n
    x += (k * a + 2.0 * (nt - s) * b) / n
    y += ((4.0 * k - 1.5 * nt * nt) * b - 2.0 * (nt - s) * a) / n
    z += k * (q / n)
    u += s * a + 2.0 * k * b
    v += (4.0 * s - 3.0 * nt) * b - 2.0 * k * a
    w += s * q


def find_start_state(chief: Trajectory, start_utc: datetime.datetime) -> tuple[np.ndarray, np.ndarray]:
    """Return position (3,) [m] and velocity (3,) [m/s] of a chief about its central body at `start_utc`, in GCRS axes."""
    state = _states_about_center(chief, Epochs(start_utc, np.zeros(1)))
    return np.asarray(state.position_m)[0], np.asarray(state.velocity_m_s)[0]


def find_mean_motion_rad_s(chief: Trajectory, start_utc: datetime.datetime) -> float:
    """Return the mean motion of a chief's osculating orbit, by the vis-viva equation and Kepler's third law.

    Raises
    ------
    ScenarioError
        if the orbit is open
    """
    return mean_motion_of_state(*find_start_state(chief, start_utc), find_center(chief).gm_m3_s2)


def mean_motion_of_state(position_m: np.ndarray, velocity_m_s: np.ndarray, gm_m3_s2: float = GM) -> float:
    """Return the mean motion [rad/s] of the osculating orbit of a state; `ScenarioError` if it is open.

    Parameters
    ----------
    position_m, velocity_m_s : (3,) about the central body [m], [m/s]
    gm_m3_s2 : its gravitational parameter [m3/s2], by default the Earth's
    """
    alpha = float(2.0 / np.linalg.norm(position_m) - np.sum(velocity_m_s * velocity_m_s) / gm_m3_s2)
    if alpha <= 0.0:
        raise ScenarioError(
            "relative_to: its orbit is open and has no mean motion; use motion 'nonlinear' about it, or 'state'"
        )
    return math.sqrt(gm_m3_s2 * alpha**3)


def find_eccentricity(position_m: np.ndarray, velocity_m_s: np.ndarray, gm_m3_s2: float = GM) -> float:
    """Return the osculating eccentricity of a state (3,) about the central body."""
    momentum = np.cross(position_m, velocity_m_s)
    return float(np.linalg.norm(np.cross(velocity_m_s, momentum) / gm_m3_s2 - position_m / np.linalg.norm(position_m)))


def describe_flattening(
    name: str,
    epochs: Epochs,
    chief_m: np.ndarray,
    chief_m_s: np.ndarray,
    better: str = "use relative_elements, or nonlinear with forces",
    *,
    center: CentralBody = EARTH,
) -> list[str]:
    """Return a sentence if J2, which a two-body model leaves out, moves the relative orbit by more than `TURNED`.

    It does so by 8 J2 (R / p)^2 n at most. The perigee, and the vector of relative eccentricity, turn by up to 3 of
    that. Two bodies of equal osculating semi-major axes drift apart because J2 makes their mean axes different: 4.5 %
    of the separation per revolution at 500 km, by numerical integration.

    Parameters
    ----------
    chief_m, chief_m_s : (3,) state of the chief about its central body [m], [m/s]
    better : what to use instead, for the sentence; about the Moon there is nothing better
    """
    gm = center.gm_m3_s2
    alpha = 2.0 / np.linalg.norm(chief_m) - np.sum(chief_m_s**2) / gm
    if alpha <= 0.0 or not len(epochs):
        return []
    p = float(np.sum(np.cross(chief_m, chief_m_s) ** 2)) / gm
    swept_rad = math.sqrt(gm * alpha**3) * float(np.abs(epochs.time_s).max())
    share = _FLATTENED * center.j2 * (center.radius_m / p) ** 2 * swept_rad
    if share <= TURNED:
        return []
    if center is not EARTH:
        better = "its other harmonics, which are as large, are left out too; take the result as an estimate"
    return [
        f"{name}: in {swept_rad / math.tau:.1f} revolutions {center.name}'s flattening (J2), which this model leaves out, "
        f"moves the body by up to {share:.0%} of the separation: {better}"
    ]


def _find_radius(chief: Trajectory, epochs: Epochs) -> tuple[np.ndarray, np.ndarray]:
    """Return the distance of a chief from the centre of its central body [m] and its rate [m/s] (time,)."""
    state = _states_about_center(chief, epochs)
    radius = np.sqrt(dot(state.position_m, state.position_m))
    return radius, dot(state.position_m, state.velocity_m_s) / radius


def _states_about_center(trajectory: Trajectory, epochs: Epochs) -> BodyState:
    """Return the states (time, 3) of a trajectory relative to the centre of its central body, in GCRS axes."""
    return subtract_center(trajectory.states(epochs), find_center_states(trajectory, epochs))
