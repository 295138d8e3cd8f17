"""Covariances of an object's state over time, and between their epochs.

Between two epochs the covariances of both are propagated to the instant by two-body motion and blended (Tanygin, "Efficient
covariance interpolation using blending of approximate covariance propagations", J. Astronautical Sciences 61 (2014) 107).
Both are positive semidefinite, and so is a sum of the two with weights that are not negative; a polynomial through the terms
need not be.
Errors are carried in the rotating rtn axes of the reference orbit, so that what perturbs the orbit does not turn them away
from it.
"""

from __future__ import annotations

import datetime
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from rso_lidar import units
from rso_lidar.errors import PropagationError, ScenarioError
from rso_lidar.orbit.epochs import Epochs, format_utc
from rso_lidar.orbit.trajectory import Trajectory
from rso_lidar.orbit.two_body.orbit_axes import OrbitAxes, has_plane, invert_state_matrix, orbit_state_matrix
from rso_lidar.orbit.two_body.transition import find_transition
from rso_lidar.part import to_real_array
from rso_lidar.records import BodyState

_ASYMMETRY = 1e-3  # relative difference of mirrored terms that rounding of digits explains
_NEGATIVE = 1e-3  # relative size of a negative eigenvalue that rounding of digits explains
_EDGE_S = 1e-3  # an instant this close to an epoch is that epoch: 7.5 m along the track in low orbit
# 10 m/s of speed are 3 v T = 170 km along the track after one low revolution, and go with 10 km of position (v = n r). Sets
# that catalogues publish are known to some km and m/s; what is worse is lost, and nothing flies to it.
_LOST_M, _LOST_M_S = 100_000.0, 10.0
# Precise orbits are known to 1 to 2 cm and 10 um/s (GRACE: Kang et al., J. Geodesy 80 (2006) 322), relative ones to 1 mm by
# carrier phases in processing afterwards: no start of a flight is known to less than both of these.
_PRECISE_M, _PRECISE_M_S = 0.1, 1e-4


