"""Errors of the target's attitude."""

from __future__ import annotations

import numpy as np

from rso_lidar import units
from rso_lidar.pose import skew
from rso_lidar.scenario import TargetErrors


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
