"""Attitude that a Functional Mock-up Unit computes."""

from __future__ import annotations

from typing import ClassVar, Literal

import numpy as np

from rso_lidar.errors import ScenarioError
from rso_lidar.motion.attitudes.situation import Orientation, Situation
from rso_lidar.motion.dynamics.fmu_history import THROTTLES, TORQUES, FmuDynamics, FmuHistory
from rso_lidar.part import UNIT_NORM_WITHIN
from rso_lidar.units import DEG


class FmuAttitude(FmuDynamics):
    """Attitude by an FMU (FMI 2 or 3), as a function of time or under commands.

    Quantities of `outputs`: `quaternion_xyzw`, inertial_from_body with four elements, and `body_rate_rad_s`, the angular
    velocity in body axes with three. The FMU has the grid `step_s`. Between its points the body turns about a fixed axis,
    and the rate changes linearly. Quantities of `inputs`: `torque_n_m` and `throttle_fraction`.
    """

    input_units: ClassVar[dict[str, tuple[str, int]]] = {**TORQUES, **THROTTLES}
    output_units: ClassVar[dict[str, tuple[str, int]]] = {"quaternion_xyzw": ("1", 4), "body_rate_rad_s": ("rad/s", 3)}
    optional_names: ClassVar[frozenset[str]] = frozenset(input_units)

    unnoticed_error: ClassVar[tuple[float, str]] = (0.05, "deg")  # 1 cm at the end of a craft of 23 m; assumed

    type: Literal["fmu"] = "fmu"

    def _measure_errors(self, flown: np.ndarray, compared: np.ndarray) -> np.ndarray:
        dot = np.abs(np.sum(flown[:, :4] * compared[:, :4], axis=1))
        errors_deg: np.ndarray = 2.0 * np.arccos(np.minimum(dot, 1.0)) / DEG
        return errors_deg

    def orient(self, situation: Situation) -> Orientation:
        """Return the attitude in root axes."""
        from scipy.spatial.transform import Rotation

        flight = situation.flight_of(self)
        assert isinstance(flight, FmuHistory)
        before, after, share = flight.around(situation.epochs.time_s)
        for rows in (before, after):
            norms = np.linalg.norm(rows[:, :4], axis=1)
            if (np.abs(norms - 1.0) > UNIT_NORM_WITHIN).any():
                raise ScenarioError(
                    f"{self.file}: `quaternion_xyzw` has the norm {norms[np.abs(norms - 1.0).argmax()]:.6g}; map a unit "
                    "quaternion with the order x, y, z, w"
                )
        first = Rotation.from_quat(before[:, :4])
        turn = (first.inv() * Rotation.from_quat(after[:, :4])).as_rotvec()
        rotation = first * Rotation.from_rotvec(share[:, None] * turn)
        return Orientation(rotation, before[:, 4:7] + share[:, None] * (after[:, 4:7] - before[:, 4:7]))