@dataclass(frozen=True, eq=False)
class CovarianceHistory:
    """Covariances of an object's state at epochs, in inertial axes.

    Parameters
    ----------
    label : name of the object
    source : where the covariances come from, for messages and tables
    reference : the orbit about which they are, anything with `states(epochs)`
    epochs : (time,) increasing instants of the covariances
    matrices : (time, 6, 6) covariances of position and velocity in GCRS axes [m2, m2/s, m2/s2]
    has_velocity : whether the terms of velocity are known; without them the covariances hold at their epochs alone

    Raises
    ------
    ScenarioError
        if there is no covariance, the epochs do not increase, or a matrix is not symmetric and positive semidefinite
    """

    label: str
    source: str
    reference: Trajectory
    epochs: Epochs
    matrices: np.ndarray
    has_velocity: bool = True

    def __post_init__(self) -> None:
        where = self.source or self.label
        matrices = to_real_array(self.matrices)
        count = len(self.epochs)
        if matrices is None or matrices.shape != (count, 6, 6) or not count or not np.isfinite(matrices).all():
            raise ScenarioError(f"{where}: covariances need finite numbers of shape (time, 6, 6), one for each epoch")
        if (np.diff(self.epochs.time_s) <= _EDGE_S).any():
            raise ScenarioError(
                f"{where}: the epochs of the covariances do not increase; sort them, and give each once"
            )
        clean = check_covariances(matrices, where)
        clean.flags.writeable = False
        object.__setattr__(self, "matrices", clean)

    @classmethod
    def from_axes(
        cls,
        label: str,
        reference: Trajectory,
        epochs: Epochs,
        matrices: np.ndarray,
        axes: OrbitAxes = "rtn",
        *,
        rotating: bool = False,
        source: str = "",
    ) -> CovarianceHistory:
        """Make a history of covariances along the axes of their orbit.

        Parameters
        ----------
        label : name of the object
        reference : the orbit about which they are, anything with `states(epochs)`
        epochs : (time,) increasing instants of the covariances
        matrices : (time, 6, 6) covariances in `axes` [m2, m2/s, m2/s2]
        axes : "rtn", "lvlh_ccsds", "vnc", "ntw" or "tnw" of the reference orbit

        Other Parameters
        ----------------
        rotating : whether velocities are relative to the axes as they turn, rather than to inertial axes
        source : where the covariances come from, for messages and tables

        Returns
        -------
        CovarianceHistory

        Raises
        ------
        ScenarioError
            if there is no covariance, the epochs do not increase, or a matrix is not symmetric and positive semidefinite
        """
        given = to_real_array(matrices)
        if given is None or given.shape != (len(epochs), 6, 6):
            raise ScenarioError(f"{source or label}: covariances need shape (time, 6, 6), one for each of the epochs")
        states = reference.states(epochs)
        _check_plane(states, source or label)
        turn = orbit_state_matrix(axes, states.position_m, states.velocity_m_s, rotating=rotating)
        return cls(label, source, reference, epochs, turn @ given @ np.swapaxes(turn, 1, 2))

    @property
    def sigma(self) -> np.ndarray:
        """Standard deviations (time, 6) at the epochs in rtn axes, velocity relative to inertial axes [m, m/s]."""
        diagonal = np.diagonal(self.at(self.epochs, axes="rtn"), axis1=1, axis2=2)
        root: np.ndarray = np.sqrt(np.maximum(diagonal, 0.0))
        return root

    def at(
        self,
        epochs: Epochs | datetime.datetime,
        *,
        axes: OrbitAxes | None = None,
        rotating: bool = False,
        beyond: Literal["error", "two_body"] = "error",
    ) -> np.ndarray:
        """Return the covariances at instants.

        At an epoch of its own the covariance is exact. Between epochs its error is that of two-body motion over half a gap,
        and what happens in the gap (tracking, a burn) is spread over it.

        Parameters
        ----------
        epochs : instants, or one instant with an offset from UTC
        axes : "rtn", "lvlh_ccsds", "vnc", "ntw" or "tnw" of the reference orbit; None for GCRS axes

        Other Parameters
        ----------------
        rotating : whether velocities are relative to orbital axes as they turn, rather than to inertial axes
        beyond : before the first and after the last epoch, "error", or "two_body" for propagation from that epoch without
            process noise, which understates the errors

        Returns
        -------
        (time, 6, 6)
            [m2, m2/s, m2/s2]

        Raises
        ------
        PropagationError
            if instants lie outside the epochs, or between them without terms of velocity; its `bad` masks them
        """
        wanted = Epochs(epochs, np.zeros(1)) if isinstance(epochs, datetime.datetime) else epochs
        now_s, known_s = wanted.since(self.epochs.start_utc), self.epochs.time_s
        last = len(known_s) - 1
        nearest = np.abs(known_s - now_s[:, None]).argmin(axis=1)
        is_known = np.abs(known_s[nearest] - now_s) <= _EDGE_S
        self._check_span(wanted, now_s, is_known, beyond)
        covariance: np.ndarray = self.matrices[nearest].copy()
        rest = np.flatnonzero(~is_known)
        if len(rest):
            after = np.searchsorted(known_s, now_s[rest])
            low, high = np.clip(after - 1, 0, last), np.clip(after, 0, last)
            gap_s = known_s[high] - known_s[low]
            share = np.where(gap_s > 0.0, (now_s[rest] - known_s[low]) / np.where(gap_s > 0.0, gap_s, 1.0), 0.0)
            weight = (share**2 * (3.0 - 2.0 * share))[:, None, None]  # smooth step: level at both epochs
            early, late = self._carry(low, wanted.at(rest)), self._carry(high, wanted.at(rest))
            covariance[rest] = (1.0 - weight) * early + weight * late
        if axes is None:
            return covariance
        states = self._locate(wanted)
        _check_plane(states, self.source or self.label)
        back = invert_state_matrix(orbit_state_matrix(axes, states.position_m, states.velocity_m_s, rotating=rotating))
        turned: np.ndarray = back @ covariance @ np.swapaxes(back, 1, 2)
        return turned

    def _carry(self, which: np.ndarray, epochs: Epochs) -> np.ndarray:
        """Propagate covariances (time) by number to an instant each, in the rotating rtn axes of the reference orbit."""
        begin, there = self.reference.states(self.epochs.at(which)), self._locate(epochs)
        for states in (begin, there):
            _check_plane(states, self.source or self.label)
        span_s = epochs.since(self.epochs.start_utc) - self.epochs.time_s[which]
        moved, transition = find_transition(begin.position_m, begin.velocity_m_s, span_s)
        from_rtn = _rotating_rtn(there) @ invert_state_matrix(_rotating_rtn(BodyState(moved[:, :3], moved[:, 3:])))
        whole = from_rtn @ transition
        carried: np.ndarray = whole @ self.matrices[which] @ np.swapaxes(whole, 1, 2)
        return carried

    def _locate(self, epochs: Epochs) -> BodyState:
        """Return the states of the reference orbit; where it ends before or after the covariances, by two-body motion."""
        try:
            return self.reference.states(epochs)
        except PropagationError as error:
            now_s, known_s = epochs.since(self.epochs.start_utc), self.epochs.time_s
            missing = error.bad
            if not missing.any() or (missing & (now_s >= known_s[0]) & (now_s <= known_s[-1])).any():
                raise
            rows, which = np.flatnonzero(missing), np.where(now_s[missing] < known_s[0], 0, len(known_s) - 1)
            ends = self.reference.states(self.epochs.at(which))
            states = np.empty((len(now_s), 6))
            states[rows], _ = find_transition(ends.position_m, ends.velocity_m_s, now_s[rows] - known_s[which])
            if not missing.all():
                known = self.reference.states(epochs.at(np.flatnonzero(~missing)))
                states[~missing] = np.concatenate([known.position_m, known.velocity_m_s], axis=1)
            return BodyState(states[:, :3], states[:, 3:])

    def _check_span(self, wanted: Epochs, now_s: np.ndarray, is_known: np.ndarray, beyond: str) -> None:
        """Raise `PropagationError` for instants at which there is no covariance."""
        if beyond not in ("error", "two_body"):
            raise ScenarioError(f"beyond: '{beyond}' is no choice; write 'error' or 'two_body'")
        where = f"covariance of {self.label} ({self.source})"
        start, known_s = self.epochs.start_utc, self.epochs.time_s
        if not self.has_velocity and not is_known.all():
            raise PropagationError(
                f"{where}: has no terms of velocity, so it holds at its own epoch {format_utc(start, known_s[0])} alone; "
                "give a covariance of 6 x 6",
                ~is_known,
            )
        bad = ~is_known & ((now_s < known_s[0]) | (now_s > known_s[-1]))
        if bad.any() and beyond == "error":
            first = format_utc(wanted.start_utc, float(wanted.time_s[np.argmax(bad)]))
            raise PropagationError(
                f"{where}: does not cover {int(bad.sum())} of {len(bad)} instants, first {first}: "
                f"it spans {format_utc(start, known_s[0])} to {format_utc(start, known_s[-1])}; shift the instants, or let "
                'it be propagated (beyond = "two_body")',
                bad,
            )


