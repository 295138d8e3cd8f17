"""The attitude of a body while its orbit is integrated: an attitude law at one state."""

from __future__ import annotations

import datetime
from dataclasses import dataclass
from typing import Any, NoReturn

import numpy as np

from rso_lidar.errors import ScenarioError
from rso_lidar.motion.attitudes.attitude_hold import FixedAttitude
from rso_lidar.motion.attitudes.situation import Situation, looks_at, orient
from rso_lidar.orbit import Epochs, sun_position_m
from rso_lidar.part import kind_of
from rso_lidar.pose import cross
from rso_lidar.rpo import rtn_matrix


@dataclass(frozen=True)
class PrescribedAttitude:
    """An attitude law as a function of time and state, for what acts on a body by its attitude.

    Parameters
    ----------
    law : the attitude of the body; None for axes parallel to those of GCRS

    Raises
    ------
    ScenarioError
        If the law follows from torques or looks at another body, neither of which is known while the orbit is integrated
    """

    law: Any

    def __post_init__(self) -> None:
        if getattr(self.law, "facet_model", None) is not None or looks_at(self.law):
            raise ScenarioError(
                f"attitude: '{kind_of(self.law)}' is not known while forces.facets integrates the orbit; use an attitude "
                "that time, orbit and Sun decide, or drag and radiation_pressure"
            )

    def __call__(
        self,
        start_utc: datetime.datetime,
        time_s: float,
        position_m: tuple[float, float, float],
        velocity_m_s: tuple[float, float, float],
    ) -> np.ndarray:
        """Return the matrix (3, 3) gcrs_from_body.

        Parameters
        ----------
        start_utc : start of the run
        time_s : of the attitude [s]
        position_m, velocity_m_s : state in GCRS axes [m], [m/s]
        """
        from scipy.spatial.transform import Rotation

        epochs = Epochs(start_utc, np.array([time_s]))
        position, velocity = np.array([position_m]), np.array([velocity_m_s])
        rtn, _ = rtn_matrix(position, velocity)
        turning = np.array([[0.0, 0.0, float(np.linalg.norm(cross(position, velocity)) / np.sum(position**2))]])

        def refuse(*_: Any) -> NoReturn:
            raise ScenarioError(
                f"attitude: '{kind_of(self.law)}' asks for other bodies or other times, which are not known while "
                "forces.facets integrates the orbit; use drag and radiation_pressure"
            )

        situation = Situation(
            epochs=epochs,
            position_m=position,
            velocity_m_s=velocity,
            orbits=True,
            root_from_origin=Rotation.from_matrix(rtn),
            origin_rate_rad_s=turning,
            sun_m=sun_position_m(epochs),
            local=False,
            line=refuse,
            at=refuse,
            origin_of=refuse,
            flight_of=refuse,
            list_motions=refuse,
        )
        orientation = orient(self.law or FixedAttitude(), situation)
        matrix: np.ndarray = orientation.rotation.as_matrix().reshape(-1, 3, 3)[0]
        return rtn[0] @ matrix if orientation.in_origin else matrix
