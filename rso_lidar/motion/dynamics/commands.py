"""What a body's dynamics and their flight have to offer so that a `Command` can give them inputs."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Any

import numpy as np

from rso_lidar.errors import ScenarioError


class CommandedFlight(ABC):
    """Course of one model over time, under inputs that are held from one command to the next."""

    @abstractmethod
    def check_inputs(self, inputs: np.ndarray) -> np.ndarray:
        """Return inputs as an array (m,), or raise `ScenarioError` if they are not as many finite numbers as are needed."""

    @abstractmethod
    def hold(self, time_s: float, inputs: np.ndarray) -> None:
        """Hold new, checked inputs (m,) from `time_s` [s] on, which must not be earlier than the previous command."""

    @abstractmethod
    def save(self) -> Any:
        """Return the present state, from which `restore` goes on."""

    @abstractmethod
    def restore(self, state: Any) -> None:
        """Go on from a state that a flight of the same model saved."""

    @abstractmethod
    def __call__(self, time_s: np.ndarray) -> np.ndarray:
        """Return the state (time, n) at `time_s` (time,) [s]; with an FMU its mapped outputs."""

    @abstractmethod
    def inputs_at(self, time_s: np.ndarray) -> np.ndarray:
        """Return the inputs (time, m) that are held from `time_s` (time,) [s] on."""


class CommandedModel(ABC):
    """Base of motions and attitudes whose inputs a `Command` may replace."""

    @property
    @abstractmethod
    def label(self) -> str:
        """Name of the model in error messages."""

    @property
    @abstractmethod
    def is_commanded(self) -> bool:
        """Whether the model takes commands."""

    @property
    @abstractmethod
    def first_inputs(self) -> tuple[float, ...]:
        """Inputs u at `start_utc`, held until a command replaces them."""

    @abstractmethod
    def begin_flight(self) -> CommandedFlight:
        """Begin a flight under commands."""

    @abstractmethod
    def fly_open_loop(self) -> CommandedFlight:
        """Return the flight without commands, cached until the file of the dynamics changes."""


def check_inputs(inputs: np.ndarray, held: np.ndarray, label: str) -> np.ndarray:
    """Return the inputs (m,) of a command; raise `ScenarioError` unless they are as many finite numbers as `held`."""
    row = np.asarray(inputs, dtype=float)
    if row.shape != held.shape or not np.isfinite(row).all():
        raise ScenarioError(
            f"command: inputs of {label} are {row.tolist()!s:.60}; give {len(held)} finite numbers, one for each of its "
            "`inputs`"
        )
    return row
