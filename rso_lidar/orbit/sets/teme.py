"""States by SGP4 in TEME axes.

SGP4 is the sgp4 library's (Vallado et al., AIAA 2006-6753, WGS72). TEME to GCRS is skyfield's rotation. Velocity is only
rotated, as in skyfield: the axes turn by 1e-11 rad/s.
"""

from __future__ import annotations

import functools

import numpy as np

from rso_lidar import units
from rso_lidar.errors import PropagationError, warn
from rso_lidar.orbit.epochs import Epochs, format_utc
from rso_lidar.orbit.sets.decay import DecayTimes
from rso_lidar.orbit.sets.element_set import ElementSet
from rso_lidar.orbit.sky.axes_of_date import gcrs_from_axes_of_date
from rso_lidar.pose import rotate_vectors
from rso_lidar.records import BodyState

STALE_DAYS = 7.0
# Vallado's published verification of SGP4 (AIAA 2006-6753) extends to 1281 days from an epoch (20413). The
# theory has one constant B* for drag, but air density changes by up to ten within half a solar cycle, 5.5 years.
MOST_YEARS = 5.0
MOST_AGE_S = MOST_YEARS * 365.25 * units.DAY_S
TOO_OLD = 101  # error code in addition to those of Vallado's program
_LOWEST_M, _HIGHEST_M = units.EARTH_RADIUS_M - 50e3, 1e9  # SGP4 may continue below the ground, and beyond the Moon
# Meanings of the error codes of Vallado's program.
REASONS = {
    1: "its mean eccentricity has left 0 to 1: the orbit has decayed, or the set does not describe an orbit",
    2: "its mean motion is not above 0: the set does not describe an orbit",
    3: "its perturbed eccentricity has left 0 to 1: the set does not describe a closed orbit",
    4: "its orbit has shrunk to nothing (the semi-latus rectum is below 0)",
    5: "its orbit runs below the ground",
    6: "it has decayed (its distance is less than the Earth's radius)",
}
_ASTRAY = "it has decayed, or its state is impossible"
_OUT_OF_DATE = (
    f"it is more than {MOST_YEARS:g} years from the epoch of the elements, where they no longer describe the orbit"
)


def propagate_sgp4(elements: ElementSet, epochs: Epochs) -> BodyState:
    """Propagate an element set by SGP4 to states in GCRS axes.

    Element sets are good to about a kilometre at their epoch, and lose one to three kilometres a day. More than a week
    from the epoch there is a warning, and beyond `MOST_YEARS` no state.

    Parameters
    ----------
    elements : the element set
    epochs : instants

    Returns
    -------
    BodyState
        position [m] and velocity [m/s] (time, 3) in GCRS axes

    Raises
    ------
    PropagationError
        if SGP4 has no state at an epoch; its `bad` masks those epochs
    """
    warn_stale(elements, age_days(elements, epochs))
    position_m, velocity_m_s, error = propagate_in_teme(elements, epochs)
    bad = find_failures(position_m, velocity_m_s, error)
    if bad.any():
        raise PropagationError(describe_failure(elements, epochs, bad, error), bad)
    rotation = gcrs_from_teme(epochs)
    return BodyState(rotate_vectors(rotation, position_m), rotate_vectors(rotation, velocity_m_s))


def age_days(elements: ElementSet, epochs: Epochs) -> float:
    """Return the greatest time between the epoch of the elements and some epochs [day]."""
    return float(np.abs(epochs.since(elements.epoch_utc)).max(initial=0.0)) / units.DAY_S


def warn_stale(elements: ElementSet, days: float) -> None:
    """Warn where elements are used more than a week from their epoch; beyond `MOST_YEARS` they are refused instead."""
    if STALE_DAYS < days <= MOST_AGE_S / units.DAY_S:
        warn(
            f"{elements.kind} {elements.label}: propagated {days:.1f} days from its epoch "
            f"{elements.epoch_utc:%Y-%m-%dT%H:%MZ}: "
            f"beyond {STALE_DAYS:g} days expect errors of many kilometres; take a set nearer to the run"
        )


