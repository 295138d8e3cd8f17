"""Prediction of two bodies on neighbouring orbits: the follower's state, the target relative to it, and their covariance."""

from __future__ import annotations

import numpy as np

from rso_lidar import units

STATES = 12  # position and velocity of the follower, then of the target relative to it
_LONGEST_STEP_S = 10.0  # a Runge-Kutta step of a low orbit then errs by some 10 um
_GM, _J2 = units.EARTH_GM_M3_S2, units.EARTH_J2 * units.EARTH_ZONAL_RADIUS_M**2


def accelerate(position_m: np.ndarray, *, oblate: bool) -> np.ndarray:
    """Return the gravitational acceleration (3) [m/s²] of the Earth: point mass, and J2 about the z axis of GCRS.

    Parameters
    ----------
    position_m : (3) in inertial axes [m]
    oblate : whether J2 is included (Vallado 4th ed., eq. 8-29)
    """
    square = float(position_m @ position_m)
    pull = -_GM / (square * np.sqrt(square)) * position_m
    if not oblate:
        return np.asarray(pull)
    share = 1.5 * _J2 / square
    height = 5.0 * position_m[2] ** 2 / square
    return np.asarray(pull * (1.0 + share * (np.array([1.0, 1.0, 3.0]) - height)))


def find_gradient(position_m: np.ndarray) -> np.ndarray:
    """Return the gradient (3, 3) [1/s²] of a point mass's gravity at a position (3); J2 changes it by a thousandth."""
    square = float(position_m @ position_m)
    return np.asarray(_GM / (square * np.sqrt(square)) * (3.0 / square * np.outer(position_m, position_m) - np.eye(3)))


def _rates(state: np.ndarray, oblate: bool) -> np.ndarray:
    """Return the rates (12) of a state; the gravity on the target differs by the gradient over the distance."""
    own = accelerate(state[:3], oblate=oblate)
    other = accelerate(state[:3] + state[6:9], oblate=oblate)
    return np.concatenate([state[3:6], own, state[9:], other - own])


def predict_orbits(
    state: np.ndarray,
    step_s: float,
    *,
    own_m_s2_sqrt_hz: float,
    target_m_s2_sqrt_hz: float,
    oblate: bool = True,
    has_gravity: bool = True,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Predict the states of two bodies.

    Parameters
    ----------
    state : (12) position [m] and velocity [m/s] of the follower, then of the target relative to it, in inertial axes
    own_m_s2_sqrt_hz, target_m_s2_sqrt_hz : roots of the spectral densities of the white accelerations of the follower and of
        the target that are not modelled, each axis [m/s²/√Hz]
    oblate : whether the Earth's J2 acts

    Returns
    -------
    the state after the step, the transition matrix (12, 12), and the covariance (12, 12) that the accelerations add
    """
    transition, noise = np.eye(STATES), np.zeros((STATES, STATES))
    count = max(1, int(np.ceil(step_s / _LONGEST_STEP_S)))
    step = step_s / count
    added = np.zeros((STATES, STATES))
    own, target = own_m_s2_sqrt_hz**2, target_m_s2_sqrt_hz**2
    kinds = ((0, 0, own), (0, 6, -own), (6, 0, -own), (6, 6, own + target))  # the follower's accelerates both
    for row, col, density in kinds:
        for i, j, factor in ((0, 0, step**3 / 3.0), (0, 3, step**2 / 2.0), (3, 0, step**2 / 2.0), (3, 3, step)):
            added[row + i : row + i + 3, col + j : col + j + 3] = density * factor * np.eye(3)
    for _ in range(count):
        system = np.zeros((STATES, STATES))
        system[:3, 3:6] = system[6:9, 9:] = np.eye(3)
        before = state
        if has_gravity:
            k1 = _rates(state, oblate)
            k2 = _rates(state + 0.5 * step * k1, oblate)
            k3 = _rates(state + 0.5 * step * k2, oblate)
            k4 = _rates(state + step * k3, oblate)
            state = state + step / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
            middle = 0.5 * (before + state)
            near, far = find_gradient(middle[:3]), find_gradient(middle[:3] + middle[6:9])
            system[3:6, :3], system[9:, 6:9], system[9:, :3] = near, far, far - near
        else:
            state = state + step * (system @ state)
        scaled = step * system
        onward = np.eye(STATES) + scaled @ (np.eye(STATES) + scaled @ (np.eye(STATES) + scaled / 3.0) / 2.0)
        transition, noise = onward @ transition, onward @ noise @ onward.T + added
    return state, transition, noise
