"""Motion that a Functional Mock-up Unit computes."""

from __future__ import annotations

from typing import ClassVar, Literal, Self

import numpy as np
from pydantic import Field, model_validator

from rso_lidar.motion.dynamics.flight import Flight
from rso_lidar.motion.dynamics.fmu_history import PrescribedFmu, interpolate_cubic
from rso_lidar.motion.motions.placement import Place, PlacedMotion
from rso_lidar.orbit.epochs import Epochs
from rso_lidar.part import Name


class FmuMotion(PrescribedFmu, PlacedMotion):
    """Motion by an FMU (FMI 2 or 3) without inputs: position and velocity as functions of time.

    Quantities of `outputs`: `position_m` and `velocity_m_s` in `axes`, three elements each. The FMU has the grid
    `step_s`; between its points position and velocity are cubic polynomials that meet both ends.
    """

    input_units: ClassVar[dict[str, tuple[str, int]]] = {}
    output_units: ClassVar[dict[str, tuple[str, int]]] = {"position_m": ("m", 3), "velocity_m_s": ("m/s", 3)}

    type: Literal["fmu"] = "fmu"
    axes: Literal["inertial", "local", "rtn"] = Field(
        default="inertial",
        description="Axes of position and velocity: `inertial`, `local` (no Earth), or `rtn` of `relative_to`.",
    )
    relative_to: Name | None = Field(default=None, description="Body in whose rotating rtn axes the motion is given.")

    @model_validator(mode="after")
    def _whole(self) -> Self:
        if (self.axes == "rtn") != (self.relative_to is not None):
            raise ValueError('axes = "rtn" and relative_to belong together: give both, or neither')
        return self

    @property
    def orbits(self) -> bool:
        """Whether the body has an orbit, and therefore rtn axes."""
        return self.axes != "local"

    def place(self, epochs: Epochs, flight: Flight | None) -> Place:
        """Interpolate position and velocity in `axes`."""
        before, after, share = self.history().around(epochs.time_s)
        rates = before[:, 3:6], after[:, 3:6]
        position, velocity = interpolate_cubic(before[:, :3], after[:, :3], rates, share, self.step_s)
        return Place(position, velocity)

    def breaks_s(self, epochs: Epochs) -> np.ndarray:
        """Return the start of the run, because an FMU has no state before it.

        Parameters
        ----------
        epochs : not used.

        Returns
        -------
        the instant 0 (1,) [s].
        """
        return np.zeros(1)
