"""The protocol of controllers, which turn an observation into a command."""

from __future__ import annotations

from typing import Protocol, runtime_checkable

from rso_lidar.records import Command, Observation


@runtime_checkable
class Controller(Protocol):
    """Protocol of user-defined controllers: a function, or any callable object.

    It is called once after each flash, in order, with what the spacecraft could measure; truth and labels are not part of
    it. The returned command acts from the next flash on. `Pointing` and `examples/seams/own_tracker.py` are examples.
    """

    def __call__(self, observation: Observation) -> Command | None:
        """Return the command for the next flash; None, or a field that is None, keeps the scenario's demand.

        Parameters
        ----------
        observation : time, reading, line of sight, measured pan and tilt, and settings of the flash
        """