def find_failures(position_m: np.ndarray, velocity_m_s: np.ndarray, error: np.ndarray) -> np.ndarray:
    """Find the epochs (…) at which SGP4 gives no state, or an impossible one.

    Parameters
    ----------
    position_m, velocity_m_s : (…, 3) states in TEME axes [m], [m/s]
    error : (…) error codes
    """
    bad: np.ndarray = (error != 0) | ~np.isfinite(position_m).all(axis=-1) | ~np.isfinite(velocity_m_s).all(axis=-1)
    radius_m = np.linalg.norm(position_m, axis=-1)
    bad |= ~((radius_m > _LOWEST_M) & (radius_m < _HIGHEST_M))  # decayed, or astray after years of drag
    return bad


def describe_error(error: int) -> str:
    """Describe in words why there is no state, from an error code; 0 means a state that is physically impossible."""
    return _OUT_OF_DATE if error == TOO_OLD else REASONS.get(error, _ASTRAY)


def describe_failure(elements: ElementSet, epochs: Epochs, bad: np.ndarray, error: np.ndarray) -> str:
    """Describe in words which element set SGP4 cannot propagate, when, and why.

    Parameters
    ----------
    bad : (time,) mask of failures
    error : (time,) error codes
    """
    first = int(np.argmax(bad))
    code = int(error[first])
    why = describe_error(code) + (f", SGP4 error {code}" if code in REASONS else "")
    since_s = float(epochs.since(elements.epoch_utc)[first])
    why += describe_decay(elements, find_decay_times(elements).since_epoch_s(0, since_s)) if code != TOO_OLD else ""
    return (
        f"{elements.kind} {elements.label}: SGP4 has no state at {int(bad.sum())} of {len(bad)} epochs, first at "
        f"time_s = {epochs.time_s[first]:g}: {why}; use epochs nearer to the elements' epoch "
        f"{elements.epoch_utc:%Y-%m-%dT%H:%MZ}, or take another set"
    )


@functools.lru_cache(maxsize=256)
def find_decay_times(elements: ElementSet) -> DecayTimes:
    """Return when an element set decays, cached for the same set."""
    return DecayTimes((elements,), (elements.satrec(),), MOST_AGE_S)


def describe_decay(elements: ElementSet, decay_s: float) -> str:
    """Describe when an element set decays, as the end of a clause; an empty text if it does not.

    Parameters
    ----------
    decay_s : when SGP4 first has no state [s since its epoch], negative before it, infinite if never
    """
    if not np.isfinite(decay_s):
        return ""
    instant = format_utc(elements.epoch_utc, decay_s)
    return f", by {instant}" if decay_s >= 0.0 else f", and has no state before {instant}"


def propagate_in_teme(elements: ElementSet, epochs: Epochs) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Propagate an element set by SGP4 to states in TEME axes.

    Returns
    -------
    position_m, velocity_m_s : (time, 3) [m], [m/s]
    error : (time,) error codes, 0 for none; beyond a decay that of the decay (`DecayTimes`)
    """
    error, position_km, velocity_km_s = elements.satrec().sgp4_array(
        *epochs.utc_julian(leap_seconds_at=elements.epoch_utc)
    )
    since_s = epochs.since(elements.epoch_utc)
    error = error.astype(int)
    find_decay_times(elements).mark(error[None], np.zeros(1, dtype=int), np.zeros(1), since_s)
    error[np.abs(since_s) > MOST_AGE_S] = TOO_OLD
    return position_km * units.KM, velocity_km_s * units.KM, error


def gcrs_from_teme(at: Epochs) -> np.ndarray:
    """Return the rotation matrices (time, 3, 3) that take TEME coordinates to GCRS coordinates.

    Parameters
    ----------
    at : instants
    """
    return gcrs_from_axes_of_date("teme", at)
