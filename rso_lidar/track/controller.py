"""The protocols of controllers, which turn an observation into a command, and may command between the flashes too."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Protocol, runtime_checkable

from rso_lidar.records import Command, Observation, SensorSamples


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


@runtime_checkable
class FastController(Controller, Protocol):
    """Protocol of controllers that also command between the flashes, as ``simulate(..., command_rate_hz=50)`` asks them to.

    Such a controller is called after each flash as any other, and its command acts from then on until the next command.
    `Pointing` and `FmuController` are examples.
    """

    def command_at(self, time_s: float, samples: Mapping[str, SensorSamples]) -> Command | None:
        """Return the command that acts from now until the next command; None, or a field that is None, is the scenario's.

        Parameters
        ----------
        time_s : present time [s since start_utc]
        samples : samples of the other sensors that became available since the command before, by name
        """
