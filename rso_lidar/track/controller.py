"""What flies as a controller: the seam between an observation and a command."""

from __future__ import annotations

from typing import Protocol, runtime_checkable

from rso_lidar.records import Command, Observation


@runtime_checkable
class Controller(Protocol):
    """What a Python object needs to control a simulation: a function will do, or an object that is called.

    It is called once after each flash, in order, with what the spacecraft could know: never with truth or labels. What it
    returns acts from the next flash on. `Pointing` is one; `examples/seams/own_tracker.py` flies another.
    """

    def __call__(self, observation: Observation) -> Command | None:
        """Return what to ask of the next flash; None, or a field that is None, keeps the scenario's demand.

        Parameters
        ----------
        observation : time, reading, line of sight, measured pan and tilt, and settings of the flash.
        """
