"""Transition matrices of two-body motion, by differences."""

from __future__ import annotations

import numpy as np

from rso_lidar.orbit.two_body.many_states import propagate_many

_STEP_M, _STEP_M_S = 10.0, 0.01  # of the central differences: the matrix is good to 1e-8
_STEPS = np.diag([_STEP_M] * 3 + [_STEP_M_S] * 3)


def find_transition(
    position_m: np.ndarray, velocity_m_s: np.ndarray, time_s: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Propagate elliptic states by two-body motion, each to its own instant, with their transition matrices.

    Parameters
    ----------
    position_m, velocity_m_s : (state, 3) states at the epoch [m], [m/s]
    time_s : (state,) time since the epoch [s]

    Returns
    -------
    states : (state, 6) [m], [m/s]
    transitions : (state, 6, 6) derivative of the state there by the state at the epoch

    Raises
    ------
    PropagationError
        if a state is not on an ellipse; its `bad` masks those states
    """
    start = np.concatenate([position_m, velocity_m_s], axis=1)
    starts = start[:, None] + np.concatenate([np.zeros((1, 6)), _STEPS, -_STEPS])
    rows = starts.reshape(-1, 6)
    there = np.hstack(propagate_many(rows[:, :3], rows[:, 3:], np.repeat(time_s, 13))).reshape(-1, 13, 6)
    slopes = (there[:, 1:7] - there[:, 7:]) / (2.0 * np.diag(_STEPS)[:, None])
    return there[:, 0], np.swapaxes(slopes, 1, 2)
