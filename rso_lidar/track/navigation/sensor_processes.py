"""Slow errors of a sensor as states of a Kalman filter: those processes of its error model that have a memory."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np


@dataclass(frozen=True, eq=False)
class SensorProcesses:
    """The processes of one sensor among the error states, in the units of its channels."""

    places: np.ndarray  # (process) indices of the states
    channels: np.ndarray  # (process) to which each is added
    start: np.ndarray  # (process) variance at the start
    decay: np.ndarray  # (process) over one second; 1 for random walks and constants
    variance: np.ndarray  # (process) stationary, where the decay is below 1
    growth: np.ndarray  # (process) of the variance in one second, where it is not

    @staticmethod
    def of(part: Any, first: int) -> SensorProcesses:
        """Return the processes of a sensor whose values `measure` adds to its channels.

        Parameters
        ----------
        part : the sensor
        first : index of its first state
        """
        model = part.error_model
        kept = np.flatnonzero(model.channel >= 0)  # -1: not added, such as a scale factor
        decay, drive, start = model.process[kept].T
        steady = decay < 1.0
        return SensorProcesses(
            first + np.arange(len(kept)),
            model.channel[kept],
            start**2,
            decay**part.rate_hz,
            np.where(steady, start**2, 0.0),
            np.where(steady, 0.0, drive**2 * part.rate_hz),
        )

    def spread(self, count: int, size: int) -> np.ndarray:
        """Return the matrix (channel, state) that adds the processes to the channels of their sensor.

        Parameters
        ----------
        count : number of channels
        size : number of states
        """
        matrix = np.zeros((count, size))
        matrix[self.channels, self.places] = 1.0
        return matrix
