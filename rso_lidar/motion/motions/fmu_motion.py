"""Motion that a Functional Mock-up Unit computes."""

from __future__ import annotations

from typing import ClassVar, Literal, Self

import numpy as np
from pydantic import Field, model_validator

from rso_lidar.motion.dynamics.commands import CommandedFlight
from rso_lidar.motion.dynamics.fmu_history import (
    FORCES,
    ON_GRID,
    THROTTLES,
    TORQUES,
    FmuDynamics,
    FmuHistory,
    interpolate_cubic,
)
from rso_lidar.motion.motions.placement import Place, PlacedMotion
from rso_lidar.orbit import Epochs
from rso_lidar.part import Name
from rso_lidar.pose import length

_ACCELERATION, _FORCE = "acceleration_m_s2", "specific_force_m_s2"


class FmuMotion(FmuDynamics, PlacedMotion):
    """Motion by an FMU (FMI 2 or 3): position and velocity as functions of time, or under commands.

    Quantities of `outputs` are `position_m` and `velocity_m_s` in `axes`, three elements each. Two more are optional:
    `acceleration_m_s2`, the derivative of the velocity, and `specific_force_m_s2`, the acceleration by thrust alone, which
    accelerometers read. Under commands a motion in inertial or rtn axes needs the acceleration, because an FMU gives no
    values after the present instant. The FMU has the grid `step_s`; between its points position and velocity are cubic
    polynomials that meet both ends. Quantities of `inputs`: `force_n`, `acceleration_m_s2`, `torque_n_m` and
    `throttle_fraction`.
    """

    input_units: ClassVar[dict[str, tuple[str, int]]] = {**FORCES, **TORQUES, **THROTTLES}
    # Columns of the outputs, in this order: the acceleration is 6 to 8, the specific force the last three.
    output_units: ClassVar[dict[str, tuple[str, int]]] = {
        "position_m": ("m", 3),
        "velocity_m_s": ("m/s", 3),
        _ACCELERATION: ("m/s2", 3),
        _FORCE: ("m/s2", 3),
    }
    optional_names: ClassVar[frozenset[str]] = frozenset({*input_units, _ACCELERATION, _FORCE})

    unnoticed_error: ClassVar[tuple[float, str]] = (0.01, "m")  # as for the light time: a fifth of the range noise

    type: Literal["fmu"] = "fmu"
    axes: Literal["inertial", "local", "rtn"] = Field(
        default="inertial",
        description="Axes of position and velocity: `inertial`, `local` (no Earth), or `rtn` of `relative_to`.",
    )
    relative_to: Name | None = Field(default=None, description="Body in whose rotating rtn axes the motion is given.")

    @model_validator(mode="after")
    def _whole(self) -> Self:
        if (self.axes == "rtn") != (self.relative_to is not None):
            raise ValueError('axes = "rtn" and relative_to belong together; give both, or neither')
        if self.is_commanded and self.orbits and _ACCELERATION not in self.outputs:
            raise ValueError(
                f"outputs: '{_ACCELERATION}' is missing, which a motion under commands needs in {self.axes} axes; name the "
                "FMU's derivative of the velocity"
            )
        return self

    @property
    def orbits(self) -> bool:
        """Whether the body has an orbit, and therefore rtn axes."""
        return self.axes != "local"

    @property
    def states_specific_force(self) -> bool:
        """Whether the FMU states the acceleration by thrust alone."""
        return _FORCE in self.outputs

    def _measure_errors(self, flown: np.ndarray, compared: np.ndarray) -> np.ndarray:
        return length(flown[:, :3] - compared[:, :3])

    def place(self, epochs: Epochs, flight: CommandedFlight | None) -> Place:
        """Interpolate position and velocity in `axes`. For an orbit the result includes their rates."""
        assert isinstance(flight, FmuHistory)
        before, after, share = flight.around(epochs.time_s)
        position, velocity, _ = self._interpolate(before, after, share)
        if not self.orbits:
            return Place(position, velocity)
        if _ACCELERATION in self.outputs:
            acceleration = before[:, 6:9] + share[:, None] * (after[:, 6:9] - before[:, 6:9])
        else:  # within the step that follows; at its ends a cubic has no second derivative
            acceleration = self._interpolate(*flight.around(epochs.time_s + 2.0 * ON_GRID * self.step_s))[2]
        return Place(position, velocity, (velocity, acceleration))

    def _interpolate(
        self, before: np.ndarray, after: np.ndarray, share: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return position, velocity and acceleration (time, 3) of the cubics between outputs."""
        return interpolate_cubic(before[:, :3], after[:, :3], (before[:, 3:6], after[:, 3:6]), share, self.step_s)

    def find_specific_force(self, flight: CommandedFlight | None, time_s: np.ndarray) -> np.ndarray:
        """Interpolate the acceleration by thrust that the FMU states.

        Parameters
        ----------
        flight : under commands; None without them
        time_s : instants (time,) [s]

        Returns
        -------
        acceleration (time, 3) in `axes` [m/s2]
        """
        return (flight or self.fly_open_loop())(time_s)[:, -3:]

    def breaks_s(self, epochs: Epochs) -> np.ndarray:
        """Return the start of the run (1,) [s], because an FMU has no state before it.

        Parameters
        ----------
        epochs : not used
        """
        return np.zeros(1)
