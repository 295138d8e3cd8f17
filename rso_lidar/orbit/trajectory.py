"""What moves about the Earth: anything that answers `states`."""

from __future__ import annotations

from typing import Protocol, runtime_checkable

from rso_lidar.orbit.epochs import Epochs
from rso_lidar.records import BodyState


@runtime_checkable
class Trajectory(Protocol):
    """Anything whose inertial state is known at any epoch: a motion, a plan, a user's own object."""

    def states(self, epochs: Epochs) -> BodyState:
        """Return position [m] and velocity [m/s] (time, 3) in GCRS axes; what has no answer raises `PropagationError`."""
        ...
