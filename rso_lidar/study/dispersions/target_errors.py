"""Errors of a start that element sets state, and errors of the target's attitude."""

from __future__ import annotations

import numpy as np

from rso_lidar import units
from rso_lidar.errors import add_place, suppress_warnings
from rso_lidar.mission_analysis import estimate_set_errors
from rso_lidar.motion import Chief
from rso_lidar.orbit import Catalog, Epochs, select_object
from rso_lidar.pose import skew
from rso_lidar.rpo import rtn_matrix
from rso_lidar.scenario import Dispersion, ElementSetErrors, Scenario, StateErrors, TargetErrors


def resolve_element_sets(scenario: Scenario, target: str) -> Dispersion:
    """Return the dispersion of a scenario with the covariances that element sets state in place of their names.

    Parameters
    ----------
    scenario : with the table `dispersion`
    target : name of the target, in whose rtn axes covariances are

    Raises
    ------
    ScenarioError, CatalogError
        If a file has no such object, too few sets, or none of that age.
    """
    dispersion = scenario.dispersion or Dispersion()
    changes: dict[str, object] = {}
    if dispersion.start is not None:
        changes |= _resolve(dispersion, scenario, target, "dispersion.start")
    if dispersion.target is not None and dispersion.target.start is not None:
        fields = _resolve(dispersion.target, scenario, target, "dispersion.target.start")
        with suppress_warnings():  # about units: these numbers are computed
            changes["target"] = dispersion.target.replace(**fields)
    with suppress_warnings():
        return dispersion.replace(**changes) if changes else dispersion


def _resolve(errors: StateErrors, scenario: Scenario, target: str, place: str) -> dict[str, object]:
    """Return the fields of errors of a state with a covariance in place of element sets."""
    assert errors.start is not None
    with scenario.locate_errors(place):
        covariance = find_set_covariance(errors.start, scenario)
    start = Chief(scenario.bodies, target).states(Epochs(scenario.time.start_utc, np.zeros(1)))
    turn_rad_s = rtn_matrix(start.position_m, start.velocity_m_s)[1][0]
    back = np.eye(6)  # velocities relative to the rotating axes: v - omega x r
    back[3:, :3] = -skew(turn_rad_s)
    rotating = back @ covariance @ back.T
    rotating = 0.5 * (rotating + rotating.T)
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


class TargetAttitude:
    """Where the follower is in the body axes of the target, whose attitude has errors.

    A run's attitude is inertial_from_body times a rotation by the vector theta = theta_0 + drift t in body axes.

    Parameters
    ----------
    errors : standard deviations
    body_from_rtn : (time, 3, 3) attitude without errors
    time_s : (time,) instants of the samples [s]
    """

    n_numbers = 6

    def __init__(self, errors: TargetErrors, body_from_rtn: np.ndarray, time_s: np.ndarray) -> None:
        self._body_from_rtn, self._time_s = body_from_rtn, time_s
        self._sigma_rad = np.array([errors.attitude_sigma_deg, errors.rate_sigma_deg_s]) * units.DEG

    def place(self, position_m: np.ndarray) -> np.ndarray:
        """Return positions (…, time, 3) in body axes without errors of attitude from those in rtn axes [m]."""
        in_body_m: np.ndarray = np.einsum("tij,...tj->...ti", self._body_from_rtn, position_m)
        return in_body_m

    def place_runs(self, position_m: np.ndarray, numbers: np.ndarray) -> np.ndarray:
        """Return positions of runs in the target's body axes.

        Parameters
        ----------
        position_m : (run, time, 3) in rtn axes [m]
        numbers : (run, 6) standard normal, of the attitude and its drift

        Returns
        -------
        (run, time, 3) [m]
        """
        from scipy.spatial.transform import Rotation

        constant, drift = numbers[:, None, :3] * self._sigma_rad[0], numbers[:, None, 3:] * self._sigma_rad[1]
        turned = constant + drift * self._time_s[:, None]
        back = Rotation.from_rotvec(-turned.reshape(-1, 3))
        in_body_m: np.ndarray = back.apply(self.place(position_m).reshape(-1, 3)).reshape(position_m.shape)
        return in_body_m

    def find_linear_sigma_m(self, nominal_m: np.ndarray, covariance: np.ndarray) -> np.ndarray:
        """Return standard deviations (time, 3) [m] in body axes by linear covariance.

        Parameters
        ----------
        nominal_m : (time, 3) path without errors in rtn axes [m]
        covariance : (time, 3, 3) of the position there [m2]
        """
        turn = self._body_from_rtn
        whole = turn @ covariance @ np.swapaxes(turn, 1, 2)
        crossed = np.stack([skew(place_m) for place_m in self.place(nominal_m)])  # p x theta
        angles = self._sigma_rad[0] ** 2 + (self._time_s[:, None] * self._sigma_rad[1]) ** 2
        whole = whole + np.einsum("tij,tj,tkj->tik", crossed, angles, crossed)
        sigma: np.ndarray = np.sqrt(np.diagonal(whole, axis1=1, axis2=2))
        return sigma
