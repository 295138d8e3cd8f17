"""What moves about another body: anything that answers `relative` about a chief, which is a trajectory."""

from __future__ import annotations

from abc import abstractmethod

import numpy as np
from pydantic import Field

from rso_lidar.orbit.epochs import Epochs
from rso_lidar.orbit.trajectory import Trajectory
from rso_lidar.part import Name, Part, Vector
from rso_lidar.rpo.limits import Velocity


class RelativeMotion(Part):
    """The base of motions about the body `relative_to`, in its rotating rtn axes (x out, z along r x v, y = z x x)."""

    relative_to: Name = Field(description="Name of a body that orbits, by any orbital motion.")

    @abstractmethod
    def relative(self, epochs: Epochs, chief: Trajectory) -> tuple[np.ndarray, np.ndarray]:
        """Return position [m] and velocity [m/s] (time, 3) in the chief's rtn axes, the velocity as those axes see it."""

    def breaks_s(self, epochs: Epochs, chief: Trajectory) -> np.ndarray:
        """Return the instants [s] after the start of `epochs` at which the relative velocity jumps or has a corner."""
        return np.empty(0)

    @abstractmethod
    def validity(self, epochs: Epochs, chief: Trajectory) -> list[str]:
        """Return one sentence for each way in which the model is stretched at these epochs, naming the better one."""


class RelativeState(RelativeMotion):
    """The base of relative motions that begin with a position and a velocity in the chief's rtn axes at `start_utc`."""

    position_m: Vector = Field(
        description=(
            "Position at `start_utc` in the rtn axes of that body: x radially outward, y along-track, z along the "
            "orbit normal [m]."
        )
    )
    velocity_m_s: Velocity = Field(description="Velocity at `start_utc` relative to those rotating axes [m/s].")
