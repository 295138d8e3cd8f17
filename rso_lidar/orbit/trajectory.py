"""What a trajectory is, and the derivatives of its position and velocity.

The angular velocity of orbit-fixed axes follows from these derivatives. The velocity of a propagator need not be the
derivative of its position: SGP4's differs by up to 2 m/s, that of `j2` by some mm/s. Two-body motion (`Kepler`, `State`)
has exact derivatives; those of all others are central differences.
"""

from __future__ import annotations

from typing import Any, Protocol, runtime_checkable

import numpy as np

from rso_lidar.errors import PropagationError, suppress_warnings
from rso_lidar.orbit.central_body import EARTH
from rso_lidar.orbit.epochs import Epochs
from rso_lidar.part import call_member, make_answer_error, to_real_array
from rso_lidar.pose import dot
from rso_lidar.records import BodyState

# With 2 s the truncation error in low orbit is below 1e-9 m/s and 3e-6 of the acceleration. The rounding of time in SGP4
# (1e-9 s after a month) adds some 2 um/s.
DIFFERENCE_STEP_S = 2.0


@runtime_checkable
class Trajectory(Protocol):
    """Anything whose inertial state is known at any epoch: a motion, a plan, or a user's own object."""

    def states(self, epochs: Epochs) -> BodyState:
        """Return position [m] and velocity [m/s] (time, 3) in GCRS axes.

        Parameters
        ----------
        epochs : instants

        Raises
        ------
        PropagationError
            if there is no state at an epoch; its `bad` masks those epochs
        """
        ...


def state_rates(trajectory: Any, epochs: Epochs, state: BodyState) -> tuple[np.ndarray, np.ndarray]:
    """Return the derivatives of position (time, 3) [m/s] and velocity (time, 3) [m/s2] in GCRS axes.

    They are central differences over `DIFFERENCE_STEP_S`. At the trajectory's `breaks_s(epochs)` [s since the start] its
    state jumps or has a corner, and it may have no state beyond. No difference reaches across a break, and at a break the
    derivatives are those after it. Where there is no state beside an epoch, the two-body derivatives are used.

    Parameters
    ----------
    trajectory : answers `states`; if it has a method ``state_rates(state)``, that is called instead
    epochs : instants
    state : its states at `epochs`
    """
    known = getattr(trajectory, "state_rates", None)
    if known is not None:
        rates: tuple[np.ndarray, np.ndarray] = known(state)
        return rates
    breaks_s = find_breaks_s(trajectory, epochs)

    def rows(time_s: np.ndarray) -> np.ndarray:
        with suppress_warnings():
            there = trajectory.states(Epochs(epochs.start_utc, time_s))
        return np.concatenate([there.position_m, there.velocity_m_s], axis=1)

    here = np.concatenate([state.position_m, state.velocity_m_s], axis=1)
    middle, first, second, since_s, bad = _differences(rows, epochs.time_s, here, breaks_s)
    acceleration = first[:, 3:] + since_s * second[:, 3:]
    # (p+ - p-) / 2 h = p' + h^2 p''' / 6 + ..., and p''' is the second difference of velocities
    off = first[:, :3] - middle[:, 3:] - _step_s(epochs.time_s, breaks_s)[1] ** 2 / 6.0 * second[:, 3:]
    velocity = state.velocity_m_s + off
    if bad.any():
        velocity[bad], acceleration[bad] = two_body_rates(BodyState(state.position_m[bad], state.velocity_m_s[bad]))
    return velocity, acceleration


def two_body_rates(state: BodyState, gm_m3_s2: float = EARTH.gm_m3_s2) -> tuple[np.ndarray, np.ndarray]:
    """Return the derivatives of a two-body state: its velocity [m/s] and point-mass gravity [m/s2] (…, 3).

    Parameters
    ----------
    state : position and velocity (…, 3) from the centre of the body with that gravity
    gm_m3_s2 : its gravitational parameter [m3/s2], by default the Earth's
    """
    r = state.position_m
    distance = np.sqrt(dot(r, r))[..., None]
    return np.array(state.velocity_m_s), -gm_m3_s2 * r / distance**3


def find_breaks_s(trajectory: Any, epochs: Epochs) -> np.ndarray:
    """Return the instants [s] at which the states of a trajectory have a jump or a corner; by default none.

    Parameters
    ----------
    trajectory : any object with the method `states`
    epochs : instants that matter
    """
    answer = call_member(trajectory, "breaks_s", epochs, default=())
    breaks = to_real_array(answer)
    if breaks is None or breaks.ndim != 1 or np.isnan(breaks).any():
        raise make_answer_error(trajectory, "breaks_s", answer, "return a list of numbers")
    return breaks


def differentiate(rows: Any, time_s: np.ndarray, here: np.ndarray, breaks_s: np.ndarray | None = None) -> np.ndarray:
    """Differentiate rows by central differences between breaks, as `state_rates` does.

    Parameters
    ----------
    rows : ``rows(time_s (time,)) -> (time, n)``
    time_s : (time,) instants [s]
    here : (time, n) what `rows` returns there
    breaks_s : instants at which the rows jump or have a corner [s]

    Returns
    -------
    (time, n) derivatives [1/s]; NaN where there is no row beside an instant
    """
    _, first, second, since_s, bad = _differences(rows, time_s, here, np.empty(0) if breaks_s is None else breaks_s)
    change: np.ndarray = first + since_s * second
    change[bad] = np.nan
    return change


def _step_s(time_s: np.ndarray, breaks_s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the centre (time,) and half the width (time, 1) [s] of each difference, within the piece between two breaks."""
    edges = np.concatenate([[-np.inf], np.unique(breaks_s), [np.inf]])
    piece = np.searchsorted(edges, time_s, side="right")
    low, high = edges[piece - 1], edges[piece]
    step = np.minimum(DIFFERENCE_STEP_S, 0.499 * (high - low))
    # a break is known to a nanosecond: stay off both ends
    return np.minimum(np.maximum(time_s, low + 1.001 * step), high - 1.001 * step), step[:, None]


def _differences(
    rows: Any, time_s: np.ndarray, here: np.ndarray, breaks_s: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Compute first and second difference quotients of rows between breaks.

    Parameters
    ----------
    rows : ``rows(time_s (time,)) -> (time, n)``
    time_s : (time,) instants [s]
    here : (time, n) the rows at these instants
    breaks_s : instants of breaks [s]

    Returns
    -------
    rows at the centres, first and second difference quotients, time since the centres [s], and the mask of missing rows
    """
    center_s, step_s = _step_s(time_s, breaks_s)
    moved = center_s != time_s
    count = len(time_s)
    wanted = [center_s - step_s[:, 0], center_s + step_s[:, 0], center_s[moved]]
    around = np.zeros((2 * count + int(moved.sum()), here.shape[1]))
    requested = np.concatenate(wanted)
    good = np.ones(len(requested), dtype=bool)
    try:
        around[:] = rows(requested)
    except PropagationError as error:
        if len(error.bad) != len(requested) or not error.bad.any():
            raise
        good = ~error.bad
        around[good] = rows(requested[good])
    bad = ~(good[:count] & good[count : 2 * count])
    bad[moved] |= ~good[2 * count :]
    middle = np.array(here)
    middle[moved] = around[2 * count :]
    before, after = around[:count], around[count : 2 * count]
    first = (after - before) / (2.0 * step_s)
    second = (after - 2.0 * middle + before) / step_s**2
    return middle, first, second, (time_s - center_s)[:, None], bad
