"""Motion relative to another body, the chief: anything that answers `relative` about the chief's trajectory."""

from __future__ import annotations

from abc import abstractmethod
from typing import ClassVar

import numpy as np
from pydantic import Field

from rso_lidar.errors import ScenarioError
from rso_lidar.orbit import EARTH, CentralBody, Epochs, Trajectory
from rso_lidar.part import Name, Part, Vector, kind_of
from rso_lidar.rpo.limits import Velocity


class RtnMotion(Part):
    """Base of motions about a chief, which `relative_to` names, in its rotating rtn axes.

    rtn: x radially outward, z along r x v, y = z x x. `any_center` states whether the model takes the gravity of the body
    about which the chief orbits; otherwise it has the Earth's.
    """

    any_center: ClassVar[bool] = False

    def check_center(self, center: CentralBody) -> None:
        """Check that the model applies to a chief that orbits about a body.

        Parameters
        ----------
        center : the body about which the chief orbits

        Raises
        ------
        ScenarioError
            if the model has the Earth's gravity, and that is another body
        """
        if center is not EARTH and not self.any_center:
            raise ScenarioError(
                f"'{kind_of(self)}' has the Earth's gravity, and '{getattr(self, 'relative_to', 'its chief')}' orbits about "
                f"{center.name}; use 'hill', 'yamanaka_ankersen', 'nonlinear' without forces, or a plan of impulses"
            )

    @abstractmethod
    def relative(self, epochs: Epochs, chief: Trajectory) -> tuple[np.ndarray, np.ndarray]:
        """Return position [m] and velocity [m/s] (time, 3) in the chief's rotating rtn axes.

        Parameters
        ----------
        epochs : instants
        chief : trajectory of the chief
        """

    def breaks_s(self, epochs: Epochs, chief: Trajectory) -> np.ndarray:
        """Return the times since the `start_utc` of `epochs` [s] at which the relative velocity jumps or has a corner.

        Parameters
        ----------
        epochs : instants
        chief : trajectory of the chief
        """
        return np.empty(0)

    @abstractmethod
    def validity(self, epochs: Epochs, chief: Trajectory) -> list[str]:
        """Return one sentence for each limit of the model that these epochs exceed, with a better choice.

        Parameters
        ----------
        epochs : instants
        chief : trajectory of the chief
        """


class RelativeMotion(RtnMotion):
    """Base of motions about the body `relative_to` that state its name themselves."""

    relative_to: Name = Field(description="Name of a body that orbits, by any orbital motion.")


class RelativeState(RelativeMotion):
    """Base of relative motions that begin with a position and a velocity in the chief's rtn axes at `start_utc`."""

    position_m: Vector = Field(
        description=(
            "Position at `start_utc` in the rtn axes of that body: x radially outward, y along-track, z along the "
            "orbit normal [m]."
        )
    )
    velocity_m_s: Velocity = Field(description="Velocity at `start_utc` relative to those rotating axes [m/s].")