def _check_plane(states: BodyState, where: str) -> None:
    """Raise `ScenarioError` where a velocity has no part across the position, so that there are no axes along the orbit."""
    if not has_plane(states.position_m, states.velocity_m_s).all():
        raise ScenarioError(
            f"{where}: a velocity of the orbit has no part across its position, so that covariances have no axes along it; "
            "correct the states"
        )


def _rotating_rtn(states: BodyState) -> np.ndarray:
    return orbit_state_matrix("rtn", states.position_m, states.velocity_m_s, rotating=True)


def check_covariances(matrices: np.ndarray, where: str, cure: str = "") -> np.ndarray:
    """Check that matrices are covariances to the rounding of their digits, and return them symmetric.

    Mirrored terms may differ, and eigenvalues in units of the sigmas be negative, by 1e-3: terms come with few digits.

    Parameters
    ----------
    matrices : (…, n, n) covariances of any unit
    where : name of the source, for messages
    cure : a further cure for the message; none if empty

    Returns
    -------
    (…, n, n)
        the means of the matrices and their transposes

    Raises
    ------
    ScenarioError
        if a matrix is not symmetric, or not positive semidefinite
    """
    mirrored = np.swapaxes(matrices, -1, -2)
    variances = np.diagonal(matrices, axis1=-2, axis2=-1)
    scale = np.sqrt(np.abs(variances))
    unit = scale[..., :, None] * scale[..., None, :]
    if (np.abs(matrices - mirrored) > _ASYMMETRY * unit).any():
        raise ScenarioError(f"{where}: is not symmetric; give the same number on both sides of the diagonal")
    if (variances < 0.0).any():
        raise ScenarioError(f"{where}: is not positive semidefinite: a variance is below 0; correct its terms")
    full: np.ndarray = 0.5 * (matrices + mirrored)
    least = float(np.linalg.eigvalsh(full / np.where(unit > 0.0, unit, 1.0)).min())
    if least < -_NEGATIVE or (np.abs(full) > unit * (1.0 + _ASYMMETRY)).any():
        raise ScenarioError(
            f"{where}: is not positive semidefinite, so no distribution has it; correct its terms{cure and f', {cure}'}"
        )
    return full


