"""The base of motions that are evaluated in the axes in which they are given."""

from __future__ import annotations

from abc import abstractmethod
from typing import ClassVar, NamedTuple

import numpy as np

from rso_lidar.motion.attitudes.situation import Orientation, Situation
from rso_lidar.motion.dynamics.commands import CommandedFlight
from rso_lidar.orbit import Epochs
from rso_lidar.part import Part


class Place(NamedTuple):
    """Position and velocity of a body's origin, in the axes in which its motion is given.

    Parameters
    ----------
    position_m, velocity_m_s : (time, 3) [m], [m/s]
    rates : derivatives of both (time, 3) [m/s], [m/s2]; None if unknown
    """

    position_m: np.ndarray
    velocity_m_s: np.ndarray
    rates: tuple[np.ndarray, np.ndarray] | None = None


class PlacedMotion(Part):
    """Base of motions that are evaluated in their own axes: those of a body, of its orbit, or of the root."""

    is_attached: ClassVar[bool] = False  # whether it moves with the body axes of `relative_to`, and turns with them

    @property
    def orbits(self) -> bool:
        """Whether the body has an orbit, and therefore rtn axes."""
        return False

    @abstractmethod
    def place(self, epochs: Epochs, flight: CommandedFlight | None) -> Place:
        """Compute position and velocity of the body's origin.

        Parameters
        ----------
        epochs : instants
        flight : of a state-space model or an FMU; None for any other motion

        Returns
        -------
        position [m] and velocity [m/s] (time, 3) in the axes of the motion
        """

    def orient(self, situation: Situation) -> Orientation | None:
        """Compute the attitude that the motion prescribes.

        Parameters
        ----------
        situation : of the body

        Returns
        -------
        attitude and body rates; None if the motion prescribes no attitude
        """
        return None
