"""The base of motions that answer in the axes they are given in, and what they answer."""

from __future__ import annotations

from abc import abstractmethod
from typing import ClassVar, NamedTuple

import numpy as np

from rso_lidar.motion.attitudes.situation import Orientation, Situation
from rso_lidar.motion.dynamics.flight import Flight
from rso_lidar.orbit.epochs import Epochs
from rso_lidar.part import Part


class Place(NamedTuple):
    """Where a body's origin is, in the axes that its motion is given in.

    Parameters
    ----------
    position_m, velocity_m_s : (time, 3) [m], [m/s].
    rates : derivatives of both (time, 3) [m/s], [m/s2]; None where they are not known.
    """

    position_m: np.ndarray
    velocity_m_s: np.ndarray
    rates: tuple[np.ndarray, np.ndarray] | None = None


class PlacedMotion(Part):
    """A motion that answers in the axes it is given in: those of a body, of its orbit, or of the root."""

    is_attached: ClassVar[bool] = False  # to the body axes of `relative_to`, which turn with that body's attitude

    @property
    def orbits(self) -> bool:
        """Whether the body has an orbit, and so rtn axes."""
        return False

    @abstractmethod
    def place(self, epochs: Epochs, flight: Flight | None) -> Place:
        """Return where the body's origin is; `flight` is that of a state-space model."""

    def orient(self, here: Situation) -> Orientation | None:
        """Return how the motion turns the body; None where it does not."""
        return None