def describe_unlikely_units(
    covariance: Any, unit: Literal["km", "m"], suspected: Literal["larger", "smaller", "both"] = "both"
) -> str:
    """Describe sigmas of a covariance that look like another unit than that of their source; empty where they do not.

    Larger than those of a lost object, they look like the next smaller unit (m for km, mm for m); less than those of precise
    orbits, like the next larger one.

    Parameters
    ----------
    covariance : (…, 6, 6) [m2, m2/s, m2/s2]; sigmas of 0 are not stated
    unit : of length, in which the source states it
    suspected : units that its author may have used instead

    Returns
    -------
    str
        sigmas, what they would be in the other unit, and the cure
    """
    variances = np.diagonal(np.asarray(covariance), axis1=-2, axis2=-1).reshape(-1, 6)
    place_m, speed_m_s = (float(np.sqrt(variances[:, part].max())) for part in (slice(0, 3), slice(3, 6)))
    known = _format_sigmas(place_m, speed_m_s)
    if suspected != "larger" and (place_m > _LOST_M or speed_m_s > _LOST_M_S):
        smaller, other = {"km": "m", "m": "mm"}[unit], _format_sigmas(place_m / units.KM, speed_m_s / units.KM)
        return (
            f"{known} is that of a lost object, over {_LOST_M / units.KM:g} km or {_LOST_M_S:g} m/s; read in {smaller} "
            f"instead of {unit}, it would be {other}: then divide terms of a covariance by 1e6, and sigmas by 1000"
        )
    if suspected != "smaller" and 0.0 < place_m < _PRECISE_M and speed_m_s < _PRECISE_M_S:
        larger, other = {"km": "Mm", "m": "km"}[unit], _format_sigmas(place_m * units.KM, speed_m_s * units.KM)
        return (
            f"{known} is less than that of precise orbits; read in {larger} instead of {unit}, it would be {other}: then "
            "multiply terms of a covariance by 1e6, and sigmas by 1000"
        )
    return ""


def _format_sigmas(place_m: float, speed_m_s: float) -> str:
    words = [f"{value:.4g} {unit}" for value, unit in ((place_m, "m"), (speed_m_s, "m/s")) if value > 0.0]
    return f"a sigma of {' and '.join(words)}"
