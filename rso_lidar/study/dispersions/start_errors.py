"""Errors of a start that a file states: covariances of messages and of fits, and differences of element sets."""

from __future__ import annotations

import numpy as np

from rso_lidar import units
from rso_lidar.errors import PropagationError, add_place, rephrase, suppress_warnings, warn_of_input
from rso_lidar.mission_analysis import estimate_set_errors
from rso_lidar.motion import Chief
from rso_lidar.orbit import (
    Catalog,
    Epochs,
    gcrs_state_matrix,
    invert_state_matrix,
    orbit_state_matrix,
    read_covariances,
    select_object,
)
from rso_lidar.records import BodyState
from rso_lidar.scenario import CovarianceErrors, Dispersion, ElementSetErrors, Scenario, StateErrors

_APART_RAD = (
    0.01  # between body and covariance, seen from the Earth's centre: 70 km in low orbit, where axes differ by 0.6 deg
)


def resolve_start_errors(scenario: Scenario, target: str) -> Dispersion:
    """Return the dispersion of a scenario with the covariances that files state in place of their names.

    Parameters
    ----------
    scenario : with the table `dispersion`
    target : name of the target, in whose rtn axes covariances are

    Raises
    ------
    ScenarioError, CatalogError, PropagationError
        If a file has no such object, too few sets, none of that age, or no covariance at the start.
    """
    dispersion = scenario.dispersion or Dispersion()
    changes: dict[str, object] = {}
    if dispersion.target is not None and dispersion.target.start is not None:
        fields = _resolve(dispersion.target, scenario, target, target, "dispersion.target.start")
        with suppress_warnings():  # about units: these numbers are computed
            changes["target"] = dispersion.target.replace(**fields)
    if dispersion.start is not None:
        changes |= _resolve(dispersion, scenario, target, scenario.bodies[-1].name, "dispersion.start")
    with suppress_warnings(), scenario.locate_errors("dispersion"):
        return dispersion.replace(**changes) if changes else dispersion


def _resolve(errors: StateErrors, scenario: Scenario, target: str, body: str, place: str) -> dict[str, object]:
    """Return the fields of errors of a body's state with a covariance in place of a file."""
    assert errors.start is not None
    at = Epochs(scenario.time.start_utc, np.zeros(1))
    there = Chief(scenario.bodies, target).states(at)
    from_rtn = orbit_state_matrix("rtn", there.position_m, there.velocity_m_s, rotating=True)[0]
    with scenario.locate_errors(place):
        own = there if body == target else Chief(scenario.bodies, body).states(at)
        if isinstance(errors.start, ElementSetErrors):
            turn, covariance = gcrs_state_matrix("rtn", at, own)[0], find_set_covariance(errors.start, scenario)
        else:
            turn, covariance = _find_covariance(errors.start, scenario, at, own)
    # by a square root: errors along the track and in radial speed almost cancel in rotating axes, and the difference of
    # their large variances may round to less than nothing
    sigma = np.sqrt(np.diag(covariance))
    scale = np.where(sigma > 0.0, sigma, 1.0)
    values, vectors = np.linalg.eigh(covariance / np.outer(scale, scale))
    root = invert_state_matrix(from_rtn) @ turn @ (scale[:, None] * vectors * np.sqrt(np.maximum(values, 0.0)))
    rotating = root @ root.T
    return {"start": None, "covariance": tuple(map(tuple, rotating.tolist()))}


def find_set_covariance(errors: ElementSetErrors, scenario: Scenario) -> np.ndarray:
    """Return the covariance (6, 6) of inertial position and velocity along rtn axes [m2, m2/s, m2/s2].

    Parameters
    ----------
    scenario : beside whose file that file lies, and whose start tells the age where none is given
    """
    catalog = Catalog.from_file(scenario.file(errors.file))
    sets = select_object(catalog.sets, catalog.where, errors.name, errors.norad_id)
    age_days = errors.age_days
    if age_days is None:
        at = Epochs(scenario.time.start_utc, np.zeros(1))
        age_days = min(abs(float(at.since(element_set.epoch_utc)[0])) for element_set in sets) / units.DAY_S
    with add_place(errors.file):
        return estimate_set_errors(list(sets)).covariance_at(age_days)


def _find_covariance(
    errors: CovarianceErrors, scenario: Scenario, at: Epochs, state: BodyState
) -> tuple[np.ndarray, np.ndarray]:
    """Return the covariance (6, 6) of a body's state at the start [m2, m2/s, m2/s2], and what turns states to GCRS axes.

    Parameters
    ----------
    at, state : the start, and the state (1, 3) of the body there
    """
    if errors.file is None:
        turn = gcrs_state_matrix(errors.axes, at, state, rotating=errors.rotating)[0]
        return turn, np.array(errors.matrix)
    orientation = errors.earth_orientation_file
    history = read_covariances(
        scenario.file(errors.file),
        errors.object,
        earth_orientation_file=None if orientation is None else str(scenario.file(orientation)),
    )
    if not history.has_velocity:
        warn_of_input(f"{errors.file}: {history.label}: states no covariance of velocity, which counts as known")
    # in rtn axes of its own orbit, so that a small distance between the two along the track does not turn it
    try:
        covariance = history.at(at, axes="rtn", rotating=True, beyond="two_body" if errors.propagate else "error")[0]
    except PropagationError as error:
        if errors.propagate or not history.has_velocity:
            raise
        cause = str(error).rpartition("; ")[0]
        cure = "give one at the start, or set propagate = true for two-body motion"
        raise rephrase(error, f"{cause}; {cure}") from None
    away = history.reference.states(at).position_m[0]
    here = state.position_m[0]
    apart_rad = float(np.arccos(np.clip(away @ here / np.linalg.norm(away) / np.linalg.norm(here), -1.0, 1.0)))
    if apart_rad > _APART_RAD:
        warn_of_input(
            f"{errors.file}: {history.label} is {float(np.linalg.norm(away - here)) / units.KM:,.0f} km from the body whose "
            "errors it states; name the object, or the file, of that body"
        )
    turn = orbit_state_matrix("rtn", state.position_m, state.velocity_m_s, rotating=True)[0]
    return turn, covariance
